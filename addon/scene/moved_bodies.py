# SPDX-License-Identifier: GPL-3.0-or-later
"""Free and driven bodies: where they started, putting them where the solver says, and the keyframes of a bake.

While a body is displaced by playing, or baked, its own location and rotation at the first frame are kept in its
properties, so that it can be put back exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mathutils import Euler, Matrix, Quaternion

from ...core.errors import SceneError
from ..session import fcurves, transforms

MOVED = ("FREE", "DRIVEN")
"""Values of `body` with which forces move an object."""
PATHS = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle")


def body_changed(obj) -> None:
    """Put an object back to where it started when no run will move it any more."""
    settings = obj.palpate
    if (settings.body not in MOVED or settings.role == "NONE") and not settings.is_baked:
        restore(obj)


def check(obj) -> None:
    """Raise SceneError when something else than forces, parents and its drive moves a body."""
    kind = "Free" if obj.palpate.body == "FREE" else "Driven"
    if any(constraint.enabled for constraint in obj.constraints):
        raise SceneError(f"{kind} body '{obj.name}' has constraints: disable them, or set its body to Keyframed.")
    if not obj.palpate.is_baked and fcurves.animated_paths(obj) & set(PATHS):
        raise SceneError(
            f"{kind} body '{obj.name}' has keyframes or drivers of its location or rotation: "
            + ("remove them, " if kind == "Free" else "put them on a parent that carries it, ")
            + "or set its body to Keyframed."
        )


def parent_matrix(obj, depsgraph) -> np.ndarray:
    """(4, 4) float: what its parents do to a body's own matrix at the present frame."""
    if obj.parent is None:
        return np.eye(4)
    if obj.parent_type == "OBJECT" and obj.parent.type != "CURVE":  # the same bits wherever playing has put the body
        return transforms.array(obj.parent.evaluated_get(depsgraph).matrix_world) @ transforms.array(obj.matrix_parent_inverse)
    found = obj.evaluated_get(depsgraph)
    return transforms.array(found.matrix_world @ found.matrix_basis.inverted())


def start_matrix(obj, depsgraph) -> np.ndarray:
    """(4, 4) float: world matrix at the first frame; the kept one while the body is displaced."""
    settings = obj.palpate
    if settings.has_start:
        return np.array(settings.start_matrix, dtype=float).reshape(4, 4)
    return transforms.array(obj.evaluated_get(depsgraph).matrix_world)


def remember(obj, matrix: np.ndarray) -> None:
    """Keep where a body starts, before it is moved for the first time."""
    settings = obj.palpate
    if not settings.has_start:
        settings.start_matrix = matrix.ravel()
        settings.start_channels = channels(obj)
        settings.has_start = True


def restore(obj) -> None:
    """Put a body back to where it started, to the last bit, and forget that it was elsewhere."""
    if obj.palpate.has_start:
        _set_channels(obj, np.array(obj.palpate.start_channels))
        for name in ("has_start", "start_matrix", "start_channels"):
            obj.palpate.property_unset(name)


def channels(obj) -> np.ndarray:
    """(14,) float: location, Euler, quaternion and axis-angle rotation."""
    return np.concatenate([obj.location, obj.rotation_euler, obj.rotation_quaternion, obj.rotation_axis_angle])


def _set_channels(obj, values: np.ndarray) -> None:
    obj.location, obj.rotation_euler = values[:3], values[3:6]
    obj.rotation_quaternion, obj.rotation_axis_angle = values[6:10], values[10:14]


