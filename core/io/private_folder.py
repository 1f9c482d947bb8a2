# SPDX-License-Identifier: GPL-3.0-or-later
"""The hidden folder ``.palpate`` in a bake folder: all that is Palpate's own and no part of the finished bake.

A marker file, written when the folder is made, tells it from a folder of the user's with the same name. Names from a file, such
as those of sensors, cannot collide with anything in it.
"""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Callable
from pathlib import Path

from ..errors import FileError, os_error_reason
from .file_writing import atomic_write, remove_leftovers

PRIVATE_FOLDER = ".palpate"
MARKER_NAME = "palpate-folder.json"
MARKER_FORMAT = "palpate-folder/1"
LOCK_NAME = "lock"


def find_private_folder(bake_folder: Path) -> Path | None:
    """Return the hidden folder of a bake folder if Palpate made it; None if there is none or it is somebody else's."""
    folder = bake_folder / PRIVATE_FOLDER
    marker = folder / MARKER_NAME
    if folder.is_symlink() or marker.is_symlink() or not marker.is_file():
        return None
    try:
        content = json.loads(marker.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return folder if isinstance(content, dict) and content.get("format") == MARKER_FORMAT else None


def make_private_folder(bake_folder: Path) -> Path:
    """Return the hidden folder of a bake folder, which is made if there is none.

    Raises
    ------
    FileError
        It cannot be made, or something that Palpate did not make has its name.
    """
    found = find_private_folder(bake_folder)
    if found is not None:
        return found
    folder = bake_folder / PRIVATE_FOLDER
    try:
        folder.mkdir(exist_ok=True)
        if not folder.is_symlink():
            remove_leftovers(folder)  # of a run that was killed before it had written the marker
        if folder.is_symlink() or any(path.name != LOCK_NAME for path in folder.iterdir()):
            raise FileError(f"'{folder}' was not made by Palpate: rename it, or choose another bake folder.")
    except OSError as error:
        raise FileError(
            f"The folder '{folder}' could not be made ({os_error_reason(error)}): rename what has its name, "
            "check the permissions, or choose another bake folder."
        ) from error
    with atomic_write(folder / MARKER_NAME) as temporary:
        temporary.write_text(json.dumps({"format": MARKER_FORMAT, "id": secrets.token_hex(16)}) + "\n", encoding="utf-8")
    return folder


def remove_tree(folder: Path) -> None:
    """Remove a folder of Palpate's own as far as possible; a link in it is removed, never what it leads to."""
    if folder.is_symlink() or not folder.is_dir():
        return
    for root, folders, files in os.walk(folder, topdown=False):
        for name in files:
            _remove(os.unlink, Path(root, name))
        for name in folders:
            path = Path(root, name)
            _remove(os.unlink if path.is_symlink() else os.rmdir, path)
    _remove(os.rmdir, folder)


def _remove(function: Callable[[Path], None], path: Path) -> None:
    try:
        function(path)
    except OSError:
        return  # the next bake tries again
