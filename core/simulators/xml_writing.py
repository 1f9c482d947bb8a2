# SPDX-License-Identifier: GPL-3.0-or-later
"""XML files of sensors: numbers, comments and indented text."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..io.file_writing import write_file
from ..io.input_files import require_xml_text

DIGITS = 9
"""Digits of a number: nine make every float32 its own, and simulators store meshes as float32."""


def numbers(values: np.ndarray | list[float] | tuple[float, ...] | float, digits: int = DIGITS) -> str:
    """Return numbers side by side as text; minus zero is written as zero."""
    flat = np.ravel(np.asarray(values))
    if flat.dtype.kind in "iu":
        return " ".join(map(str, flat.tolist()))
    return " ".join(f"{value:.{digits}g}" for value in (flat + 0.0).tolist())


def add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    """Add an element; an attribute `class_` stands for ``class``. Raises FileError for a name that XML cannot hold."""
    for value in attributes.values():
        require_xml_text(value)
    return ElementTree.SubElement(parent, tag, {key.rstrip("_"): value for key, value in attributes.items()})


def comment(parent: ElementTree.Element, text: str) -> None:
    """Add a comment. XML allows no two hyphens side by side in it."""
    require_xml_text(text)
    while "--" in text:
        text = text.replace("--", "- -")
    parent.append(ElementTree.Comment(f" {text} "))


def write_xml(path: Path, root: ElementTree.Element) -> None:
    """Write an element as an indented file."""
    ElementTree.indent(root)
    with write_file(path, atomic=False) as place:
        place.write_bytes(b'<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="utf-8") + b"\n")
