# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders as dictionaries that can be compared, and put back as they were."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path

FOLDER = "folder"


def tree(folder: Path) -> dict[str, str]:
    """Return a hash of each file, the target of each link and the word :data:`FOLDER` of each folder, by relative path."""
    found = {}
    for root, folders, files in os.walk(folder):
        for name in folders + files:
            path = Path(root, name)
            key = path.relative_to(folder).as_posix()
            if path.is_symlink():
                found[key] = f"link to {os.readlink(path)}"
            elif path.is_dir():
                found[key] = FOLDER
            else:
                found[key] = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "special"
    return found


def put_back(kept: Path, place: Path) -> None:
    """Make `place` a copy of a folder that was kept."""
    if place.is_symlink() or place.exists():
        os.chmod(place, 0o700)
        shutil.rmtree(place)
    shutil.copytree(kept, place, symlinks=True)


def differences(before: Mapping[str, str], after: Mapping[str, str], most: int = 8) -> str:
    """Say which paths of two trees differ; empty if none does."""
    words = [f"+{key}" for key in sorted(after.keys() - before.keys())]
    words += [f"-{key}" for key in sorted(before.keys() - after.keys())]
    words += [f"≠{key}" for key in sorted(before.keys() & after.keys()) if before[key] != after[key]]
    return ", ".join(words[:most]) + (f" and {len(words) - most} others" if len(words) > most else "")
