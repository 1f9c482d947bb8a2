# SPDX-License-Identifier: GPL-3.0-or-later
"""Deterministic .npz files: equal arrays give equal bytes, and numpy reads them without Palpate."""

from __future__ import annotations

import io
import math
import mmap
import os
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from typing import IO, Any

import numpy as np

from ..errors import FileError, os_error_reason
from ..model.recording import row_blocks
from .disk_space import require_space
from .file_writing import write_file

DAMAGED = (
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    EOFError,
    RuntimeError,
    NotImplementedError,  # by zipfile, of a compression that it does not know
    MemoryError,
    OverflowError,
    SyntaxError,
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions that reading a damaged archive may raise."""

MAPPED_BYTES = 1 << 24
"""Size of all arrays from which they are not held in memory but mapped from temporary files."""
SMALL_BYTES = 1 << 16
"""Size up to which an array is held in memory nevertheless."""
_COPIED = 1 << 20
PACKED_BYTES = 1 << 22
"""Size of all arrays up to which an archive is read into memory at once."""
WRITTEN_BYTES = 1 << 25
"""Size of all arrays up to which an archive is made in memory and written at once."""
THREADED_BYTES = 1 << 20
"""Size of all arrays from which two threads compress them; starting the threads takes as long as compressing some 10 kB."""
LEVEL = 3
"""Of the compression."""
_LONG_AGO = (1980, 1, 1, 0, 0, 0)  # the earliest date of a zip archive; the current time would change the bytes
_DOS_TIME = (0, 0x21)  # the same date as an archive holds it
_UNIX, _PERMISSIONS = 3, 0o644 << 16  # the same bytes on every system


def write_arrays(path: str | os.PathLike, arrays: Mapping[str, np.ndarray], atomic: bool = True, compress: bool = True) -> None:
    """Write arrays as .npz, as :func:`.write_file` does; equal arrays give equal bytes.

    Parameters
    ----------
    path : path
    arrays : mapping of str to ndarray
    atomic : bool
    compress : bool
        False is quicker, for files that do not stay.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    if sum(array.nbytes for array in arrays.values()) <= WRITTEN_BYTES:
        content = pack_arrays(arrays, compress)
        with write_file(path, atomic) as temporary:
            temporary.write_bytes(content)
        return
    with write_file(path, atomic) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, array in arrays.items():
            info = zipfile.ZipInfo(f"{name}.npy", _LONG_AGO)
            info.compress_type = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
            info._compresslevel = LEVEL  # type: ignore[attr-defined]
            info.create_system = _UNIX
            info.external_attr = _PERMISSIONS
            with archive.open(info, "w", force_zip64=array.nbytes > 1 << 30) as member:
                _write_member(member, array)


def pack_arrays(arrays: Mapping[str, np.ndarray], compress: bool = True) -> bytes:
    """Return the bytes of the file that :func:`write_arrays` writes, for arrays that fit into memory twice.

    The result is the same as that of `zipfile`, which takes ten times as long for arrays of a few kilobytes: a study writes
    some thirty of them a run.
    """
    parts: list[bytes] = []
    directory: list[bytes] = []
    place = 0
    for name, (packed, checksum, size) in zip(arrays, _packed_members(arrays, compress), strict=True):
        called = f"{name}.npy".encode()
        flags = 0 if called.isascii() else 0x800  # the name is UTF-8
        about = struct.pack(
            "<5H3L2H", 20, flags, zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED, *_DOS_TIME, checksum,
            len(packed), size, len(called), 0,
        )  # fmt: skip
        parts += [b"PK\3\4", about, called, packed]
        directory += [b"PK\1\2", bytes((20, _UNIX)), about, struct.pack("<3H2L", 0, 0, 0, _PERMISSIONS, place), called]
        place += 4 + len(about) + len(called) + len(packed)
    listed = b"".join(directory)
    count = len(arrays)
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, count, count, len(listed), place, 0)
    return b"".join((*parts, listed, end))


def _packed_members(arrays: Mapping[str, np.ndarray], compress: bool) -> Iterator[tuple[bytes, int, int]]:
    """Yield the bytes of each array in the archive, the CRC-32 of what they hold, and its size."""
    if not compress or sum(array.nbytes for array in arrays.values()) < THREADED_BYTES:
        yield from (_packed_member(array, compress) for array in arrays.values())
        return
    with ThreadPoolExecutor(2, "palpate-packer") as pool:
        yield from pool.map(_packed_member, arrays.values())


def _packed_member(array: np.ndarray, compress: bool = True) -> tuple[bytes, int, int]:
    content = _npy_bytes(array)
    if not compress:
        return content, zlib.crc32(content), len(content)
    deflate = zlib.compressobj(LEVEL, zlib.DEFLATED, -15)
    return deflate.compress(content) + deflate.flush(), zlib.crc32(content), len(content)


def _npy_bytes(array: np.ndarray) -> bytes:
    """Return an array in numpy's format, as :func:`_write_member` writes it."""
    with io.BytesIO() as member:
        _write_member(member, array)
        return member.getvalue()


