# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of the OpenEXR file format that tactile images need, in plain Python: scan lines, one part, ZIP compression.

It writes all images, so that a scene gives the same bytes in every Blender. It reads them where the OpenEXR library cannot be
loaded, see :mod:`.exr_backend`. Format:
https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .regular_file import read_bytes

MAGIC = 20000630
VERSION = 2
_LONG_NAMES, _OTHER_FLAGS = 0x400, 0x1A00  # tiles, deep data and several parts: not for us
_TYPES: dict[int, np.dtype] = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
_FLOAT = 2
_LINES = {0: 1, 2: 1, 3: 16}
"""Compression (none, ZIPS, ZIP) → scan lines in a block."""
_ZIP = 3
_LEVEL = 2
"""Of zlib: 4 takes four times as long and makes tactile images 3 % smaller."""


_DAMAGE = (struct.error, IndexError, UnicodeDecodeError, zlib.error, OverflowError, MemoryError)
"""Exceptions that a damaged file may raise."""


class FormatError(ValueError):
    """The file is damaged, or uses a part of the format that is not read here."""


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Return names of channels in the order of the format."""
    return tuple(sorted(names, key=lambda name: name.encode()))


def write_all(
    paths: Sequence[str | os.PathLike],
    names: tuple[str, ...],
    table: np.ndarray,
    attributes: Sequence[Mapping[str, str]],
) -> None:
    """Write images of one size with the same channels; of small ones many at a time take little more than one.

    Parameters
    ----------
    paths : (f,) sequence of path
    names : tuple of str
        Of the channels, :func:`in_order`.
    table : (f, height, channels, width) float32
        The first row is the top of the picture.
    attributes : (f,) sequence of mapping of str to str
        Added to the headers.
    """
    _, height, _, width = table.shape
    step = _LINES[_ZIP]
    blocks = [_pack(table[:, top : top + step]) for top in range(0, height, step)]
    for path, own, packed in zip(paths, attributes, zip(*blocks, strict=True), strict=True):
        header = _header(names, width, height, own)
        sizes = np.array([8 + len(block) for block in packed])
        places = len(header) + 8 * len(packed) + np.cumsum(sizes) - sizes
        parts = [header, places.astype("<u8").tobytes()]
        for i, block in enumerate(packed):
            parts += [struct.pack("<ii", i * step, len(block)), block]
        with open(path, "wb") as file:
            file.write(b"".join(parts))


def _header(names: tuple[str, ...], width: int, height: int, attributes: Mapping[str, str]) -> bytes:
    """Return a header whose attributes are in the order of their names, as the OpenEXR library writes them."""
    longest = max(len(name.encode()) for name in (*names, *attributes, ""))
    flags = _LONG_NAMES if longest > 31 else 0
    entries = [
        *_standard_entries(names, width, height),
        *((name.encode(), _string(name, value)) for name, value in attributes.items()),
    ]
    return b"".join([struct.pack("<ii", MAGIC, VERSION | flags), *(entry for _, entry in sorted(entries)), b"\0"])


@lru_cache(maxsize=64)
def _standard_entries(names: tuple[str, ...], width: int, height: int) -> list[tuple[bytes, bytes]]:
    """Names and bytes of the attributes that every header has."""
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(_text(name) + struct.pack("<iB3xii", _FLOAT, 0, 1, 1) for name in names) + b"\0"
    entries = [
        ("channels", "chlist", channels),
        ("compression", "compression", bytes([_ZIP])),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
    ]
    return [(entry[0].encode(), _entry(*entry)) for entry in entries]


@lru_cache(maxsize=256)
def _string(name: str, value: str) -> bytes:
    return _entry(name, "string", value.encode("utf-8", "surrogatepass"))


def _entry(name: str, kind: str, value: bytes) -> bytes:
    return _text(name) + _text(kind) + struct.pack("<i", len(value)) + value


def _text(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass") + b"\0"


def _pack(lines: np.ndarray) -> list[bytes]:
    """Compress a block of each image: even bytes before odd, differences of neighbours, zlib; as it is when that is longer.

    Parameters
    ----------
    lines : (f, lines, channels, width) float32
    """
    data = lines.reshape(len(lines), -1).view(np.uint8)
    sorted_bytes = np.concatenate([data[:, ::2], data[:, 1::2]], axis=1)
    different = sorted_bytes.copy()
    different[:, 1:] -= sorted_bytes[:, :-1]  # modulo 256
    different[:, 1:] += 128
    found = [zlib.compress(row, _LEVEL) for row in different]
    return [packed if len(packed) < data.shape[1] else raw.tobytes() for packed, raw in zip(found, data, strict=True)]


def _unpack(packed: bytes, size: int) -> bytes:
    if len(packed) == size:
        return packed
    engine = zlib.decompressobj()
    data = np.frombuffer(engine.decompress(packed, size), np.uint8)
    if len(data) != size or not engine.eof:
        raise FormatError("a block has the wrong length")
    summed = np.cumsum(data.astype(np.int64) - 128) + 128 & 0xFF
    result = np.empty(size, np.uint8)
    half = (size + 1) // 2
    result[::2], result[1::2] = summed[:half], summed[half:]
    return result.tobytes()


@dataclass(frozen=True)
class Header:
    """What the header of an image says.

    Attributes
    ----------
    channels : dict of str to dtype
        In the order of the file.
    width, height : int
        Pixels.
    first : int
        Number of the first scan line.
    compression : int
        As in the format.
    texts : dict of str to str
        Attributes of type string.
    end : int
        Bytes that the header takes up.
    """

    channels: dict[str, np.dtype]
    width: int
    height: int
    first: int
    compression: int
    texts: dict[str, str]
    end: int


def read(path: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Read an image.

    Returns
    -------
    channels : dict of str to (height, width) array
        In the order of the file, the first row the top of the picture; float32, float16 or uint32 as in the file.
    attributes : dict of str to str
        Those of type string.

    Raises
    ------
    OSError
        The file cannot be read.
    FormatError
        The file is damaged, or uses a part of the format that is not read here.
    """
    data = read_bytes(path)
    header = read_header(data)
    try:
        return _pixels(data, header), header.texts
    except _DAMAGE as error:
        raise FormatError(str(error)) from error


