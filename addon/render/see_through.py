# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in which what presses does not hide what it presses on.

Where targets cover loaded texels, a second render without them is blended over the first. Opaque, metal and glass objects so
become a faint image of themselves around the contact and stay what they are elsewhere, in every engine. No material is touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from ...core.io.file_writing import atomic_write
from ...core.io.temporary_folder import temporary_folder
from ..scene import participants
from . import render
from .loaded_texels import LoadedTexels

CLEARNESS = 0.82
"""Share of the second render where targets are see-through; what is left of them shows their outline and their lights."""
FULL_RADII, FADED_RADII = 1.6, 4.0
"""Distance from a loaded texel, in radii of texels, up to which targets are see-through, and from which they are as they were.
A radius of 1.6 reaches over the corner of a square texel."""
MOST_RAYS = 60
"""Loaded texels, at most, from which it is tried whether a target covers them; evenly chosen."""
LEAST_PIXELS = 2.0
"""Width of the blend at least."""


def render_picture(
    scene, path: Path, frame: int, loaded: LoadedTexels, *, samples: int | None = None, size: tuple[int, int]
) -> Path:
    """Render one frame as :func:`.render.render_frame` does, with targets see-through where they cover loaded texels.

    Parameters
    ----------
    scene : Scene
    path : path
    frame : int
        The frame of `loaded`, at which the scene stands afterwards as before.
    loaded : LoadedTexels
    samples, size
        See :func:`.render.render_frame`.

    Raises
    ------
    PalpateError
        As :func:`.render.render_frame`.
    """
    path = render.render_frame(scene, path, frame, samples=samples, size=size)
    now = scene.frame_current, scene.frame_subframe
    scene.frame_set(frame)
    try:
        hidden = _target_parts(scene)
        if not len(loaded) or not hidden or not _cover(scene, hidden, loaded):
            return path
        weights = clear_weights(scene, loaded, size)
    finally:
        scene.frame_set(now[0], subframe=now[1])
    rows, columns = np.nonzero(weights > 0.0)
    if not len(rows):
        return path
    with temporary_folder(path.parent, "see-through") as folder, _without(scene, hidden, rows, columns, weights.shape):
        clear = render.render_frame(scene, folder / "clear.png", frame, samples=samples, size=size)
        _blend(path, clear, weights)
    return path


def _target_parts(scene) -> list:
    """Return the targets and what hangs on them, as far as it is rendered and no sensor or pad."""
    found = [obj for obj in scene.objects if obj.palpate.role == "TARGET"]
    found += [child for obj in found for child in obj.children_recursive if child.palpate.role == "NONE"]
    return [obj for obj in dict.fromkeys(found) if _is_rendered(obj)]


def _is_rendered(obj) -> bool:
    return obj.type in participants.OBJECT_TYPES and not obj.hide_render and obj.visible_get()


def _cover(scene, objects, loaded: LoadedTexels) -> bool:
    """Return True when an object stands between the camera and a loaded texel that faces it."""
    eye = np.array(scene.camera.matrix_world.translation)
    chosen = np.linspace(0, len(loaded) - 1, min(len(loaded), MOST_RAYS)).round().astype(int)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for obj in objects:
        if obj.type != "MESH":
            return True
        evaluated, inverse = obj.evaluated_get(depsgraph), obj.matrix_world.inverted_safe()
        for i in chosen:
            way = eye - loaded.points[i]
            if way @ loaded.normals[i] <= 0.0:
                continue
            start = inverse @ Vector(loaded.points[i] + 1e-4 * way)
            way_there = inverse @ Vector(eye) - start
            if way_there.length > 0.0 and evaluated.ray_cast(start, way_there.normalized(), distance=way_there.length)[0]:
                return True
    return False


def clear_weights(scene, loaded: LoadedTexels, size: tuple[int, int]) -> np.ndarray:
    """Return the share of the second render in each pixel of a picture: (height, width) float, row 0 at the top."""
    from scipy.ndimage import distance_transform_edt

    width, height = size
    eye = np.array(scene.camera.matrix_world.translation)
    facing = np.einsum("ij,ij->i", eye - loaded.points, loaded.normals) > 0.0
    free = np.ones((height, width), dtype=bool)
    radii = []
    for point, radius in zip(loaded.points[facing], loaded.radii[facing], strict=True):
        x, y = render.image_position(scene, point)
        if 0.0 <= x < 1.0 and 0.0 <= y < 1.0:
            free[min(int((1.0 - y) * height), height - 1), int(x * width)] = False
            radii.append(radius * render.pixels_per_unit(scene, point, width))
    if free.all():
        return np.zeros((height, width))
    radius = max(float(np.median(radii)), 0.5)
    full, faded = FULL_RADII * radius, max(FADED_RADII * radius, FULL_RADII * radius + LEAST_PIXELS)
    share = np.clip((faded - distance_transform_edt(free)) / (faded - full), 0.0, 1.0)
    return CLEARNESS * share * share * (3.0 - 2.0 * share)


@contextmanager
def _without(scene, objects, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> Iterator[None]:
    """Render nothing of these objects, and only the part of the picture with these pixels; then restore the scene."""
    height, width = shape
    border = {
        "border_min_x": columns.min() / width,
        "border_max_x": (columns.max() + 1) / width,
        "border_min_y": 1.0 - (rows.max() + 1) / height,
        "border_max_y": 1.0 - rows.min() / height,
        "use_border": True,
        "use_crop_to_border": False,
    }
    before = {name: getattr(scene.render, name) for name in border}
    try:
        for name, value in border.items():
            setattr(scene.render, name, value)
        for obj in objects:
            obj.hide_render = True
        yield
    finally:
        for obj in objects:
            obj.hide_render = False
        for name, value in before.items():
            setattr(scene.render, name, value)


def _blend(path: Path, clear: Path, weights: np.ndarray) -> None:
    """Blend a second picture over a first one, and replace the first; colours count by their opacity."""
    from PIL import Image

    with Image.open(path) as opened, Image.open(clear) as second:
        mode = opened.mode
        one, other = (np.asarray(picture.convert("RGBA"), dtype=float) / 255.0 for picture in (opened, second))
    share = weights[..., None]
    alpha = (1.0 - share) * one[..., 3:] + share * other[..., 3:]
    colour = (1.0 - share) * one[..., 3:] * one[..., :3] + share * other[..., 3:] * other[..., :3]
    mixed = np.concatenate([np.divide(colour, alpha, out=np.zeros_like(colour), where=alpha > 0.0), alpha], axis=2)
    with atomic_write(path) as temporary:
        Image.fromarray((255.0 * mixed + 0.5).astype(np.uint8), "RGBA").convert(mode).save(temporary, format="PNG")
