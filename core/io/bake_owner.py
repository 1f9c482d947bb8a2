# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose bake is in a folder: the scene that it belongs to, told by the scene's id and by the path of its .blend.

A .blend stores an id for each scene from its first bake that is saved. A .blend that was renamed or moved is known by this id.
A copy of a .blend has the id of its original, so the path decides between the two: as long as the original is where it was, it
owns the bake.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from .bake_folder import Manifest


@dataclass(frozen=True)
class BakeOwner:
    """The scene that is baked.

    Attributes
    ----------
    scene_id : str
        Id of the scene; empty where its .blend does not store one.
    blend : Path or None
        The .blend that the bake belongs to; None if the scene was never saved.
    source : Path or None
        The .blend that was opened, where the scene is saved to another one together with the bake.
    other_scenes : frozenset of str
        Ids of the other scenes in the same .blend.
    """

    scene_id: str = ""
    blend: Path | None = None
    source: Path | None = None
    other_scenes: frozenset[str] = frozenset()

    def scene_path(self, bake_folder: Path) -> str:
        """Return the path of the .blend as manifests hold it: with ``/``, and relative to the bake folder where possible."""
        if self.blend is None:
            return ""
        blend = os.path.realpath(self.blend)
        try:
            return Path(os.path.relpath(blend, os.path.realpath(bake_folder))).as_posix()
        except ValueError:  # Windows: another drive
            return Path(blend).as_posix()


def other_owner(manifest: Manifest, bake_folder: Path, owner: BakeOwner) -> str:
    """Return whose bake a manifest describes, in words, if it belongs to another scene than `owner`; empty if not.

    Parameters
    ----------
    manifest : Manifest
        Of a sensor's folder in `bake_folder`.
    bake_folder : Path
    owner : BakeOwner
        The scene that would replace the bake.
    """
    same_id = bool(manifest.scene_id) and manifest.scene_id == owner.scene_id
    if not same_id and manifest.scene_id in owner.other_scenes:
        return "another scene of the same .blend"
    blend = _recorded_blend(manifest, bake_folder, owner)
    if blend is not None and any(_is_same_file(blend, own) for own in (owner.blend, owner.source) if own is not None):
        return ""
    if manifest.scene_id and owner.scene_id and not same_id:
        return "a scene that was not saved" if blend is None else f"'{blend}'"
    # Without two ids to compare, or with the id of a copy, the .blend that is still there owns its bake.
    return f"'{blend}'" if blend is not None and os.path.isfile(blend) else ""


def _recorded_blend(manifest: Manifest, bake_folder: Path, owner: BakeOwner) -> Path | None:
    """Return the path of the .blend that a manifest names; in older manifests it is a name beside the present .blend."""
    if "\0" in manifest.scene_path or manifest.scene_path.startswith(("//", "\\\\")):
        return None  # no path of ours; Windows would ask a server for such a file
    if manifest.scene_path:
        return Path(os.path.normpath(Path(os.path.realpath(bake_folder), manifest.scene_path)))
    if manifest.scene_file and owner.blend is not None:
        return (owner.source or owner.blend).with_name(os.path.basename(manifest.scene_file))
    return None


def _is_same_file(one: Path, other: Path) -> bool:
    """Return True if two paths lead to the same file, or are the same path of a file that does not exist."""
    try:
        return one.samefile(other)  # also where a file system ignores case
    except (OSError, ValueError):
        return os.path.realpath(one) == os.path.realpath(other)
