# SPDX-License-Identifier: GPL-3.0-or-later
"""Deterministic .npz files: equal arrays give equal bytes, and numpy reads them without Palpate."""

from __future__ import annotations

import math
import mmap
import os
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from typing import IO

import numpy as np

from ..errors import FileError
from ..model.recording import row_blocks
from .disk_space import require_space
from .file_writing import os_error_reason, write_file

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
_LONG_AGO = (1980, 1, 1, 0, 0, 0)  # the earliest date of a zip archive; the current time would change the bytes


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
    with write_file(path, atomic) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, array in arrays.items():
            info = zipfile.ZipInfo(f"{name}.npy", _LONG_AGO)
            info.compress_type = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
            info._compresslevel = 3  # type: ignore[attr-defined]
            info.create_system = 3  # the same bytes on every system
            info.external_attr = 0o644 << 16
            with archive.open(info, "w", force_zip64=array.nbytes > 1 << 30) as member:
                _write_member(member, array)


def read_array(members: np.lib.npyio.NpzFile, name: str) -> np.ndarray:
    """Return an array of an open archive; those of an archive of :data:`MAPPED_BYTES` or more are mapped from temporary files.

    The file has no name, lies where :func:`tempfile.gettempdir` says, and is gone when the array is. The array is read-only.

    Raises
    ------
    FileError
        The temporary file cannot be written.
    KeyError, ValueError, zipfile.BadZipFile, …
        There is no such array, or it is damaged (:data:`DAMAGED`).
    """
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
