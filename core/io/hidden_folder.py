# SPDX-License-Identifier: GPL-3.0-or-later
"""Hidden folders: for files that get their place when they are complete, and for the lock of a bake folder or a study.

A locked file in such a folder shows that a process is using it. The operating system releases the lock when the process ends,
however it ends, so the next process finds what a killed one has left, and removes it.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import FileError, os_error_reason
from . import file_writing

if TYPE_CHECKING:
    from filelock import BaseFileLock

PRIVATE_FOLDER = ".palpate"
"""In a bake folder and in the folder of a study: all that is Palpate's own and no part of the result."""
LOCK_NAME = "palpate.lock"
"""The locked file. It also tells Palpate's folders from those of the user's."""
_EARLIER_MARKER = "palpate-folder.json"
"""Until version 0.2.0."""
_FILES = "files"
"""Folder in a temporary folder, beside the lock."""
_in_use: set[Path] = set()
"""Temporary folders of this process."""


def is_private_folder(folder: Path) -> bool:
    """Return True for a hidden folder that Palpate has made."""
    marks = [folder / name for name in (LOCK_NAME, _EARLIER_MARKER)]
    return not folder.is_symlink() and any(mark.is_file() and not mark.is_symlink() for mark in marks)


class FolderLock:
    """An exclusive lock on a bake folder or the folder of a study, held until it is released.

    Parameters
    ----------
    folder : Path
    work : str
        What writes to the folder, for the message.

    Attributes
    ----------
    private : Path
        The hidden folder in it, which is made if it is missing.

    Raises
    ------
    FileError
        Another process holds the lock, the hidden folder cannot be made, or something that Palpate did not make has its name.
    """

    def __init__(self, folder: Path, work: str = "bake"):
        self.private = folder / PRIVATE_FOLDER
        try:
            self.private.mkdir(exist_ok=True)
            if not is_private_folder(self.private) and (self.private.is_symlink() or any(self.private.iterdir())):
                raise FileError(f"'{self.private}' was not made by Palpate: rename it, or choose another {work} folder.")
            lock = _lock(self.private)
        except OSError as error:
            raise FileError(
                f"The folder '{self.private}' could not be made ({os_error_reason(error)}): rename what has its name, "
                f"check the permissions, or choose another {work} folder."
            ) from error
        if lock is None:
            raise FileError(f"Another {work} is writing to '{folder}': wait for it, or choose another folder.")
        self._lock = lock

    def release(self) -> None:
        """Release the lock. Its file stays: another process may be about to lock it."""
        self._lock.release()


@contextmanager
def temporary_folder(parent: Path, purpose: str) -> Iterator[Path]:
    """Make a hidden folder in `parent`, and remove it with all that it holds when the body ends.

    Those that killed processes have left there are removed first.

    Parameters
    ----------
    parent : Path
    purpose : str
        Part of its name.

    Raises
    ------
    FileError
        It cannot be made.
    """
    remove_abandoned(parent)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".palpate-{purpose}-", dir=parent))
        lock = _lock(folder)
        (folder / _FILES).mkdir()
    except OSError as error:
        raise FileError(
            f"No folder can be made in '{parent}' ({os_error_reason(error)}): check its permissions and the space left."
        ) from error
    _in_use.add(folder)
    try:
        yield folder / _FILES
    finally:
        if lock is not None:
            lock.release()
        _remove(folder)
        _in_use.discard(folder)


def remove_abandoned(parent: Path) -> None:
    """Remove the temporary folders that killed processes have left in a folder."""
    for folder in sorted(parent.glob(".palpate-*-????????")):
        with suppress(OSError):
            if is_private_folder(folder):
                lock = _lock(folder)
                if lock is not None:
                    lock.release()
                    _remove(folder)
            else:
                folder.rmdir()  # of a kill before the lock; raises if it holds anything


def remove_unfinished() -> None:
    """Remove the temporary files and folders of this process, because it is about to end."""
    file_writing.remove_unfinished_files()
    for folder in list(_in_use):
        _remove(folder)


def _remove(folder: Path) -> None:
    """Remove a temporary folder, and its lock last, so that whoever finds the rest knows whose it is."""
    shutil.rmtree(folder / _FILES, ignore_errors=True)
    shutil.rmtree(folder, ignore_errors=True)


def _lock(folder: Path) -> BaseFileLock | None:
    """Lock a folder and return the lock; None if another process has locked it. Raises OSError where that is impossible."""
    from filelock import FileLock, Timeout  # enabling the extension imports no dependencies

    lock = FileLock(folder / LOCK_NAME)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        return None
    return lock
