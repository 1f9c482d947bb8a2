# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in which an indenter does not hide the texels below it.

Where targets cover loaded texels, or the arrow of a force, a second render without them is blended over the first. Opaque,
metal and glass objects so become a faint image of themselves there and stay what they are elsewhere, in every engine. No
material is touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from ...core.io.file_writing import atomic_write
from ...core.io.hidden_folder import temporary_folder
from ..display import materials
from ..session import fcurves
from . import camera_direction, render
from .loaded_texels import LoadedTexels

CLEARNESS = 0.82
"""Share of the second render where targets are see-through; what is left of them shows their outline and their lights."""
FULL_RADII, FADED_RADII = 1.6, 2.6
"""Distance from the loaded part of a sensor, in radii of texels, up to which targets are see-through, and from which they are
as they were. A radius of 1.6 reaches over the corner of a square texel; how wide the fade is was chosen by eye."""
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
    with fcurves.frame_kept(scene):
        scene.frame_set(frame)
        targets = [obj for obj in scene.objects if obj.palpate.role == "TARGET"]
        targets += [child for obj in targets for child in obj.children_recursive if child.palpate.role == "NONE"]
        hidden = [obj for obj in dict.fromkeys(targets) if render.is_rendered(obj)]  # with what hangs on them
        if not len(loaded) or not hidden or not _cover(scene, hidden, loaded):
            return path
        weights = clear_weights(scene, loaded, size)
    rows, columns = np.nonzero(weights > 0.0)
    if not len(rows):
        return path
    with temporary_folder(path.parent, "see-through") as folder, _without(scene, hidden, rows, columns, weights.shape):
        clear = render.render_frame(scene, folder / "clear.png", frame, samples=samples, size=size)
        _blend(path, clear, weights)
    return path


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
    places = np.array([render.image_position(scene, point) for point in loaded.points[facing]]).reshape(-1, 2)
    seen = ((places >= 0.0) & (places < 1.0)).all(axis=1)
    pixels = np.column_stack([places[:, 0] * width, (1.0 - places[:, 1]) * height])
    free = np.ones((height, width), dtype=bool)
    for number in np.unique(loaded.sensors[facing]):
        free &= ~_patch(pixels[loaded.sensors[facing] == number], width, height)
    radii = [
        radius * render.pixels_per_unit(scene, point, width)
        for point, radius in zip(loaded.points[facing][seen], loaded.radii[facing][seen], strict=True)
    ]
    if free.all():
        return np.zeros((height, width))
    radius = max(float(np.median(radii)), 0.5) if radii else 0.5
    full, faded = FULL_RADII * radius, max(FADED_RADII * radius, FULL_RADII * radius + LEAST_PIXELS)
    share = np.clip((faded - distance_transform_edt(free)) / (faded - full), 0.0, 1.0)
    weights = CLEARNESS * share * share * (3.0 - 2.0 * share)
    weights *= _shows_sensors(scene, (weights > 0.0) & free)
    return np.maximum(weights, CLEARNESS * _outline(scene, [obj for obj in scene.objects if materials.SENSOR_KEY in obj], size))


def _outline(scene, objects, size: tuple[int, int]) -> np.ndarray:
    """(height, width) float: 1 in the pixels of the objects' faces, with a soft edge; what covers them is not asked."""
    from PIL import Image, ImageDraw
    from scipy.ndimage import uniform_filter

    image, depsgraph = Image.new("1", size), bpy.context.evaluated_depsgraph_get()
    draw = ImageDraw.Draw(image)
    for obj in filter(render.is_rendered, objects):
        evaluated = obj.evaluated_get(depsgraph)
        places = [render.image_position(scene, evaluated.matrix_world @ vertex.co) for vertex in evaluated.data.vertices]
        pixels = [(x * size[0], (1.0 - y) * size[1]) for x, y in places]
        for face in evaluated.data.polygons:
            draw.polygon([pixels[vertex] for vertex in face.vertices], fill=1)
    shown = np.array(image, dtype=float)
    return np.minimum(shown, uniform_filter(shown, 3))


def _shows_sensors(scene, asked: np.ndarray) -> np.ndarray:
    """(height, width) float: 0 where no sensor is behind the targets, 1 elsewhere; beside a sensor its target stays as it is.

    Parameters
    ----------
    asked : (height, width) bool
        Pixels that are looked at; the others count as 1.
    """
    from scipy.ndimage import median_filter, uniform_filter

    height, width = asked.shape
    depsgraph, eye = bpy.context.evaluated_depsgraph_get(), scene.camera.matrix_world.translation
    shown = np.ones(asked.shape)
    for y, x in zip(*np.nonzero(asked), strict=True):
        way = render.view_direction(scene, (x + 0.5) / width, 1.0 - (y + 0.5) / height)
        found = camera_direction.first_object(scene, depsgraph, eye, way)
        shown[y, x] = found is not None and found.palpate.role == "SENSOR"
    shown = median_filter(shown, 3)  # a ray that leaves a target within a hair of the sensor misses the sensor: lone pixels
    return np.minimum(shown, uniform_filter(shown, 3))  # a soft edge, as that of a render


def _patch(pixels: np.ndarray, width: int, height: int) -> np.ndarray:
    """(height, width) bool: the convex hull of places in a picture, so that a map has no hole between two places of contact.

    Parameters
    ----------
    pixels : (n, 2) float
        Pixels to the right and downwards; places beyond the picture's edge count for the hull alone.
    """
    from PIL import Image, ImageDraw
    from scipy.spatial import ConvexHull, QhullError

    image = Image.new("1", (width, height))
    corners: list[tuple[float, float]] = []
    with suppress(QhullError, ValueError):  # fewer than three points, or all on a line
        corners = [(float(x), float(y)) for x, y in pixels[ConvexHull(pixels).vertices]]
    if corners:
        ImageDraw.Draw(image).polygon(corners, fill=1, outline=1)
    inside = np.array(image, dtype=bool)
    for x, y in np.floor(pixels).astype(int):
        if 0 <= x < width and 0 <= y < height:
            inside[y, x] = True
    return inside


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
    with render.TemporaryChanges() as changes:
        changes.set(scene.render, **border)
        for obj in objects:
            changes.set(obj, hide_render=True)
        yield


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
