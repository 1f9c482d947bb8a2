# SPDX-License-Identifier: GPL-3.0-or-later
"""Files from other people: opened only if they are regular files, and read as TOML, XML or meshes.

Opening a FIFO waits for its writer, perhaps for ever, and a device such as ``/dev/zero`` never ends. Every file that a user or
another file names is therefore opened by :func:`open_regular`.
"""

from __future__ import annotations

import os
import re
import stat
import tomllib
from pathlib import Path
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np

from ..errors import FileError, MeshError, read_errors_said
from ..geometry.mesh import TriangleMesh, checked_mesh

_KINDS = {stat.S_IFIFO: "a FIFO", stat.S_IFSOCK: "a socket", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}


def require_regular(path: str | os.PathLike, opened: int | None = None) -> None:
    """Raise :class:`FileError` if `path`, perhaps open as `opened`, is a FIFO, a socket or a device.

    A missing file and a folder pass.
    """
    try:
        kind = _KINDS.get(stat.S_IFMT(os.stat(path if opened is None else opened).st_mode))
    except OSError:
        return
    if kind is not None:
        raise FileError(f"'{Path(path)}' is {kind}, not a file: give the name of a regular file.")


def open_regular(path: str | os.PathLike, mode: str = "rb", **options: Any) -> IO[Any]:
    """Open a regular file as :func:`open` does.

    Parameters
    ----------
    path : path
    mode : str
    **options
        Others of :func:`open`, such as `encoding`.

    Raises
    ------
    FileError
        It is a FIFO, a socket or a device. It is not waited for and nothing is read.
    OSError
        As :func:`open`.
    """
    require_regular(path)  # before it is opened: opening some devices has an effect of its own
    file = open(path, mode, opener=_open_without_waiting, **options)  # noqa: SIM115 - the caller closes it
    try:
        require_regular(path, file.fileno())  # it may have been exchanged meanwhile
    except BaseException:
        file.close()
        raise
    return file


def read_bytes(path: str | os.PathLike) -> bytes:
    """Return the content of a regular file; raises what :func:`open_regular` raises."""
    with open_regular(path) as file:
        return file.read()


def read_bounded(path: str | os.PathLike, limit: int, what: str = "file", advice: str = "give a smaller file") -> bytes:
    """Return the content of a regular file that is not larger than it may be.

    Parameters
    ----------
    path : path
    limit : int
        Bytes; no more are read.
    what : str
        What the file should be, for messages, as in "rig".
    advice : str
        What the user of a larger file should know or do.

    Raises
    ------
    FileError
        There is no such file, it cannot be read, or it is larger.
    """
    with read_errors_said(path, what), open_regular(path) as file:
        content: bytes = file.read(limit + 1)
    if len(content) > limit:
        raise FileError(f"'{path}' is larger than {limit >> 20} MB: {advice}.")
    return content


def _open_without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0), 0o666)


# --- TOML

LARGEST_TOML = 16 * 2**20
"""Bytes; people write these files, and a rig or a sensor has some kilobytes."""
LONGEST_NAME = 255
"""Characters of a name in a file."""


def read_toml(path: str | os.PathLike, what: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : path
    what : str
        What the file describes, for messages, as in "rig".

    Raises
    ------
    FileError
        There is no such file, it cannot be read, or it is not TOML.
    """
    name = Path(path).name
    content = read_bounded(path, LARGEST_TOML, what, f"a {what} has some kilobytes, give another file")
    try:
        return tomllib.loads(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise FileError(f"'{name}' is not a text file in UTF-8: choose a {what}'s .toml.") from error
    except RecursionError as error:
        raise FileError(f"'{name}' nests its tables or lists too deeply: a {what} needs two levels.") from error
    except ValueError as error:  # TOMLDecodeError, or a number of thousands of digits
        raise FileError(f"'{name}' is not TOML ({error}): mend that line.") from error


def checked_name(name: Any, where: str) -> str:
    """Return a name that a file gives.

    Raises
    ------
    FileError
        It is no text, or a text that cannot be a name; `where` says of which file.
    """
    if not isinstance(name, str) or not name.strip():
        raise FileError(f"The name in {where} is {name!r:.60}: write a text.")
    if len(name) > LONGEST_NAME:
        raise FileError(f"The name in {where} has {len(name)} characters: give it at most {LONGEST_NAME}.")
    if not name.isprintable():
        raise FileError(f"The name in {where} is {name!r:.60}, which has control characters: write it without them.")
    return name


def is_number(value: Any) -> bool:
    """Return whether a value of a file is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1.7e308


# --- XML

LARGEST_XML = 256 * 2**20
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
    text = read_bounded(path, LARGEST_XML)
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


# --- meshes

MESH_SUFFIXES = (".stl", ".ply", ".obj", ".off")
"""Endings of the files that are read."""


def load_mesh(path: str | os.PathLike) -> TriangleMesh:
    """Read a mesh. Vertices at the same place become one, as STL repeats them for each face.

    Raises
    ------
    FileError
        There is no such file, or it is none of these formats.
    MeshError
        It has no faces with an area, or a coordinate is not finite.
    """
    import trimesh

    name, suffix = Path(path).name, Path(path).suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise FileError(f"'{path}' is not a mesh file: give one that ends with {', '.join(MESH_SUFFIXES)}.")
    try:
        with open_regular(path) as file:
            loaded = trimesh.load_mesh(file, file_type=suffix[1:], process=False)
    except FileNotFoundError as error:
        raise FileError(f"There is no mesh file '{path}': check its name and folder.") from error
    except MemoryError:
        raise
    except Exception as error:  # a reader meets anything in a damaged file
        words = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"'{path}' could not be read as a mesh ({words:.80}): export it again.") from error
    if not isinstance(loaded, trimesh.Trimesh):
        raise MeshError(f"'{name}' has no faces: give the file of a surface.")
    if np.isfinite(loaded.vertices).all():  # else checked_mesh says which is not
        loaded.merge_vertices(merge_tex=True, merge_norm=True)
    return checked_mesh(loaded.vertices, loaded.faces, name)[0]
