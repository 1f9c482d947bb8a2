# SPDX-License-Identifier: GPL-3.0-or-later
"""Brings many files onto the disk at once: with one request to the file system where it is known to keep that promise.

A request for each of the four files and two folders of a run waits for the disk six times; one for all of them waits once.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

_WHOLE = frozenset({0xEF53, 0x58465342, 0x9123683E, 0xF2F52010, 0x01021994})
"""Numbers by which Linux tells ext4, XFS, Btrfs, F2FS and tmpfs, whose ``syncfs`` ends when everything is on the disk. A file
system over a network or in a program of its own may answer earlier."""
_FIRST = (5, 8)
"""Version of Linux since which ``syncfs`` reports data that could not be written."""


class GroupSync:
    """Brings folders onto the disk with all that they hold.

    It is made before their files are written, because a file system reports what it could not write since then.

    Parameters
    ----------
    place : Path
        A folder of their file system.
    """

    def __init__(self, place: Path):
        self._handle: int | None = None
        if _syncs_as_a_whole(place):
            with suppress(OSError):  # each file is brought onto the disk by itself then
                self._handle = os.open(place, os.O_RDONLY)

    def close(self) -> None:
        """Let go of the file system."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def sync(self, folders: Sequence[Path]) -> None:
        """Bring folders onto the disk; raise OSError where that is not possible."""
        if self._handle is not None:
            sync_file_system(self._handle)
            return
        for folder in folders:
            for parent, _, names in os.walk(folder, topdown=False):
                for name in names:
                    sync_file(Path(parent) / name)
                sync_folder(Path(parent))


def sync_file_system(handle: int) -> None:
    """Bring everything onto the disk that was written to the file system of an open folder; raise OSError otherwise."""
    library = ctypes.CDLL(None, use_errno=True)
    if library.syncfs(handle):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _syncs_as_a_whole(place: Path) -> bool:
    """Return whether one request brings all files of the file system at a folder onto the disk, and reports what fails."""
    if not sys.platform.startswith("linux") or _kernel() < _FIRST:
        return False
    with suppress(OSError, AttributeError):  # the library of C may lack them
        library = ctypes.CDLL(None, use_errno=True)
        found = (ctypes.c_long * 64)()  # struct statfs begins with the kind of file system and is shorter than this
        if hasattr(library, "syncfs") and library.statfs(os.fsencode(place), ctypes.byref(found)) == 0:
            return (found[0] & 0xFFFFFFFF) in _WHOLE
    return False


def _kernel() -> tuple[int, ...]:
    """Return the version of Linux as two numbers; zeros where it has another form."""
    with suppress(ValueError):
        return tuple(int(part) for part in os.uname().release.split("-")[0].split(".")[:2])
    return (0, 0)


def sync_folder(folder: Path) -> None:
    """Flush a folder's list of names to the disk, on systems that allow it, so that a rename survives a power cut."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def sync_file(path: Path) -> None:
    """Bring the content of a file onto the disk."""
    with open(path, "rb+") as file:
        os.fsync(file.fileno())


def write_hashed(path: Path, content: bytes) -> str:
    """Write a new file in a folder that nobody reads yet and return the SHA-256 of its content; it is not yet on the disk.

    Raises
    ------
    OSError
        It cannot be written.
    """
    with open(path, "wb") as file:
        file.write(content)
    return hashlib.sha256(content).hexdigest()
