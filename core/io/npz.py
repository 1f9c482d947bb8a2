# SPDX-License-Identifier: GPL-3.0-or-later
"""Deterministic .npz files: equal arrays give equal bytes, and numpy reads them without Palpate."""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Mapping
from typing import IO

import numpy as np

from ..model.recording import row_blocks
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
