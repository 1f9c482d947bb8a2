# SPDX-License-Identifier: GPL-3.0-or-later
"""New bake folders take the places of the old ones: all of them or none, and a kill at any moment can be repaired.

A sensor's new bake grows in ``<sensor>.partial``. In the swap, the old folder is renamed to ``<sensor>.old`` and the new one
takes its name. Files in the old folder that no bake has written belong to the user and move into the new one. Then the old
folder is removed by a thread, because that can take as long as the bake itself.
"""

from __future__ import annotations

import re
import shutil
import threading
from contextlib import suppress
from pathlib import Path

from ...core.io.bake_folder import MANIFEST_NAME, RECORDING_NAME
from ...core.io.sensor_npz import SENSOR_NAME

BAKE_FILE_NAMES = re.compile(rf"tactile_-?\d+\.exr|{'|'.join(map(re.escape, (RECORDING_NAME, SENSOR_NAME, MANIFEST_NAME)))}")
"""Names of the files in a sensor's folder that a bake writes and replaces."""

_removals: list[threading.Thread] = []


def partial_folder(folder: Path) -> Path:
    """Return where the new bake of a sensor grows; `folder` is the sensor's."""
    return folder.with_name(f"{folder.name}.partial")


def _old_folder(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.old")


def repair(folder: Path) -> None:
    """Undo or finish the swap of a sensor's folder that a kill has interrupted."""
    old = _old_folder(folder)
    if old.exists() and not folder.exists():
        old.rename(folder)
    if old.exists():
        _move_user_files(old, folder)
        shutil.rmtree(old)


def swap(folders: list[Path]) -> None:
    """Put the new folders of all sensors in place of the old ones; if one cannot be moved, move the others back.

    Raises
    ------
    OSError
        A folder cannot be moved. The old bake is in its place again.
    """
    try:
        for folder in folders:
            if folder.exists():
                folder.rename(_old_folder(folder))
            partial_folder(folder).rename(folder)
    except BaseException:
        for folder in folders:
            with suppress(OSError):
                _swap_back(folder)
        raise
    replaced = []
    for folder in folders:
        old = _old_folder(folder)
        with suppress(
            OSError
        ):  # the new bake is in place; a file that cannot be moved stays in the old folder until the next bake
            if old.exists():
                _move_user_files(old, folder)
                replaced.append(old)
    _remove_in_background(replaced)


def wait_for_removals() -> None:
    """Return once the folders of replaced bakes are removed."""
    while _removals:
        _removals.pop().join()


def _swap_back(folder: Path) -> None:
    """Give a sensor's folder its old content back, and the new content its temporary name."""
    partial, old = partial_folder(folder), _old_folder(folder)
    if not partial.exists():
        folder.rename(partial)
    if old.exists() and not folder.exists():
        old.rename(folder)


def _move_user_files(old: Path, new: Path) -> None:
    """Move the files that no bake has written, except those whose names exist in the new folder."""
    for path in old.iterdir():
        if not BAKE_FILE_NAMES.fullmatch(path.name) and not (new / path.name).exists():
            path.rename(new / path.name)


def _remove_in_background(folders: list[Path]) -> None:
    """Remove folders in a thread; the process does not end before it is done."""
    if folders:
        thread = threading.Thread(
            target=lambda: [shutil.rmtree(folder, ignore_errors=True) for folder in folders],
            name="palpate-remover",
            daemon=False,
        )
        _removals.append(thread)
        thread.start()
