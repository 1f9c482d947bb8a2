# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of a run as pages of Parquet, which a dataset takes over as they are.

A page begins at a row and says nothing of its place in a file. So the pages of many runs, one behind the other, are a column
of a group of rows, whichever process has encoded them, and equal columns are equal bytes whatever they are written with.

Source: ``README.md``, ``Encodings.md`` and ``parquet.thrift`` of Apache Parquet (data pages of version 1).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from . import thrift_compact as thrift
from .features import Feature

PAGE_BYTES = 1 << 20
"""Numbers of a page, as far as a frame of them is smaller: what readers unpack at once."""
LEVEL = 3
"""Of the compression with Zstandard."""
PLAIN, RLE, BYTE_STREAM_SPLIT = 0, 3, 9
ZSTD = 6
_TO_SIZES, _NEXT, _TO_COUNT = b"\x15\0\x15", b"\x15", b"\x2c\x15"
"""Of the header of a data page: a whole number that is 0, and sizes before and after compression; the count in a structure."""


@dataclass(frozen=True)
class EncodedColumn:
    """The pages of a column in one run.

    Attributes
    ----------
    content : bytes-like
        Headers and compressed pages.
    size : int
        Bytes of headers and pages before compression.
    count : int
        Numbers, of all rows.
    """

    content: Any
    size: int
    count: int


def encoding_of(feature: Feature) -> int:
    """Return how numbers of a feature are encoded: bytes of floats by their place in the number, as they compress better."""
    return BYTE_STREAM_SPLIT if feature.dtype == "float32" else PLAIN


