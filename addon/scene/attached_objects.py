# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that are part of their parent's body: a sensor on a finger, several of them, a handle on a box.

A part has a role, a mesh and parameters of its own, and no motion: it lies where it was put on its parent, and what presses
on it moves the parent. Parts weigh nothing.
"""

from __future__ import annotations

import numpy as np

from ...core.errors import SceneError
from ..session import identity, transforms
from . import moved_bodies

SAME_PLACE = 1e-4
"""Largest change of a part's place over time, relative to its entries, that is put down to rounding."""


def carriers(objects) -> dict:
    """Return which object's body each of the objects that take part belongs to.

    A part whose parent takes no part is a body of its own, which its parents move like any other object.
    """
    return {obj: _carrier(obj, set(objects)) for obj in objects}


def _carrier(obj, taking_part):
    while obj.palpate.body == "PARENT" and obj.parent in taking_part:
        obj = obj.parent
    return obj


def check(objects, carrier: dict) -> None:
    """Raise SceneError when an object hangs on a free or driven body without being part of it."""
    moved = {obj: obj.palpate.body.lower() for obj in objects if obj.palpate.body in moved_bodies.MOVED}
    for obj in objects:
        above = obj.parent
        while above is not None:
            if above in moved and carrier[obj] != above:
                raise SceneError(
                    f"'{obj.name}' is a child of {moved[above]} body '{above.name}': "
                    "set its body to Part of Parent, or clear its parent, so that it is a body of its own."
                )
            above = above.parent


def place(obj, carrier, depsgraph) -> np.ndarray:
    """(4, 4) float: from a part's coordinates to those of the object whose body it belongs to."""
    above, below = (transforms.array(item.evaluated_get(depsgraph).matrix_world) for item in (carrier, obj))
    if transforms.is_singular(above) or transforms.is_singular(below):
        raise SceneError(f"The scale of '{carrier.name}' or its part '{obj.name}' is zero: give it a scale.")
    return np.linalg.inv(above) @ below


def into_body(matrix: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what brings a part's vertices into the body's frame, in Blender units: times (3, 3), plus (3,).

    Parameters
    ----------
    matrix : (4, 4) float
        World matrix of the object whose body it is.
    place : (4, 4) float
        Of the part in that object.
    """
    position, quaternion, _ = transforms.split(matrix)
    whole = np.linalg.inv(transforms.rigid(position, quaternion)) @ matrix @ place
    return whole[:3, :3], whole[:3, 3]


def check_places(scene, depsgraph, places: dict[str, np.ndarray]) -> None:
    """Raise SceneError when a part has moved on its body; `places` are those at the first frame, by key."""
    for key, obj in identity.find(scene, places).items():
        now = place(obj, _carrier(obj, {other for other in scene.objects if other.palpate.role != "NONE"}), depsgraph)
        if np.abs(now - places[key]).max() > SAME_PLACE * np.abs(places[key]).max():
            raise SceneError(
                f"'{obj.name}' moves on its parent (frame {scene.frame_current}), but is part of that body: "
                "remove its keyframes, or set its body to Keyframed."
            )
