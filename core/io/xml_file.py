# SPDX-License-Identifier: GPL-3.0-or-later
"""XML files from other people: read without entities, and text that XML can hold."""

from __future__ import annotations

import os
import re
from xml.etree import ElementTree

from ..errors import FileError
from .regular_file import read_bounded

LARGEST_FILE = 256 * 2**20
"""Bytes. A mesh of a million vertices, written out with its normals, has about 100 MB."""
_UTF_16 = (b"\xff\xfe", b"\xfe\xff", b"<\x00", b"\x00<")


def read_xml(path: str | os.PathLike, what: str) -> ElementTree.Element:
    """Read an XML file.

    Entities and document types are refused, not expanded: nested entities grow without limit, and others read files.

    Parameters
    ----------
    path : path
    what : str
        What the file should be, for messages, as in "a robot".

    Returns
    -------
    Element
        An element around what the file holds: a fragment of a robot file has several elements side by side and no root.

    Raises
    ------
    FileError
        There is no such file, it is too large, or it is not XML.
    """
    text = read_bounded(path, LARGEST_FILE)
    if text.startswith(_UTF_16):  # "<!ENTITY" would be spelt in other bytes
        raise FileError(f"'{path}' is not in UTF-8: save it so.")
    if b"<!ENTITY" in text or b"<!DOCTYPE" in text:
        raise FileError(f"'{path}' declares XML entities or a document type: write them out, {what} needs none.")
    try:
        body = text[text.index(b"?>") + 2 :] if text.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<?xml") else text
        return ElementTree.fromstring(b"<palpate>" + body.removeprefix(b"\xef\xbb\xbf") + b"</palpate>")
    except (ElementTree.ParseError, ValueError) as error:
        line = getattr(error, "position", (1, 0))[0]
        raise FileError(
            f"Line {line} of '{path}' is not XML ({error}): a tag may have no space behind its '<' and must be closed."
        ) from error


def require_xml_text(name: str) -> None:
    """Raise FileError if a name has a character that XML does not know."""
    if re.search("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]", name):
        raise FileError(f"XML cannot hold the name {ascii(name)}: give the robot or the sensor another one.")