def encode_column(feature: Feature, values: np.ndarray) -> EncodedColumn:
    """Return the pages of (F, …) values of a feature, in the type that it has in the dataset."""
    width = max(1, values[:1].nbytes)  # of a frame
    rows = max(1, PAGE_BYTES // width)
    pages = [_page(feature, values[at : at + rows]) for at in range(0, len(values), rows)]
    return EncodedColumn(b"".join(page for page, _ in pages), sum(size for _, size in pages), values.size)


def decode_column(feature: Feature, column: EncodedColumn) -> np.ndarray:
    """Return the (F, …) values of a column.

    Raises
    ------
    ValueError
        The pages are damaged, or not such as :func:`encode_column` makes.
    """
    try:
        parts = [_unpacked(feature, *page) for page in _pages(feature, column.content)]
    except (LookupError, TypeError, OSError) as error:
        raise ValueError(f"the column '{feature.name}' is damaged ({type(error).__name__}: {error})") from error
    found = np.concatenate(parts) if len(parts) != 1 else parts[0]
    if found.size != column.count:
        raise ValueError(f"the column '{feature.name}' has {found.size} numbers instead of {column.count}")
    return found.reshape(-1, *_shape(feature))


def _shape(feature: Feature) -> tuple[int, ...]:
    return () if feature.shape == (1,) else feature.shape


def depth_of(feature: Feature) -> int:
    """Return how many lists stand around a number of a feature."""
    return len(_shape(feature))


def _page(feature: Feature, values: np.ndarray) -> tuple[bytes, int]:
    """Return a page with its header, and its size before compression."""
    body = _levels(len(values), _shape(feature)) + _numbers(feature, values)
    packed = _codec().compress(body, asbytes=True)
    header = b"".join(
        (
            _TO_SIZES,
            thrift.whole_bytes(len(body)),
            _NEXT,
            thrift.whole_bytes(len(packed)),
            _TO_COUNT,
            thrift.whole_bytes(values.size),
            _end_of_header(feature),
        )
    )
    return header + packed, len(header) + len(body)


@lru_cache(maxsize=64)
def _end_of_header(feature: Feature) -> bytes:
    """Return the last fields of a header: how numbers and levels are encoded."""
    return b"".join(_NEXT + thrift.whole_bytes(encoding) for encoding in (encoding_of(feature), RLE, RLE)) + b"\0\0"


def _numbers(feature: Feature, values: np.ndarray) -> bytes:
    if feature.dtype == "bool":
        return np.packbits(values.reshape(-1), bitorder="little").tobytes()
    own = np.ascontiguousarray(values, np.dtype(feature.dtype).newbyteorder("<"))
    if encoding_of(feature) == BYTE_STREAM_SPLIT:
        words = own.reshape(-1).view("<u4")
        streams = np.empty((own.itemsize, len(words)), np.uint8)
        for place in range(own.itemsize):  # in vector registers, unlike the transposition of bytes
            streams[place] = words >> np.uint32(8 * place)
        return streams.tobytes()
    return own.tobytes()


def _unpacked(feature: Feature, size: int, count: int, body: memoryview) -> np.ndarray:
    """Return the numbers of a page."""
    content = _codec().decompress(body, size, asbytes=True)
    width = math.prod(_shape(feature))
    if count % width:
        raise ValueError(f"the column '{feature.name}' is cut")
    start = len(_levels(count // width, _shape(feature)))
    if feature.dtype == "bool":
        bits = np.frombuffer(content, np.uint8, offset=start)
        return np.unpackbits(bits, count=count, bitorder="little").view(bool)
    kind = np.dtype(feature.dtype).newbyteorder("<")
    if encoding_of(feature) == BYTE_STREAM_SPLIT:
        streams = np.frombuffer(content, np.uint8, offset=start).reshape(kind.itemsize, count)
        words = np.zeros(count, "<u4")
        for place in range(kind.itemsize):  # as in :func:`_numbers`
            words |= streams[place].astype("<u4") << np.uint32(8 * place)
        return words.view(kind)
    return np.frombuffer(content, kind, offset=start)


def _pages(feature: Feature, content: Any) -> Iterator[tuple[int, int, memoryview]]:
    """Yield size before compression, count of numbers and body of each page; its header is one of :func:`_page`."""
    whole, at, end = memoryview(content), 0, _end_of_header(feature)
    while at < len(whole):
        numbers = []
        for words in (_TO_SIZES, _NEXT, _TO_COUNT):
            if whole[at : at + len(words)] != words:
                raise ValueError("the header of a page is damaged")
            number, at = thrift.read_whole(whole, at + len(words))
            numbers.append(number)
        start = at + len(end)
        at = start + numbers[1]
        if whole[start - len(end) : start] != end or at > len(whole) or min(numbers) < 0:
            raise ValueError("a page is cut")
        yield numbers[0], numbers[2], whole[start:at]


@lru_cache(maxsize=64)
def _levels(rows: int, shape: tuple[int, ...]) -> bytes:
    """Return the levels of a page: where lists of each depth begin, and that no number is missing.

    Every list and every number counts as optional, as Arrow has them.
    """
    parts = []
    if shape:
        whole = _repetition_bits(8, shape) * (rows // 8) + _repetition_bits(rows % 8, shape)  # eight rows end with a byte
        groups = -(-rows * math.prod(shape) // 8)
        parts.append(_sized(thrift.size_bytes(groups << 1 | 1) + whole.ljust(groups * len(shape).bit_length(), b"\0")))
    parts.append(_sized(_run_length(2 * len(shape) + 1, rows * math.prod(shape))))
    return b"".join(parts)


@lru_cache(maxsize=64)
def _repetition_bits(rows: int, shape: tuple[int, ...]) -> bytes:
    """Return how deep the list is that goes on at each number, bit by bit, the lowest first."""
    places = np.arange(rows * math.prod(shape))
    repetition = np.full(len(places), len(shape), np.uint8)
    inner = 1
    for depth in range(len(shape) - 1, -1, -1):
        inner *= shape[depth]
        repetition[places % inner == 0] = depth
    bits = np.unpackbits(repetition[:, None], axis=1, count=len(shape).bit_length(), bitorder="little")
    return np.packbits(bits.reshape(-1), bitorder="little").tobytes()


def _sized(content: bytes) -> bytes:
    return struct.pack("<I", len(content)) + content


def _run_length(value: int, count: int) -> bytes:
    """Return a number that repeats; levels have less than eight bits."""
    return thrift.size_bytes(count << 1) + bytes((value,))


@lru_cache(maxsize=1)
def _codec() -> Any:
    import pyarrow

    return pyarrow.Codec("zstd", compression_level=LEVEL)


def joined(columns: Sequence[EncodedColumn]) -> EncodedColumn:
    """Return the pages of several runs as one column."""
    content = b"".join(column.content for column in columns)
    return EncodedColumn(content, sum(column.size for column in columns), sum(column.count for column in columns))
