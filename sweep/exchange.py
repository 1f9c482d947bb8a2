# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts a finished folder in the place of an earlier one, and removes nothing that Palpate did not write."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

from ..core.errors import FileError
from ..core.io.group_sync import sync_file, sync_folder


def require_own(target: Path, files: re.Pattern[str]) -> None:
    """Check that a folder may be replaced: it is missing, or holds only files of these names, relative to it.

    Raises
    ------
    FileError
        It is no folder, or holds other files.
    """
    if not os.path.lexists(target):
        return
    if target.is_symlink() or not target.is_dir():
        raise FileError(f"'{target}' is not a folder: move it away, `palpate sweep` writes a folder of this name.")
    for root, folders, names in os.walk(target):
        links = [name for name in folders if Path(root, name).is_symlink()]
        for name in sorted([*names, *links]):
            path = Path(root, name)
            if not files.fullmatch(path.relative_to(target).as_posix()):
                raise FileError(
                    f"'{path}' was not written by `palpate sweep`: move it away, the folder '{target}' is replaced."
                )


def exchange_folder(new: Path | None, target: Path, before: Path, files: re.Pattern[str]) -> None:
    """Put a folder in its place, or remove the one there. A kill between the two renames leaves none.

    Parameters
    ----------
    new : Path or None
        Brought onto the disk first. None: there is to be no folder.
    target : Path
    before : Path
        Name in a temporary folder that takes the earlier folder.
    files : compiled regular expression
        Of the names that the earlier folder may hold.

    Raises
    ------
    FileError
        As :func:`require_own`.
    OSError
        It cannot be renamed; the earlier folder is in its place then.
    """
    if new is not None:
        for path in sorted(new.rglob("*")):
            if path.is_dir():
                sync_folder(path)
            else:
                sync_file(path)
        sync_folder(new)
    require_own(target, files)
    had_one = os.path.lexists(target)
    try:
        if had_one:
            os.rename(target, before)
        if new is not None:
            os.rename(new, target)
    except OSError:
        if had_one and not os.path.lexists(target):
            with suppress(OSError):
                os.rename(before, target)
        raise
    sync_folder(target.parent)
