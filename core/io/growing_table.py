# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays that grow row by row and leave the memory for a temporary file when they become long."""

from __future__ import annotations

import mmap
import tempfile
from typing import IO

import numpy as np

from ..errors import FileError, os_error_reason

IN_MEMORY_BYTES = 1 << 22
"""Bytes of a table that stay in memory: hours of animation of a rigid body."""


class GrowingTable:
    """Rows of one shape, of float64.

    The temporary file has no name, lies where :func:`tempfile.gettempdir` says, and is gone when the table and its arrays are.

    Parameters
    ----------
    first : array
        The first row.
    """

    def __init__(self, first: np.ndarray | float):
        row = np.asarray(first, float)
        self._shape = row.shape
        self._count = 0
        self._rows = bytearray()
        self._file: IO[bytes] | None = None
        self.append(row)

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    def append(self, row: np.ndarray | float) -> None:
        """Add one row.

        Raises
        ------
        FileError
            The temporary file cannot be written.
        """
        self._rows += np.asarray(row, float).reshape(self._shape).tobytes()
        self._count += 1
        if len(self._rows) > IN_MEMORY_BYTES:
            self._move_to_file()

    def array(self) -> np.ndarray:
        """Return all rows, (rows, ...) float; a view of the temporary file, which cannot be changed, if there is one.

        Raises
        ------
        FileError
            As :meth:`append`.
        """
        shape = (self._count, *self._shape)
        if self._file is None:
            return np.frombuffer(bytes(self._rows)).reshape(shape).copy()
        self._move_to_file()
        try:
            self._file.flush()
            mapped = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        except OSError as error:
            raise _error(error) from error
        return np.frombuffer(mapped).reshape(shape)

    def _move_to_file(self) -> None:
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="palpate-")  # noqa: SIM115 - it lives as long as the table
            self._file.write(self._rows)
        except OSError as error:
            raise _error(error) from error
        self._rows = bytearray()


def _error(error: OSError) -> FileError:
    return FileError(
        f"The motion of a long scene could not be kept in the temporary folder '{tempfile.gettempdir()}' "
        f"({os_error_reason(error)}): free some space there, or name another folder in the environment variable TMPDIR."
    )