def read_header(data: bytes) -> Header:
    """Read the header of a file's content; raises FormatError as :func:`read` does."""
    try:
        return _header_of(data)
    except _DAMAGE as error:
        raise FormatError(str(error)) from error


def _header_of(data: bytes) -> Header:
    magic, version = struct.unpack_from("<ii", data)
    if magic != MAGIC or version & 0xFF != VERSION:
        raise FormatError("it does not begin like an OpenEXR file")
    if version & _OTHER_FLAGS:
        raise FormatError("it has tiles or several parts")
    entries, end = _entries(data, 8)
    for name in ("channels", "compression", "dataWindow"):
        if name not in entries:
            raise FormatError(f"its header has no {name}")
    left, bottom, right, top = struct.unpack("<4i", entries["dataWindow"][1])
    width, height = right - left + 1, top - bottom + 1
    if not (0 < width <= 1 << 20 and 0 < height <= 1 << 20):
        raise FormatError("its size makes no sense")
    return Header(
        channels=_channels(entries["channels"][1]),
        width=width,
        height=height,
        first=bottom,
        compression=entries["compression"][1][0],
        texts={name: value.decode("utf-8", "surrogatepass") for name, (kind, value) in entries.items() if kind == "string"},
        end=end,
    )


def _entries(data: bytes, at: int) -> tuple[dict[str, tuple[str, bytes]], int]:
    entries = {}
    while data[at] != 0:
        name, at = _word(data, at)
        kind, at = _word(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        at += 4
        if size < 0 or at + size > len(data):
            raise FormatError("its header is cut off")
        entries[name] = kind, data[at : at + size]
        at += size
    return entries, at + 1


def _word(data: bytes, at: int) -> tuple[str, int]:
    end = data.find(b"\0", at, at + 256)
    if end < 0:
        raise FormatError("a name in its header does not end")
    return data[at:end].decode("utf-8", "surrogatepass"), end + 1


def _channels(data: bytes) -> dict[str, np.dtype]:
    kinds: dict[str, np.dtype] = {}
    at = 0
    while data[at] != 0:
        name, at = _word(data, at)
        kind, _, across, down = struct.unpack_from("<iB3xii", data, at)
        at += 16
        if kind not in _TYPES or (across, down) != (1, 1):
            raise FormatError(f"its channel {name} is stored in an unknown way")
        kinds[name] = _TYPES[kind]
    return kinds


def _pixels(data: bytes, header: Header) -> dict[str, np.ndarray]:
    if header.compression not in _LINES:
        raise FormatError("its compression is not ZIP")
    kinds, width, height = header.channels, header.width, header.height
    channels = {name: np.zeros((height, width), kind) for name, kind in kinds.items()}
    line = sum(kind.itemsize for kind in kinds.values()) * width
    step = _LINES[header.compression]
    count = -(-height // step)
    seen = 0
    for place in struct.unpack_from(f"<{count}Q", data, header.end):
        y, size = struct.unpack_from("<ii", data, place)
        top = y - header.first
        if top % step or not 0 <= top < height or size < 0 or place + 8 + size > len(data):
            raise FormatError("its blocks are not where they should be")
        lines = min(step, height - top)
        block = data[place + 8 : place + 8 + size]
        raw = _unpack(block, lines * line) if header.compression else block
        if len(raw) != lines * line:
            raise FormatError("a block has the wrong length")
        rows = np.frombuffer(raw, np.uint8).reshape(lines, line)
        start = 0
        for name, kind in kinds.items():
            end = start + kind.itemsize * width
            channels[name][top : top + lines] = np.ascontiguousarray(rows[:, start:end]).view(kind)
            start = end
        seen += lines
    if seen != height:
        raise FormatError("some of its lines are missing")
    return channels
