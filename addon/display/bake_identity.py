# SPDX-License-Identifier: GPL-3.0-or-later
"""Does a folder hold the bake that a scene shows? The .blend stores the digest and the id of its bake, the manifest both too.

They differ when the folder was baked again by another .blend, by a script or by `palpate bake` without --save, or when an older
copy of the .blend is opened. Keyframes in the scene then belong to other forces than the files. This is asked at every frame,
so manifests are kept in memory until their files change.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from ...core.errors import FileError, SceneError
from ...core.io.bake_folder import MANIFEST_NAME, Manifest, read_manifest
from ...core.io.bake_reader import Bake
from . import baked_scene


def other_bake(scene) -> str:
    """Return a sentence if a folder holds another bake than the one that a scene shows; empty if not.

    Nothing is said where a manifest cannot be read, and for scenes that were baked by versions without digests.
    """
    settings = scene.palpate
    for folder in sorted(baked_scene.bake_folders(scene).values()):
        found = _manifest(folder, manifest_stamp(folder))
        if found is None or not settings.baked_digest:
            continue
        same_id = not (settings.baked_id and found.bake_id) or found.bake_id == settings.baked_id
        if found.digest != settings.baked_digest or not same_id:
            return (
                f"'{folder}' holds another bake than the one that '{scene.name}' shows: "
                "bake again, or open the .blend that was saved with that bake."
            )
    return ""


def require_own_bake(scene) -> None:
    """Raise SceneError if a folder holds another bake than the one that a scene shows."""
    text = other_bake(scene)
    if text:
        raise SceneError(text)


def require_images(bake: Bake) -> None:
    """Raise SceneError if a bake has no tactile images, which a scene would show."""
    for name, manifest in bake.manifests.items():
        if not manifest.has_images:
            raise SceneError(
                f"The bake of sensor '{name}' in '{bake.folders[name]}' has no tactile images, which the scene would show: "
                "bake again with images."
            )


def manifest_stamp(folder: Path) -> tuple[int, ...]:
    """Return what changes when the manifest in a sensor's folder is replaced; empty where there is none."""
    try:
        about = (folder / MANIFEST_NAME).stat()
    except OSError:
        return ()
    return about.st_size, about.st_mtime_ns, about.st_ino


@lru_cache(maxsize=64)
def _manifest(folder: Path, _stamp: tuple[int, ...]) -> Manifest | None:
    """Return the manifest in a sensor's folder, as long as its stamp stays; None when it cannot be read."""
    try:
        return read_manifest(folder)
    except FileError:  # who reads the bake says so
        return None
