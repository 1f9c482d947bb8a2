# SPDX-License-Identifier: GPL-3.0-or-later
"""A Parquet file made of pages that are encoded already: they are copied, and the footer says where they are.

What a footer says of the columns comes from pyarrow, which writes an empty file of the same schema. Small columns that are made
only now are written by pyarrow into a file in memory, from which their pages are taken.
"""

from __future__ import annotations

import io
import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.io.group_sync import sync_file
from . import thrift_compact as thrift
from .features import Feature
from .parquet_pages import RLE, ZSTD, EncodedColumn, depth_of, encoding_of

if TYPE_CHECKING:
    import pyarrow

MAGIC = b"PAR1"
_KINDS = {"bool": 0, "int64": 2, "float32": 4, "float64": 5, "float16": 7}
"""Numbers of Parquet's physical types."""


@dataclass(frozen=True)
class Chunk:
    """A column of a group of rows.

    Attributes
    ----------
    content : bytes
    about : thrift_compact.Struct
        Parquet's ``ColumnMetaData``, with places counted from the beginning of the content.
    """

    content: bytes
    about: thrift.Struct

    @property
    def size(self) -> int:
        """Bytes before compression."""
        found: int = self.about[6][1]
        return found


def chunk_of(feature: Feature, column: EncodedColumn) -> Chunk:
    """Return the pages of a feature as a column of a group of rows."""
    path = [feature.name.encode(), *(b"list", b"element") * depth_of(feature)]
    about: thrift.Struct = {
        1: (thrift.I32, _KINDS[feature.dtype]),
        2: (thrift.LIST, (thrift.I32, [encoding_of(feature), RLE])),
        3: (thrift.LIST, (thrift.BINARY, path)),
        4: (thrift.I32, ZSTD),
        5: (thrift.I64, column.count),
        6: (thrift.I64, column.size),
        7: (thrift.I64, len(column.content)),
        9: (thrift.I64, 0),
    }
    return Chunk(column.content, about)


def chunks_of(table: pyarrow.Table, **options: Any) -> dict[str, Chunk]:
    """Return the columns of a table as pyarrow writes them, by name; they hold numbers or texts."""
    from pyarrow import parquet

    with io.BytesIO() as file:
        parquet.write_table(table, file, row_group_size=max(1, len(table)), **options)
        content = file.getvalue()
    found = {}
    (group,) = footer_of(content)[4][1][1]
    for name, column in zip(table.column_names, group[1][1][1], strict=True):
        about = dict(column[3][1])
        places = [number for number in (9, 11) if number in about]  # of data, and of a dictionary
        start = min(about[number][1] for number in places)
        about |= {number: (thrift.I64, about[number][1] - start) for number in places}
        found[name] = Chunk(content[start : start + about[7][1]], about)
    return found


def footer_of(content: bytes) -> thrift.Struct:
    """Return Parquet's ``FileMetaData`` of a file.

    Raises
    ------
    ValueError
        It is none.
    """
    if len(content) < 12 or content[-4:] != MAGIC:
        raise ValueError("this is no file of Parquet")
    size = struct.unpack("<I", content[-8:-4])[0]
    return thrift.read_struct(content[-8 - size : -8])[0]


class ParquetFile:
    """A file to which groups of rows are added.

    Parameters
    ----------
    path : Path
    schema : pyarrow.Schema
        Columns in their order.
    """

    def __init__(self, path: Path, schema: pyarrow.Schema):
        from pyarrow import parquet

        with io.BytesIO() as empty:
            parquet.ParquetWriter(empty, schema).close()
            self._footer = footer_of(empty.getvalue())
        self._path, self._names = path, schema.names
        self._groups: list[bytes] = []  # what the footer says of them, a tenth of what it takes as dictionaries
        self._rows = 0
        self._file = open(path, "wb")  # noqa: SIM115 -- it stays open until the file is full
        self._file.write(MAGIC)
        self.size = len(MAGIC)
        """Bytes up to now."""

    def write(self, columns: dict[str, Chunk], rows: int) -> None:
        """Write a group of rows."""
        entries, start, sizes = [], self.size, 0
        for chunk in (columns[name] for name in self._names):
            places = {number: (thrift.I64, chunk.about[number][1] + self.size) for number in (9, 11) if number in chunk.about}
            entries.append({2: (thrift.I64, 0), 3: (thrift.STRUCT, chunk.about | places)})
            self._file.write(chunk.content)
            self.size += len(chunk.content)
            sizes += chunk.size
        group = {
            1: (thrift.LIST, (thrift.STRUCT, entries)),
            2: (thrift.I64, sizes),
            3: (thrift.I64, rows),
            5: (thrift.I64, start),
            6: (thrift.I64, self.size - start),
            7: (thrift.I16, len(self._groups)),
        }
        self._groups.append(thrift.write_struct(group))
        self._rows += rows

    def close(self) -> None:
        """Finish the file, and bring it onto the disk."""
        whole = {3: (thrift.I64, self._rows), 4: (thrift.LIST, (thrift.STRUCT, self._groups))}
        footer = thrift.write_struct(self._footer | whole)
        self._file.write(footer + struct.pack("<I", len(footer)) + MAGIC)
        self._file.close()
        sync_file(self._path)

    def abandon(self) -> None:
        """Let go of the file after an error."""
        with suppress(OSError):  # what could not be written is still in its buffer
            self._file.close()
