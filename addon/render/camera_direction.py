# SPDX-License-Identifier: GPL-3.0-or-later
"""The direction from which most of the loaded texels is seen: turned to the camera, and not behind a finger or a housing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import bpy
import numpy as np
from mathutils import Vector

from ..display import materials
from .loaded_texels import LoadedTexels

AZIMUTHS = tuple(range(-180, 180, 20))
ELEVATIONS = (-20, 10, 25, 40, 60)
"""Directions that are tried, degrees."""
BEST_ELEVATION = 30.0
"""Elevation that is preferred, degrees: objects on a table look natural from there."""
ELEVATION_COST, TURN_COST = 0.15, 0.15
"""What 60° away from the best elevation, and 180° away from the scene's own camera, cost of the share that is seen."""
FACING = 0.7
"""Cosine between a texel's normal and the direction to the camera from which it counts as well seen."""
LEAST_GAIN = 0.05
"""The scene's own camera keeps its direction unless another one shows so much more."""
SIZE_GAIN = 0.3
"""What a direction gains in which all is largest, against one in which it would be infinitely small: where a long object is
foreshortened, its texels are larger. Chosen by eye: from 0.5 on, the three sensors of a sample stood behind one another."""
LIFT = 0.6
"""Distance from the surface at which a line of sight begins, in radii of the texel: the dent's own rim does not count."""
TARGET_SHARE = 0.6
"""What a texel counts that is seen through a target."""
MOST_TEXELS, MOST_FRAMES, MOST_HITS = 40, 3, 4
"""Texels per frame and frames that are tried at most, and objects that a line of sight goes through at most."""


def best_view(
    scene,
    loaded: Mapping[int, LoadedTexels],
    own: tuple[float, float],
    see_through: bool,
    corners: np.ndarray | None = None,
) -> tuple[float, float] | None:
    """Return the direction of the camera that shows most of the loaded texels; None if the scene's own is as good.

    Parameters
    ----------
    scene : Scene
        Its frame is changed.
    loaded : mapping of int to LoadedTexels
        By frame.
    own : (2,) float, degrees
        Azimuth and elevation of the scene's own camera.
    see_through : bool
        True if targets will be see-through where they cover loaded texels.
    corners : (m, 3) float, Blender units, world, optional
        Corners of what has to be in the picture. Directions in which it is larger are preferred.
    """
    found = [(frame, texels) for frame, texels in loaded.items() if len(texels)]
    places = np.linspace(0, len(found) - 1, min(len(found), MOST_FRAMES)).round().astype(int)
    sights = [found[place] for place in places]
    views = [own, *((float(azimuth), float(elevation)) for elevation in ELEVATIONS for azimuth in AZIMUTHS)]
    seen = np.zeros(len(views))
    for frame, texels in sights:
        scene.frame_set(frame)
        seen += [_share_seen(scene, texels, direction_of(view), see_through) for view in views]
    if not seen.any():
        return None
    scores = seen / len(sights) - [_cost(view, own) for view in views]
    if corners is not None:
        sizes = np.array([_size(scene, corners, view) for view in views])
        scores += SIZE_GAIN * sizes / sizes.max()
    best = int(scores.argmax())
    return None if scores[best] < scores[0] + LEAST_GAIN else views[best]


def direction_of(view: tuple[float, float]) -> np.ndarray:
    """Return the unit vector towards a camera at an azimuth and elevation in degrees, (3,)."""
    azimuth, elevation = (math.radians(angle) for angle in view)
    flat = math.cos(elevation)
    return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


def view_of(direction: Iterable[float]) -> tuple[float, float]:
    """Return azimuth and elevation in degrees of a vector towards a camera."""
    x, y, z = direction
    return math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))


def _cost(view: tuple[float, float], own: tuple[float, float]) -> float:
    turn = math.degrees(math.acos(float(np.clip(direction_of(view) @ direction_of(own), -1.0, 1.0))))
    return ELEVATION_COST * abs(view[1] - BEST_ELEVATION) / 60.0 + TURN_COST * turn / 180.0


def _size(scene, corners: np.ndarray, view: tuple[float, float]) -> float:
    """Return how large a picture that just holds (m, 3) points shows them from far away, pictures' heights per Blender unit."""
    up = np.array([0.0, 0.0, 1.0])
    towards = direction_of(view)
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    across, high = np.ptp(corners @ np.column_stack([right, np.cross(towards, right)]), axis=0)
    return 1.0 / max(across * scene.render.resolution_y / scene.render.resolution_x, high)


def first_object(scene, depsgraph, start, way):
    """Return the first object on a ray that is neither a target, with what hangs on it, nor what a bake adds; None if none."""
    seen = _objects_on_ray(scene, depsgraph, Vector(start), Vector(way).normalized())
    return next((obj for obj in seen if obj is None or _kind(obj) == "OTHER"), None)


def _objects_on_ray(scene, depsgraph, place: Vector, way: Vector) -> Iterator:
    """Yield the objects that a ray meets, one after the other and :data:`MOST_HITS` at most; None where it meets no more."""
    for _ in range(MOST_HITS):
        hit, where, _, _, obj, _ = scene.ray_cast(depsgraph, place, way)
        yield obj.original if hit else None
        if not hit:
            return
        place = where + 1e-4 * max(obj.dimensions) * way


def _share_seen(scene, loaded: LoadedTexels, towards: np.ndarray, see_through: bool) -> float:
    """Return how much of the loaded texels a camera far away in a direction sees, 0 to 1; many are evenly chosen."""
    chosen = np.linspace(0, len(loaded) - 1, min(len(loaded), MOST_TEXELS)).round().astype(int)
    facing = np.clip(loaded.normals[chosen] @ towards / FACING, 0.0, 1.0)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    starts = loaded.points + (LIFT * loaded.radii)[:, None] * loaded.normals
    shown = zip(starts[chosen], facing, strict=True)
    seen = [_clearness(scene, depsgraph, start, towards, see_through) if share > 0.0 else 0.0 for start, share in shown]
    return float(np.mean(facing * seen))


def _clearness(scene, depsgraph, start: np.ndarray, towards: np.ndarray, see_through: bool) -> float:
    """Return 1 for a free line of sight, less for one through targets, and 0 for one that something blocks."""
    clear = 1.0
    for obj in _objects_on_ray(scene, depsgraph, Vector(start), Vector(towards)):
        if obj is None:
            return clear
        kind = _kind(obj)
        if kind == "TARGET" and see_through:
            clear = TARGET_SHARE
        elif kind != "MARKER":
            return 0.0
    return 0.0


def _kind(obj) -> str:
    """Return TARGET for what becomes see-through, MARKER for what a bake adds, and OTHER."""
    if materials.SENSOR_KEY in obj or obj.hide_render:
        return "MARKER"
    role = obj.palpate.role
    while role == "NONE" and obj.parent is not None:
        obj = obj.parent
        role = "TARGET" if obj.palpate.role == "TARGET" else "NONE"
    return "TARGET" if role == "TARGET" else "OTHER"
