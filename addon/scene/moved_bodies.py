# SPDX-License-Identifier: GPL-3.0-or-later
"""Free and driven bodies: where they start, and the location and rotation that put them at a pose of the solver."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion

from ...core.errors import SceneError
from ...core.model.body import Drive, Signal
from ..properties import object_properties
from ..properties.parameter_properties import DRIVE_PARAMETER_PROPERTIES, drive_parameters
from ..session import fcurves, identity, transforms
from . import mesh_arrays, stored_names

# Driven bodies: their settings become a :class:`.Drive`; their parents move them like any child object.
#
# The animation of a driven object is the target of its drive. Its own location and rotation are those of its start; a bake
# keyframes them as it does for a free body.

TARGET_PROPERTIES = {"POSITION": "drive_position", "VELOCITY": "drive_speed", "FORCE": "drive_force"}
"""Property that holds the target, by kind of control."""
DRIVE_PROPERTIES = (*DRIVE_PARAMETER_PROPERTIES, "drive_control", "drive_axis", "drive_space", "drive_sensor", "drive_leader")
"""Properties of a drive that are constant during a run."""


def drive_target(obj, depsgraph) -> float:
    """Return the target of an object's drive at the present frame."""
    settings = obj.evaluated_get(depsgraph).palpate
    return transforms.as_typed(getattr(settings, TARGET_PROPERTIES[settings.drive_control]))


def target_path(obj) -> str | None:
    """Return the data path of the target of an object's drive; None when it has none: not driven, or coupled with another."""
    settings = obj.palpate
    if settings.body != "DRIVEN" or settings.drive_leader not in (None, obj):
        return None
    return f"palpate.{TARGET_PROPERTIES[settings.drive_control]}"


def drive_of(obj, matrix: np.ndarray, depsgraph) -> Drive:
    """Return the drive of a driven object, without its sensor and leader.

    Parameters
    ----------
    obj : Object
    matrix : (4, 4) float
        Its world matrix at the start.
    """
    settings = obj.palpate
    axis = np.zeros(3)
    axis["XYZ".index(settings.drive_axis[-1])] = -1.0 if settings.drive_axis.startswith("-") else 1.0
    if settings.drive_space == "PARENT":
        _, body, _ = transforms.decompose(matrix)
        axis = transforms.rotation(body).T @ _parent_rotation(obj, depsgraph) @ axis
    return Drive(
        control=settings.drive_control.lower(),
        target=Signal.constant(drive_target(obj, depsgraph)),
        axis=axis,
        axis_in_world=settings.drive_space == "WORLD",
        **drive_parameters(settings),
    )


def _parent_rotation(obj, depsgraph) -> np.ndarray:
    """Return the rotation of an object's parent in the world, (3, 3) float."""
    if obj.parent is None:
        return np.eye(3)
    matrix = world_matrix(obj.parent, depsgraph)
    if transforms.is_singular(matrix):
        raise SceneError(f"The scale of '{obj.parent.name}', parent of driven body '{obj.name}', is zero: give it a scale.")
    return transforms.rotation(transforms.decompose(matrix)[1])


def leader_index(obj, owners: list) -> int | None:
    """Return the index of the body whose drive also moves an object; None when the object has its own drive.

    Parameters
    ----------
    obj : Object
    owners : list
        Objects by body index.
    """
    chosen = obj.palpate.drive_leader
    if chosen is None or chosen == obj:
        return None
    if chosen not in owners or chosen.palpate.body != "DRIVEN":
        raise SceneError(f"'{obj.name}' is coupled with '{chosen.name}', which is not driven: set the body of that to Driven.")
    return owners.index(chosen)


def controlled_sensor(obj, sensor_objects: list) -> int:
    """Return the index of the sensor whose total force an object's drive controls: the chosen sensor, else the object itself.

    Parameters
    ----------
    sensor_objects : list
        Objects that are sensors and pads, by sensor index.
    """
    chosen = obj.palpate.drive_sensor or obj
    if chosen in sensor_objects and chosen.palpate.role == "SENSOR":
        return sensor_objects.index(chosen)
    raise SceneError(
        f"Driven body '{obj.name}' controls the force on '{chosen.name}', which is not a sensor: choose its Sensor."
    )


def world_matrix(obj, depsgraph) -> np.ndarray:
    """Return the evaluated world matrix of an object, (4, 4) float."""
    return transforms.as_array(obj.evaluated_get(depsgraph).matrix_world)


