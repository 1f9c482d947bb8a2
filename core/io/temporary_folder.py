# SPDX-License-Identifier: GPL-3.0-or-later
"""A hidden folder for files that are put in their place later, or are needed only while a command runs.

It is made beside the results, so that files can be renamed into their place. A marker file in it tells it from a folder of the
user's. The marker is locked while the folder is in use: what a killed process has left is found by the next one and removed.
"""

from __future__ import annotations

import json
import os
import re
import secrets
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import FileError, os_error_reason
from .file_lock import try_lock
from .file_writing import remove_leftovers
from .private_folder import MARKER_FORMAT, MARKER_NAME, remove_tree

NAME = r"\.palpate-[a-z]+\.[0-9a-f]{8}\.partial"
"""Regular expression of the names of these folders."""


@contextmanager
def temporary_folder(parent: Path, purpose: str, is_kept: Callable[[Path], bool] | None = None) -> Iterator[Path]:
    """Make a hidden folder in `parent`, and remove it with all that it holds when the body ends.

    Parameters
    ----------
    parent : Path
    purpose : str
        Part of its name.
    is_kept : callable, optional
        Called with the folder when the body ends; True if it is not to be removed, because a later run needs it.

    Raises
    ------
    FileError
        It cannot be made.
    """
    folder = parent / f".palpate-{purpose}.{secrets.token_hex(4)}.partial"
    marker = None
    try:
        try:
            marker = _made(folder)
        except OSError as error:
            raise FileError(
                f"No folder can be made in '{parent}' ({os_error_reason(error)}): check its permissions and the space left."
            ) from error
        yield folder
    finally:
        if marker is not None:
            os.close(marker)
        if is_kept is None or not is_kept(folder):
            _remove(folder)


def _made(folder: Path) -> int:
    """Make a folder with a marker and return the descriptor that holds the marker's lock."""
    folder.mkdir()
    handle = os.open(folder / MARKER_NAME, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666)
    try:
        try_lock(handle)
        os.write(handle, json.dumps({"format": MARKER_FORMAT, "id": secrets.token_hex(16)}).encode())
    except BaseException:
        os.close(handle)
        raise
    return handle


def remove_unfinished(parent: Path, kept: Container[str] = (), is_ending: bool = False) -> None:
    """Remove what killed processes have left in a folder: files of :func:`.atomic_write` and temporary folders.

    Parameters
    ----------
    parent : Path
    kept : container of str
        Names of temporary folders that are not removed.
    is_ending : bool
        True if this process is about to end, and what it has begun itself is removed as well.
    """
    remove_leftovers(parent, is_ending)
    for folder in sorted(parent.glob(".palpate-*.partial")):
        if re.fullmatch(NAME, folder.name) and folder.name not in kept:
            with suppress(OSError):
                if not folder.is_symlink() and (is_ending or _is_abandoned(folder)):
                    _remove(folder)


def _remove(folder: Path) -> None:
    """Remove a folder as far as possible, its marker last, so that whoever finds the rest knows whose it is."""
    with suppress(OSError):
        for path in folder.iterdir():
            if path.is_dir() and not path.is_symlink():
                remove_tree(path)
            elif path.name != MARKER_NAME:
                path.unlink(missing_ok=True)
    remove_tree(folder)


def _is_abandoned(folder: Path) -> bool:
    """Return True if a folder has the marker and nobody locks it; one without a marker is removed if it is empty."""
    try:
        handle = os.open(folder / MARKER_NAME, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except FileNotFoundError:
        folder.rmdir()  # fails if it holds anything
        return False
    try:
        content = os.read(handle, 1000)
        is_lost = not content.strip(b"\0")  # a kill or a power cut came before it was written
        return (is_lost or MARKER_FORMAT.encode() in content) and try_lock(handle)
    finally:
        os.close(handle)
