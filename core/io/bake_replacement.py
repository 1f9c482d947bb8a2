# SPDX-License-Identifier: GPL-3.0-or-later
"""A complete bake takes the place of the earlier one, folder by folder.

A bake is written into the folder ``new`` of the hidden folder. When it is complete, each sensor's folder is moved into the
folder ``old``, and the new one into its place. An error takes all of this back. A kill may leave folders of both bakes, whose
manifests have different ids, so that every reader says so, and the next bake replaces them.

Files in a replaced folder that no bake has written belong to the user and move into the new folder. Nothing else than the files
of a bake is removed.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from .bake_folder import BAKE_FILE_NAMES
from .hidden_folder import PRIVATE_FOLDER

NEW, OLD = "new", "old"


def is_interrupted(bake_folder: Path) -> bool:
    """Return True if a bake was killed while it took the place of the earlier one."""
    old = bake_folder / PRIVATE_FOLDER / OLD
    return old.is_dir() and any(old.iterdir())


def begin(bake_folder: Path) -> Path:
    """Remove what a killed bake has left, and return the empty folder for the sensors' folders of a new one.

    The caller holds the lock of the bake folder. Raises OSError.
    """
    discard(bake_folder)
    new = bake_folder / PRIVATE_FOLDER / NEW
    new.mkdir()
    return new


def replace(bake_folder: Path, names: Sequence[str], last: Callable[[], None] = lambda: None) -> None:
    """Move the new folders of these names to their places, and do one more step; if anything fails, nothing has changed.

    Raises
    ------
    OSError
        A folder cannot be moved.
    """
    new, old = (bake_folder / PRIVATE_FOLDER / name for name in (NEW, OLD))
    old.mkdir(exist_ok=True)
    try:
        for name in names:
            if os.path.lexists(bake_folder / name):
                os.replace(bake_folder / name, old / name)
            os.replace(new / name, bake_folder / name)
        last()
    except BaseException:
        with suppress(OSError):  # what cannot be taken back now, the next bake tries again
            for name in names:
                if not os.path.lexists(new / name) and not os.path.lexists(old / name):
                    os.replace(bake_folder / name, new / name)  # it had no predecessor
            _take_back(bake_folder, new, old)
        raise
    with suppress(OSError):
        discard(bake_folder)


def discard(bake_folder: Path) -> None:
    """Remove a bake that is not complete, or one that was replaced; if a kill came between, the earlier bake returns.

    The caller holds the lock of the bake folder. Raises OSError.
    """
    new, old = (bake_folder / PRIVATE_FOLDER / name for name in (NEW, OLD))
    if old.is_dir():
        if new.is_dir() and any(new.iterdir()):
            _take_back(bake_folder, new, old)
        for replaced in sorted(old.iterdir()):
            if replaced.is_symlink():  # the user's folder stays where the link leads
                replaced.unlink()
            else:
                _remove_bake(replaced, bake_folder / replaced.name)
        old.rmdir()
    shutil.rmtree(new, ignore_errors=True)


def _take_back(bake_folder: Path, new: Path, old: Path) -> None:
    """Put the replaced folders into their places again."""
    for replaced in sorted(old.iterdir()):
        place = bake_folder / replaced.name
        if os.path.lexists(place):
            os.replace(place, new / place.name)
        os.replace(replaced, place)


def _remove_bake(replaced: Path, place: Path) -> None:
    """Remove a folder with the files of a bake; what the user has put beside them moves into the sensor's folder."""
    for path in replaced.iterdir():
        if BAKE_FILE_NAMES.fullmatch(path.name) and (path.is_symlink() or not path.is_dir()):
            path.unlink()
            continue
        target = place / path.name
        while os.path.lexists(target):
            target = target.with_name(f"{target.name}_")
        os.replace(path, target)
    replaced.rmdir()