@dataclass(frozen=True)
class Placement:
    """From a pose of the solver to the location and rotation properties of an object; the object itself is not kept.

    Attributes
    ----------
    channels : (14,) float
        Location, Euler, quaternion and axis-angle rotation at the start.
    world, parent : (4, 4) float
        The object's world matrix and its parents' share of it at the start.
    scale : float
        Metres per Blender unit.
    """

    channels: np.ndarray
    world: np.ndarray
    parent: np.ndarray
    scale: float

    @classmethod
    def of(cls, obj, matrix: np.ndarray, parent: np.ndarray, scale: float) -> Placement:
        """Describe a body that starts at a world matrix; its kept start counts when it is displaced."""
        settings = obj.palpate
        start = np.array(settings.start_channels) if settings.has_start else channels(obj)
        return cls(start.astype(float), matrix, parent, scale)

    def pose(self, obj, pose: np.ndarray, parent: np.ndarray, previous: np.ndarray | None = None) -> np.ndarray:
        """Return the (14,) properties that put the body at a pose.

        Parameters
        ----------
        pose : (7,) float
            Position (m) and quaternion of the body's frame in the world.
        parent : (4, 4) float
            The parents' share at that frame.
        previous : (14,) float, optional
            Properties at the frame before, which the rotation should not jump away from.
        """
        location, turn = self._moved(pose[None], parent[None])
        return np.concatenate([location[0], self._rotations(obj, turn[0], self.channels if previous is None else previous)])

    def path(self, obj, poses: np.ndarray, parents: np.ndarray) -> np.ndarray:
        """Return the (f, 14) properties of a whole motion, that begins at the start."""
        rows = [self.channels]
        for location, turn in zip(*self._moved(poses[1:], parents[1:]), strict=True):
            rows.append(np.concatenate([location, self._rotations(obj, turn, rows[-1])]))
        return np.array(rows)

    def _moved(self, poses: np.ndarray, parents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(f, 3) locations, and (f, 3, 3) turns from the start's rotation, of poses under what parents do."""
        stretch, basis_before, unturned = self._start
        moved = np.tile(np.eye(4), (len(poses), 1, 1))
        moved[:, :3, :3], moved[:, :3, 3] = transforms.rotation(poses[:, 3:]), poses[:, :3] / self.scale
        basis = np.linalg.inv(parents) @ moved @ stretch
        return self.channels[:3] + basis[:, :3, 3] - basis_before[:3, 3], basis[:, :3, :3] @ unturned

    @cached_property
    def _start(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The world matrix without the rigid motion in it, what the properties make of it, and the inverse of their turn."""
        location, quaternion, _ = transforms.split(self.world)
        basis = np.linalg.inv(self.parent) @ self.world
        stretch = np.linalg.inv(transforms.rigid(location, quaternion)) @ self.world
        return stretch, basis, np.linalg.inv(basis[:3, :3])

    def _rotations(self, obj, turn: np.ndarray, previous: np.ndarray) -> np.ndarray:
        """Apply a world-side rotation to the start's rotation properties; those of other modes stay as they are."""
        mode = obj.rotation_mode
        rest = self.channels[3:].copy()
        turn = Matrix(turn).to_quaternion()
        if mode == "QUATERNION":
            delta = obj.delta_rotation_quaternion
            result = delta.inverted() @ turn @ delta @ Quaternion(rest[3:7])
            result.make_compatible(Quaternion(previous[6:10]))
            rest[3:7] = result
        elif mode == "AXIS_ANGLE":
            result = turn @ Quaternion(rest[8:11], rest[7])
            axis, angle = result.to_axis_angle()
            rest[7], rest[8:11] = angle, axis
        else:
            delta = obj.delta_rotation_euler.to_quaternion()
            result = delta.inverted() @ turn @ delta @ Euler(rest[:3], mode).to_quaternion()
            rest[:3] = result.to_euler(mode, Euler(previous[3:6], mode))
        return rest

    def put(self, obj, channels: np.ndarray) -> None:
        """Give the object its (14,) properties; keep where it was before it is moved for the first time."""
        remember(obj, self.world)
        _set_channels(obj, channels)


def bake(obj, placement: Placement, frames: np.ndarray, poses: np.ndarray, parents: np.ndarray) -> None:
    """Keyframe a body's motion, linear between frames; what else its action holds stays.

    Parameters
    ----------
    frames : (f,) int
    poses : (f, 7) float
    parents : (f, 4, 4) float
    """
    table = placement.path(obj, poses, parents)
    remember(obj, placement.world)
    found, made = fcurves.ensure(obj, f"{obj.name} Palpate")
    fcurves.remove(found, PATHS)
    fcurves.write(found, "location", frames, table[:, :3])
    path, columns = {
        "QUATERNION": ("rotation_quaternion", slice(6, 10)),
        "AXIS_ANGLE": ("rotation_axis_angle", slice(10, 14)),
    }.get(obj.rotation_mode, ("rotation_euler", slice(3, 6)))
    fcurves.write(found, path, frames, table[:, columns])
    obj.palpate.made_action = obj.palpate.made_action or made
    obj.palpate.is_baked = True


def clear(obj) -> None:
    """Take the keyframes of a bake away and put the body back to where it started."""
    import bpy

    found = fcurves.of(obj)
    if found is not None:
        fcurves.remove(found, PATHS)
        if obj.palpate.made_action and len(found) == 0:
            data = obj.animation_data
            bpy.data.actions.remove(data.action)
            if not data.drivers and not data.nla_tracks:
                obj.animation_data_clear()
    obj.palpate.made_action = obj.palpate.is_baked = False
    restore(obj)
