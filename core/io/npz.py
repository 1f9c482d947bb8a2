# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives of arrays by numpy: equal arrays give equal bytes, because numpy gives the members no date."""

from __future__ import annotations

import io
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from typing import IO, Any

import numpy as np

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
    struct.error,
    tokenize.TokenError,  # by numpy, of the header of an array
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions that reading a damaged archive may raise."""


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
    with write_file(path, atomic) as temporary, open(temporary, "wb") as file:
        _save(file, arrays, compress)


def pack_arrays(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Return the bytes of the file that :func:`write_arrays` writes."""
    with io.BytesIO() as file:
        _save(file, arrays, compress=True)
        return file.getvalue()


def _save(file: IO[bytes], arrays: Mapping[str, np.ndarray], compress: bool) -> None:
    if any(array.dtype.hasobject for array in arrays.values()):
        raise ValueError("objects are not written: reading them would run code")
    save = np.savez_compressed if compress else np.savez
    save(file, **{name: array.copy("C") if array.flags.fnc else array for name, array in arrays.items()})


def open_archive(file: IO[bytes]) -> Any:
    """Return a context that gives the arrays of an .npz file by name; each may raise what :data:`DAMAGED` lists."""
    return np.load(file, allow_pickle=False)