class PackedArchive:
    """A small .npz file in memory: its arrays as `numpy.load` gives them, in a tenth of the time.

    Parameters
    ----------
    content : bytes
        Of the file.

    Raises
    ------
    zipfile.BadZipFile, …
        It is damaged (:data:`DAMAGED`), or no archive.
    """

    def __init__(self, content: bytes):
        self._content = content
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            self._members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        self.size = sum(info.file_size for info in self._members.values())
        """Bytes of all arrays, as the archive says."""

    @property
    def files(self) -> list[str]:
        """Names of the arrays."""
        return list(self._members)

    def __getitem__(self, name: str) -> np.ndarray:
        """Return an array; raises KeyError where there is none, and what :data:`DAMAGED` lists."""
        content = self._unpacked(self._members[name])
        if content[:8] != b"\x93NUMPY\1\0":
            found: np.ndarray = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
            return found
        start = 10 + int.from_bytes(content[8:10], "little")
        shape, is_fortran, kind = _array_header(content[8:start])
        if kind.hasobject:
            raise ValueError(f"'{name}' holds objects")
        if len(content) != start + math.prod(shape) * kind.itemsize:
            raise ValueError(f"'{name}' has not the size that it says")
        array = np.frombuffer(content, kind, offset=start) if kind.itemsize else np.zeros(math.prod(shape), kind)
        return (array.reshape(shape[::-1]).T if is_fortran else array.reshape(shape)).copy()

    def _unpacked(self, info: zipfile.ZipInfo) -> bytes:
        start, local = info.header_offset, self._content[info.header_offset : info.header_offset + 30]
        if len(local) < 30 or local[:4] != b"PK\3\4":
            raise zipfile.BadZipFile(f"'{info.filename}' is not where the archive says")
        if info.flag_bits & 1:
            raise RuntimeError(f"'{info.filename}' is encrypted")
        start += 30 + sum(struct.unpack("<2H", local[26:30]))
        content = self._content[start : start + info.compress_size]
        if info.compress_type == zipfile.ZIP_DEFLATED:
            content = zlib.decompressobj(-15).decompress(content, max(1, info.file_size))
        elif info.compress_type != zipfile.ZIP_STORED:
            raise NotImplementedError(f"'{info.filename}' is compressed in an unknown way")
        if len(content) != info.file_size or zlib.crc32(content) != info.CRC:
            raise zipfile.BadZipFile(f"the checksum of '{info.filename}' is wrong")
        return content


@lru_cache(maxsize=256)
def _array_header(header: bytes) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Return shape, order and type that numpy's header says; those of the runs of a study are alike."""
    shape, is_fortran, kind = np.lib.format.read_array_header_1_0(io.BytesIO(header))
    return shape, is_fortran, kind


@contextmanager
def open_archive(file: IO[bytes]) -> Iterator[Any]:
    """Give the arrays of an .npz file by name: as :class:`PackedArchive` where it is small, else as `numpy.load` does.

    Raises
    ------
    zipfile.BadZipFile, …
        It is damaged (:data:`DAMAGED`), or no archive.
    """
    content = file.read(PACKED_BYTES)
    if len(content) < PACKED_BYTES and content[:4] == b"PK\3\4":
        found = PackedArchive(content)
        if found.size < MAPPED_BYTES:
            yield found
            return
    file.seek(0)
    with np.load(file, allow_pickle=False) as members:
        yield members


def read_array(members: Any, name: str) -> np.ndarray:
    """Return an array of an archive that :func:`open_archive` has opened.

    Those of an archive of :data:`MAPPED_BYTES` or more are mapped from temporary files.

    The file has no name, lies where :func:`tempfile.gettempdir` says, and is gone when the array is. The array is read-only.

    Raises
    ------
    FileError
        The temporary file cannot be written.
    KeyError, ValueError, zipfile.BadZipFile, …
        There is no such array, or it is damaged (:data:`DAMAGED`).
    """
    if isinstance(members, PackedArchive):
        return members[name]
    info = members.zip.getinfo(f"{name}.npy")
    if info.file_size < SMALL_BYTES or sum(one.file_size for one in members.zip.infolist()) < MAPPED_BYTES:
        return members[name]
    with members.zip.open(info) as member:
        version = np.lib.format.read_magic(member)
        if version != (1, 0):
            raise ValueError(f"'{name}' has version {version}")
        shape, is_fortran, kind = np.lib.format.read_array_header_1_0(member)
        if is_fortran or kind.hasobject:
            raise ValueError(f"'{name}' is not laid out as Palpate writes it")
        size = math.prod(shape) * kind.itemsize
        require_space(tempfile.gettempdir(), size, f"'{name}' of a long recording")
        with tempfile.TemporaryFile(prefix="palpate-") as file:
            _unpack(member, file, size, name)
            mapped = mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ)
    return np.frombuffer(mapped, kind).reshape(shape)


def _unpack(member: IO[bytes], file: IO[bytes], size: int, name: str) -> None:
    left = size
    while block := member.read(_COPIED):  # to its end, where the checksum is compared
        left -= len(block)
        if left < 0:
            break
        try:
            file.write(block)
        except OSError as error:
            raise FileError(
                f"'{name}' of a long recording could not be unpacked into '{tempfile.gettempdir()}' "
                f"({os_error_reason(error)}): free some space there, or name another folder in the environment variable TMPDIR."
            ) from error
    if left:
        raise ValueError(f"'{name}' has not the size that it says")
    file.flush()


def _write_member(member: IO[bytes], array: np.ndarray) -> None:
    """Write an array in numpy's format, block by block, so that a mapped file is never in memory as a whole."""
    if array.ndim == 0:
        np.lib.format.write_array(member, array, allow_pickle=False)
        return
    if array.dtype.hasobject:
        raise ValueError("objects are not written: reading them would run code")
    descr = np.lib.format.dtype_to_descr(array.dtype)
    np.lib.format.write_array_header_1_0(member, {"descr": descr, "fortran_order": False, "shape": array.shape})
    for rows in row_blocks(array):
        member.write(array[rows].tobytes())
