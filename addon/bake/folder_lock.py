# SPDX-License-Identifier: GPL-3.0-or-later
"""One bake at a time writes into a folder; two would mix their images in one unfinished sensor.

A lock of the operating system's is held on a file in the folder, so that a killed bake lets go as well.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import IO

from ...core.errors import FileError

LOCK_FILE_NAME = "baking.lock"


class FolderLock:
    """The right to write into a bake folder, until it is given back.

    Raises
    ------
    FileError
        Another bake has it.
    """

    def __init__(self, folder: Path):
        self._path = folder / LOCK_FILE_NAME
        self._file: IO[bytes] | None = None
        while self._file is None:
            try:
                file = open(self._path, "ab")  # noqa: SIM115 - it stays open as long as the folder is claimed
            except OSError:
                return  # a folder that takes no file is told of where the bake's own are written
            if not _lock(file):
                file.close()
                raise FileError(f"Another bake is writing to '{folder}': wait for it, or choose another bake folder.")
            if _is_still(self._path, file):
                self._file = file
            else:  # whoever held it has just removed it
                file.close()

    def release(self) -> None:
        """Let others bake there; nothing is left behind."""
        file, self._file = self._file, None
        if file is None:
            return
        with suppress(OSError):  # while it is held, so that nobody else's is removed
            self._path.unlink()
        file.close()
        if os.name == "nt":  # where open files cannot be removed, another bake's neither
            with suppress(OSError):
                self._path.unlink()


def _lock(file: IO[bytes]) -> bool:
    """Lock an open file unless somebody else has; where locks are not supported nobody has."""
    if os.name == "nt":
        import msvcrt

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # some network folders
        pass
    return True


def _is_still(path: Path, file: IO[bytes]) -> bool:
    """Whether a path leads to an open file."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(file.fileno()))
    except OSError:
        return False
