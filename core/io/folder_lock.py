# SPDX-License-Identifier: GPL-3.0-or-later
"""A file lock on the bake folder: two bakes at once would mix their images in one unfinished folder.

The operating system holds the lock, so a bake that is killed releases it.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import IO

from ..errors import FileError
from .file_lock import try_lock
from .private_folder import LOCK_NAME, make_private_folder
from .regular_file import open_regular


class FolderLock:
    """An exclusive lock on a bake folder or the folder of a study, held until it is released.

    Parameters
    ----------
    folder : Path
    work : str
        What writes to the folder, for the message.

    Raises
    ------
    FileError
        Another bake holds it, or the hidden folder that holds the lock cannot be made.
    """

    def __init__(self, folder: Path, work: str = "bake"):
        self._path = make_private_folder(folder) / LOCK_NAME
        self._file: IO[bytes] | None = None
        while self._file is None:
            if self._path.is_symlink():
                raise FileError(f"'{self._path}' is a link: remove it, or choose another bake folder.")
            try:
                file = open_regular(self._path, "ab")  # noqa: SIM115 - it stays open as long as the lock is held
            except OSError:
                return  # the folder is not writable: writing the bake's own files will say so
            if not try_lock(file.fileno()):
                file.close()
                raise FileError(f"Another {work} is writing to '{folder}': wait for it, or choose another folder.")
            if _is_same_file(self._path, file):
                self._file = file
            else:  # the bake that held the lock has just removed the file: create it again
                file.close()

    def release(self) -> None:
        """Release the lock and remove its file."""
        file, self._file = self._file, None
        if file is None:
            return
        with suppress(OSError):  # removed while the lock is held, so that it cannot be another bake's file
            self._path.unlink()
        file.close()
        if os.name == "nt":  # Windows cannot remove an open file, neither this one nor another bake's
            with suppress(OSError):
                self._path.unlink()


def _is_same_file(path: Path, file: IO[bytes]) -> bool:
    """Return True if the path still leads to this open file."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(file.fileno()))
    except OSError:
        return False
