# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that are part of their parent's body: one or more sensors on a finger, or a handle on a box.

An attached object has its own role, mesh and parameters, but no motion. It stays where it was put on its parent, and forces on
it move the parent's body. It has no mass.
"""

from __future__ import annotations

import numpy as np

from ...core.errors import SceneError
from ..properties import start_transforms
from ..session import identity, transforms

SAME_MATRIX = 1e-4
"""Largest relative change over time of an attached object's matrix that is put down to rounding."""


def body_objects(objects) -> dict:
    """Return, for each of the participating objects, the object whose body it belongs to.

    An attached object whose parent is not simulated is a body of its own, which its parents move like any other object.
    """
    return {obj: body_object(obj, set(objects)) for obj in objects}


def body_object(obj, objects):
    """Return the object whose body an object belongs to; `objects` are those of the simulation."""
    while obj.palpate.body == "PARENT" and obj.parent in objects:
        obj = obj.parent
    return obj


def objects_with_role(scene) -> set:
    """Return the objects of a scene that have a role, also those that are hidden."""
    return {obj for obj in scene.objects if obj.palpate.role != "NONE"}


def check_parents(objects, body_objects: dict) -> None:
    """Raise SceneError when the parent of an object is a free or driven body of which the object is no part."""
    moved = {obj: obj.palpate.body.lower() for obj in objects if obj.palpate.body in start_transforms.MOVED_BY_FORCES}
    for obj in objects:
        above = obj.parent
        while above is not None:
            if above in moved and body_objects[obj] != above:
                raise SceneError(
                    f"'{obj.name}' is a child of {moved[above]} body '{above.name}': "
                    "set its body to Part of Parent, or clear its parent, so that it is a body of its own."
                )
            above = above.parent


def matrix_on_body(obj, body_object, depsgraph) -> np.ndarray:
    """Return the matrix from an attached object's coordinates to those of the object whose body it belongs to, (4, 4) float."""
    above, below = (transforms.as_array(item.evaluated_get(depsgraph).matrix_world) for item in (body_object, obj))
    if transforms.is_singular(above) or transforms.is_singular(below):
        raise SceneError(f"The scale of '{body_object.name}' or its part '{obj.name}' is zero: give it a scale.")
    return np.linalg.inv(above) @ below


def to_body_frame(matrix: np.ndarray, attachment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (3, 3) and (3,) float, which take an attached object's vertices to the body's frame, in Blender units.

    Parameters
    ----------
    matrix : (4, 4) float
        World matrix of the object whose body it is.
    attachment : (4, 4) float
        From :func:`matrix_on_body`.
    """
    position, quaternion, _ = transforms.decompose(matrix)
    whole = np.linalg.inv(transforms.pose_matrix(position, quaternion)) @ matrix @ attachment
    return whole[:3, :3], whole[:3, 3]


def check_attachments(scene, depsgraph, attachments: dict[str, np.ndarray]) -> None:
    """Raise SceneError when an object has moved on its body; `attachments` are the matrices at the first frame, by key."""
    for key, obj in identity.find_objects(scene, attachments).items():
        now = matrix_on_body(obj, body_object(obj, objects_with_role(scene)), depsgraph)
        if np.abs(now - attachments[key]).max() > SAME_MATRIX * np.abs(attachments[key]).max():
            raise SceneError(
                f"'{obj.name}' moves on its parent (frame {scene.frame_current}), but is part of that body: "
                "remove its keyframes, or set its body to Keyframed."
            )
