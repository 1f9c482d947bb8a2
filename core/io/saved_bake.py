# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a .blend, which is read without Blender, is as it was when it was baked.

Saving a .blend stores a note with the id of its bake, unless its settings, meshes or animation differ from those that were
baked. A .blend that is older than its bake needs no note.
"""

from __future__ import annotations

from pathlib import Path

from .bake_folder import MANIFEST_NAME, Manifest
from .regular_file import read_bytes

NOTE = "palpate-unchanged-since-bake:"
CLOCK = 2.0
"""Seconds: file systems for memory cards (FAT) store times in steps of this length."""


def note_of(bake_id: str) -> str:
    """Return what a .blend stores that has not changed since this bake."""
    return NOTE + bake_id


def has_changed(blend: Path, folder: Path, manifest: Manifest) -> bool:
    """Return True if a .blend was saved after its bake and does not say that it is unchanged.

    Parameters
    ----------
    blend : Path
    folder : Path
        Of a sensor in the bake.
    manifest : Manifest
        In this folder.
    """
    if blend.stat().st_mtime <= (folder / MANIFEST_NAME).stat().st_mtime + CLOCK:
        return False
    return not manifest.bake_id or note_of(manifest.bake_id).encode() not in read_bytes(blend)
