# SPDX-License-Identifier: GPL-3.0-or-later
"""A file that only grows at its end. Its SHA-256 is at hand while it grows, so a checkpoint costs the same at any length."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import BinaryIO

from .file_writing import sync_file
from .regular_file import open_regular

_READ = 1 << 20


class GrowingFile:
    """A file that is written from its beginning to its end. Every method raises OSError where the system refuses.

    Parameters
    ----------
    path : Path
        The file. It is made by :meth:`begin` or taken over by :meth:`restore`.
    """

    def __init__(self, path: Path):
        self.path = path
        self.length = 0
        """Bytes so far."""
        self._digest = hashlib.sha256()
        self._file: BinaryIO | None = None

    @property
    def sha256(self) -> str:
        """SHA-256 of all bytes so far, 64 hexadecimal digits."""
        return self._digest.hexdigest()

    def begin(self) -> None:
        """Make the file, without content."""
        self._take_over(open(self.path, "wb"), 0, hashlib.sha256())  # noqa: SIM115 - close() does

    def restore(self, length: int, sha256: str) -> bool:
        """Take over the beginning of a file; what comes after it is cut off.

        Returns
        -------
        bool
            False if the file is missing, too short, or does not have this SHA-256. It is unchanged then.
        """
        digest, left = hashlib.sha256(), length
        try:
            with open_regular(self.path) as file:
                while left and (block := file.read(min(left, _READ))):
                    digest.update(block)
                    left -= len(block)
        except FileNotFoundError:
            return False
        if left or digest.hexdigest() != sha256:
            return False
        self._take_over(open(self.path, "r+b"), length, digest)  # noqa: SIM115 - close() does
        return True

    def append(self, content: bytes | memoryview) -> None:
        """Write at the end."""
        assert self._file is not None, "begin or restore comes first"
        self._file.write(content)
        self._digest.update(content)
        self.length += len(content)

    def flush(self) -> None:
        """Hand what was written to the operating system, so that others read it."""
        if self._file is not None:
            self._file.flush()

    def sync(self) -> None:
        """Bring what was written onto the disk."""
        self.flush()
        sync_file(self.path)

    def close(self) -> None:
        """Close the file, if it is open."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _take_over(self, file: BinaryIO, length: int, digest: hashlib._Hash) -> None:
        self.close()
        file.truncate(length)
        file.seek(length)
        self._file, self.length, self._digest = file, length, digest
