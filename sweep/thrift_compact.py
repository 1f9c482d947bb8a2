# SPDX-License-Identifier: GPL-3.0-or-later
"""The compact protocol of Apache Thrift, in which Parquet writes the headers of its pages and the footer of its files.

A structure is a dictionary from the number of a field to its type and value. A list is the type of its elements and a Python
list. What is read and written again gives the same bytes. A structure that is written may also be given as its bytes.

Source: ``doc/specs/thrift-compact-protocol.md`` of Apache Thrift.
"""

from __future__ import annotations

import struct
from typing import Any

TRUE, FALSE, BYTE, I16, I32, I64, DOUBLE, BINARY, LIST, SET, MAP, STRUCT = range(1, 13)

Value = tuple[int, Any]
Struct = dict[int, Value]


def read_struct(content: bytes, at: int = 0) -> tuple[Struct, int]:
    """Return the structure that begins at a place, and the place after it.

    Raises
    ------
    ValueError, IndexError
        It is cut or no such structure.
    """
    found: Struct = {}
    number = 0
    while content[at]:
        step, kind = divmod(content[at], 16)
        at += 1
        if step:
            number += step
        else:
            number, at = read_whole(content, at)
        value, at = (None, at) if kind in (TRUE, FALSE) else _read_value(content, at, kind)
        found[number] = kind, value
    return found, at + 1


def write_struct(fields: Struct) -> bytes:
    """Return the bytes of a structure; its fields are written in the order of their numbers."""
    parts = []
    before = 0
    for number, (kind, value) in sorted(fields.items()):
        step = number - before
        parts.append(bytes((step << 4 | kind,)) if 0 < step < 16 else bytes((kind,)) + whole_bytes(number))
        if kind not in (TRUE, FALSE):
            parts.append(_value(kind, value))
        before = number
    return b"".join((*parts, b"\0"))


def _read_value(content: bytes, at: int, kind: int) -> tuple[Any, int]:
    if kind in (TRUE, FALSE, BYTE):  # in lists, where each has a byte
        return content[at], at + 1
    if kind in (I16, I32, I64):
        return read_whole(content, at)
    if kind == DOUBLE:
        return struct.unpack_from("<d", content, at)[0], at + 8
    if kind == BINARY:
        size, at = _read_size(content, at)
        if at + size > len(content):
            raise ValueError("a text is cut")
        return bytes(content[at : at + size]), at + size
    if kind in (LIST, SET):
        count, inner = divmod(content[at], 16)
        at += 1
        if count == 15:
            count, at = _read_size(content, at)
        elements = []
        for _ in range(count):
            element, at = _read_value(content, at, inner)
            elements.append(element)
        return (inner, elements), at
    if kind == STRUCT:
        return read_struct(content, at)
    raise ValueError(f"the type {kind} is not used by Parquet")


def _value(kind: int, value: Any) -> bytes:
    if kind in (TRUE, FALSE, BYTE):
        return bytes((value,))
    if kind in (I16, I32, I64):
        return whole_bytes(value)
    if kind == DOUBLE:
        return struct.pack("<d", value)
    if kind == BINARY:
        return size_bytes(len(value)) + value
    if kind in (LIST, SET):
        inner, elements = value
        count = len(elements)
        start = bytes((count << 4 | inner,)) if count < 15 else bytes((0xF0 | inner,)) + size_bytes(count)
        return start + b"".join(_value(inner, element) for element in elements)
    if kind == STRUCT:
        return value if isinstance(value, bytes) else write_struct(value)
    raise ValueError(f"the type {kind} is not used by Parquet")


def _read_size(content: bytes | memoryview, at: int) -> tuple[int, int]:
    """Return a number of seven bits a byte, the lowest first."""
    number = shift = 0
    while True:
        byte = content[at]
        at += 1
        number |= (byte & 127) << shift
        if byte < 128:
            return number, at
        shift += 7
        if shift > 63:
            raise ValueError("a number is too long")


def size_bytes(number: int) -> bytes:
    """Return a whole number above zero, seven bits a byte, the lowest first."""
    if number < 128:
        return bytes((number,))
    found = bytearray()
    while number >= 128:
        found.append(number & 127 | 128)
        number >>= 7
    found.append(number)
    return bytes(found)


def read_whole(content: bytes | memoryview, at: int) -> tuple[int, int]:
    """Return a number with a sign, which stands in its lowest bit."""
    number, at = _read_size(content, at)
    return number >> 1 ^ -(number & 1), at


def whole_bytes(number: int) -> bytes:
    """Return a number with its sign in the lowest bit."""
    return size_bytes(number << 1 ^ number >> 63)