def decompose(obj, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return location, quaternion and stretch of an object's world matrix (:func:`.transforms.decompose`).

    Raises
    ------
    SceneError
        The matrix is singular or not finite.
    """
    if not np.isfinite(matrix).all():
        raise SceneError(f"'{obj.name}' has a NaN or infinite location, rotation or scale: check its drivers and constraints.")
    if transforms.is_singular(matrix):
        raise SceneError(f"The scale of '{obj.name}' is zero in at least one direction: give it a scale, it has no volume.")
    return transforms.decompose(matrix)


def body_pose(scene, obj, depsgraph) -> np.ndarray:
    """Return position (m) and quaternion of an object's body frame at the present frame, (7,) float."""
    position, quaternion, _ = decompose(obj, world_matrix(obj, depsgraph))
    return np.concatenate([position * transforms.metres_per_unit(scene), quaternion])


# Objects that are part of their parent's body: one or more sensors on a finger, or a handle on a box.
#
# An attached object has its own role, mesh and parameters, but no motion. It stays where it was put on its parent, and forces
# on it move the parent's body. It has no mass.

SAME_MATRIX = 1e-4
"""Largest relative change over time of an attached object's matrix that is put down to rounding."""


def body_object(obj, objects):
    """Return the object whose body an object belongs to; `objects` are those of the simulation.

    An attached object whose parent is not simulated is a body of its own, which its parents move like any other object.
    """
    while obj.palpate.body == "PARENT" and obj.parent in objects:
        obj = obj.parent
    return obj


def objects_with_role(scene) -> set:
    """Return the objects of a scene that have a role, also those that are hidden."""
    return {obj for obj in scene.objects if obj.palpate.role != "NONE"}


def check_parents(objects, body_objects: dict) -> None:
    """Raise SceneError when the parent of an object is a free or driven body of which the object is no part."""
    moved = {obj: obj.palpate.body.lower() for obj in objects if obj.palpate.body in object_properties.MOVED_BY_FORCES}
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
    above, below = world_matrix(body_object, depsgraph), world_matrix(obj, depsgraph)
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


TRANSFORM_PATHS = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle")
"""Data paths that a bake keyframes."""
DELTA_PATHS = ("delta_location", "delta_rotation_euler", "delta_rotation_quaternion")


def check_movable(obj) -> None:
    """Raise SceneError when anything but forces, parents and its drive moves a free or driven body."""
    kind = "Free" if obj.palpate.body == "FREE" else "Driven"
    if any(constraint.enabled for constraint in obj.constraints):
        raise SceneError(f"{kind} body '{obj.name}' has constraints: disable them, or set its body to Keyframed.")
    if fcurves.animated_paths(obj) & {*DELTA_PATHS, *(() if obj.palpate.is_baked else TRANSFORM_PATHS)}:
        raise SceneError(
            f"{kind} body '{obj.name}' has keyframes, drivers or NLA strips of its (delta) location or rotation: "
            + ("remove them, " if kind == "Free" else "put them on a parent that carries it, ")
            + "or set its body to Keyframed."
        )


def parent_matrix(obj, depsgraph) -> np.ndarray:
    """Return the share of its parents in an object's world matrix at the present frame, (4, 4) float."""
    if obj.parent is None:
        return np.eye(4)
    if obj.parent_type == "OBJECT" and obj.parent.type != "CURVE":  # the same bits wherever playing has moved the body
        return world_matrix(obj.parent, depsgraph) @ transforms.as_array(obj.matrix_parent_inverse)
    found = obj.evaluated_get(depsgraph)
    return transforms.as_array(found.matrix_world @ found.matrix_basis.inverted())


def start_matrix(obj, depsgraph) -> np.ndarray:
    """Return the world matrix at the first frame, (4, 4) float: the stored one while the body is displaced."""
    settings = obj.palpate
    if settings.has_start:
        return np.array(settings.start_matrix, dtype=float).reshape(4, 4)
    return world_matrix(obj, depsgraph)


@dataclass(frozen=True)
class BodyPlacement:
    """Converts poses of the solver to the location and rotation properties of an object. It holds no reference to the object.

    Attributes
    ----------
    channels : (14,) float
        Location and rotations at the start (:func:`.object_properties.transform_channels`).
    world, parent : (4, 4) float
        World matrix of the object at the start, and the share of its parents in it.
    metres_per_unit : float
    """

    channels: np.ndarray
    world: np.ndarray
    parent: np.ndarray
    metres_per_unit: float

    @classmethod
    def of(cls, obj, matrix: np.ndarray, parent: np.ndarray, metres_per_unit: float) -> BodyPlacement:
        """Return the placement of a body that starts at a world matrix; a stored start counts while it is displaced."""
        settings = obj.palpate
        start = np.array(settings.start_channels) if settings.has_start else object_properties.transform_channels(obj)
        return cls(start.astype(float), matrix, parent, metres_per_unit)

    def channels_at(self, obj, pose: np.ndarray, parent: np.ndarray, previous: np.ndarray | None = None) -> np.ndarray:
        """Return the channels that put the body at a pose, (14,) float.

        Parameters
        ----------
        pose : (7,) float
            Position (m) and quaternion of the body's frame in the world.
        parent : (4, 4) float
            The share of its parents at that frame.
        previous : (14,) float, optional
            Channels at the frame before; of equal rotations the one nearest to it is chosen.
        """
        location, turn = self._relative_motion(pose[None], parent[None])
        return np.concatenate([location[0], self._rotations(obj, turn[0], self.channels if previous is None else previous)])

    def channels_along(self, obj, poses: np.ndarray, parents: np.ndarray) -> np.ndarray:
        """Return the channels of a whole motion, (f, 14) float, which begins at the start."""
        rows = [self.channels]
        for location, turn in zip(*self._relative_motion(poses[1:], parents[1:]), strict=True):
            rows.append(np.concatenate([location, self._rotations(obj, turn, rows[-1])]))
        return np.array(rows)

    def _relative_motion(self, poses: np.ndarray, parents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return locations (f, 3) of poses and rotations from the start (f, 3, 3), in the parents' coordinates."""
        stretch, basis_before, unturned = self._start
        moved = np.tile(np.eye(4), (len(poses), 1, 1))
        moved[:, :3, :3], moved[:, :3, 3] = transforms.rotation(poses[:, 3:]), poses[:, :3] / self.metres_per_unit
        # Most parents never move; the first inversion of many small matrices wakes the threads of the linear algebra.
        is_still = (parents == parents[:1]).all()
        basis = np.linalg.inv(parents[:1] if is_still else parents) @ moved @ stretch
        return self.channels[:3] + basis[:, :3, 3] - basis_before[:3, 3], basis[:, :3, :3] @ unturned

    @cached_property
    def _start(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """At the start: the stretch in the world matrix, the object's own matrix, and the inverse of its upper left (3, 3)."""
        location, quaternion, _ = transforms.decompose(self.world)
        basis = np.linalg.inv(self.parent) @ self.world
        stretch = np.linalg.inv(transforms.pose_matrix(location, quaternion)) @ self.world
        return stretch, basis, np.linalg.inv(basis[:3, :3])

    def _rotations(self, obj, turn: np.ndarray, previous: np.ndarray) -> np.ndarray:
        """Return the 11 rotation channels after a rotation of the start by `turn`; those of other rotation modes stay."""
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

    def move(self, obj, channels: np.ndarray) -> None:
        """Give the object its channels, (14,) float, and store its start if it has not been moved before."""
        object_properties.store_start(obj, self.world)
        object_properties.set_transform_channels(obj, channels)


def keyframe_motion(obj, placement: BodyPlacement, frames: np.ndarray, poses: np.ndarray, parents: np.ndarray) -> None:
    """Keyframe a body's motion, linear between frames; other curves of its action stay.

    Parameters
    ----------
    frames : (f,) int
    poses : (f, 7) float
    parents : (f, 4, 4) float
    """
    table = placement.channels_along(obj, poses, parents)
    object_properties.store_start(obj, placement.world)
    found, is_new_action = fcurves.ensure(obj, f"{obj.name} Palpate")
    fcurves.remove(found, TRANSFORM_PATHS)
    fcurves.write(found, "location", frames, table[:, :3])
    path, columns = {
        "QUATERNION": ("rotation_quaternion", slice(6, 10)),
        "AXIS_ANGLE": ("rotation_axis_angle", slice(10, 14)),
    }.get(obj.rotation_mode, ("rotation_euler", slice(3, 6)))
    fcurves.write(found, path, frames, table[:, columns])
    obj.palpate.made_action = obj.palpate.made_action or is_new_action
    obj.palpate.is_baked = True


def remove_motion(obj) -> None:
    """Remove the keyframes of a bake and move the body back to its start."""
    found = fcurves.of_object(obj)
    if found is not None:
        fcurves.remove(found, TRANSFORM_PATHS)
        if obj.palpate.made_action and len(found) == 0:
            data = obj.animation_data
            bpy.data.actions.remove(data.action)
            if not data.drivers and not data.nla_tracks:
                obj.animation_data_clear()
    obj.palpate.made_action = obj.palpate.is_baked = False
    object_properties.restore_start(obj)


def remove_played(scene) -> None:
    """Undo what playing has changed in the scene; what was computed is kept.

    Also for files that were written without this, as after a crash, and for changes by a run that has been dropped.
    """
    for obj in scene.objects:
        settings = obj.palpate
        if settings.is_baked or not settings.uid:
            continue
        if settings.has_start and obj.is_editable:
            object_properties.restore_start(obj)
        if obj.type == "MESH" and obj.data.is_editable:
            mesh_arrays.remove_attributes(obj.data, (stored_names.FORCE,))
