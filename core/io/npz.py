# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives of arrays by numpy: equal arrays give equal bytes, because numpy gives the members no date."""

from __future__ import annotations

import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, os_error_reason
from .file_writing import write_file
from .input_files import open_regular

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


def write_arrays(path: str | os.PathLike, arrays: Mapping[str, np.ndarray], atomic: bool = True) -> None:
    """Write arrays as .npz, as :func:`.write_file` does; equal arrays give equal bytes.

    Parameters
    ----------
    path : path
    arrays : mapping of str to ndarray
    atomic : bool

    Raises
    ------
    FileError
        The file cannot be written.
    """
    if any(array.dtype.hasobject for array in arrays.values()):
        raise ValueError("objects are not written: reading them would run code")
    with write_file(path, atomic) as temporary, open(temporary, "wb") as file:
        np.savez_compressed(file, **{name: array.copy("C") if array.flags.fnc else array for name, array in arrays.items()})


@contextmanager
def open_arrays(path: str | os.PathLike, what: str, advice: str) -> Iterator[Any]:
    """Give the arrays of an .npz file by name, and say in one sentence what is wrong with it.

    Parameters
    ----------
    path : path
    what : str
        What the file should be, as in "recording".
    advice : str
        What to do if it is missing or damaged.

    Raises
    ------
    FileError
        There is no such file, it cannot be read, or the body of the ``with`` statement meets damage (:data:`DAMAGED`).
    """
    if not Path(path).exists():
        raise FileError(f"'{path}' does not exist: {advice}, or choose another file.")
    try:
        with open_regular(path) as file, np.load(file, allow_pickle=False) as members:
            yield members
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): choose another file.") from error
    except DAMAGED as error:
        raise FileError(f"'{path}' is damaged or no {what} ({error}): {advice}.") from error
