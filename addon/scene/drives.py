# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies: what their panel says becomes a :class:`Drive`, and where their carrier has them.

The carrier is whatever moves the object's parent. What is animated is the target of the drive; the object's own location and
rotation are those of its start, and a bake keyframes them as it does a free body's.
"""

from __future__ import annotations

import numpy as np

from ...core.errors import SceneError
from ...core.model.drive import Drive
from ...core.model.motion import Signal
from ..session import transforms, units

TARGETS = {"POSITION": "drive_position", "VELOCITY": "drive_speed", "FORCE": "drive_force"}
"""Property that holds the target, by control."""
SETTINGS = (
    "drive_control", "drive_axis", "drive_space", "drive_stiffness", "drive_damping", "drive_max_force", "drive_max_speed",
    "drive_settling", "drive_sensor", "drive_leader",
)  # fmt: skip
"""Properties that hold for the whole run."""


def target(obj, depsgraph) -> float:
    """Return the target of an object's drive at the present frame."""
    settings = obj.evaluated_get(depsgraph).palpate
    return units.as_typed(getattr(settings, TARGETS[settings.drive_control]))


def drive_of(obj, matrix: np.ndarray, depsgraph) -> Drive:
    """Return the drive of a driven object without its sensor and leader.

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
        _, body, _ = transforms.split(matrix)
        axis = transforms.rotation(body).T @ _parent_rotation(obj, depsgraph) @ axis
    return Drive(
        control=settings.drive_control.lower(),
        target=Signal.constant(target(obj, depsgraph)),
        axis=axis,
        axis_in_world=settings.drive_space == "WORLD",
        stiffness=units.as_typed(settings.drive_stiffness),
        damping=units.as_typed(settings.drive_damping),
        max_force=units.as_typed(settings.drive_max_force),
        max_speed=units.as_typed(settings.drive_max_speed),
        settling=units.as_typed(settings.drive_settling),
    )


def _parent_rotation(obj, depsgraph) -> np.ndarray:
    if obj.parent is None:
        return np.eye(3)
    matrix = transforms.array(obj.parent.evaluated_get(depsgraph).matrix_world)
    if transforms.is_singular(matrix):
        raise SceneError(f"The scale of '{obj.parent.name}', parent of driven body '{obj.name}', is zero: give it a scale.")
    return transforms.rotation(transforms.split(matrix)[1])


def leader(obj, owners: list) -> int | None:
    """Index of the body whose drive moves an object as well, None when it has a drive of its own."""
    chosen = obj.palpate.drive_leader
    if chosen is None or chosen == obj:
        return None
    if chosen not in owners or chosen.palpate.body != "DRIVEN":
        raise SceneError(f"'{obj.name}' is coupled with '{chosen.name}', which is not driven: set the body of that to Driven.")
    return owners.index(chosen)


def sensor(obj, sensor_objects: list) -> int:
    """Index of the sensor whose sum an object's drive controls: the chosen one, else the object's own.

    Parameters
    ----------
    sensor_objects : list
        Objects that hold the sensors and pads, by sensor index.
    """
    chosen = obj.palpate.drive_sensor or obj
    if chosen in sensor_objects and chosen.palpate.role == "SENSOR":
        return sensor_objects.index(chosen)
    raise SceneError(f"Driven body '{obj.name}' controls the force on '{chosen.name}', which is no sensor: choose its Sensor.")


def carried(matrix: np.ndarray, parent: np.ndarray, parent_now: np.ndarray) -> np.ndarray:
    """(4, 4) float: world matrix of a driven object now without its drive.

    Parameters
    ----------
    matrix : (4, 4) float
        World matrix at the start.
    parent, parent_now : (4, 4) float
        The parents' share of it then and now.
    """
    return parent_now @ np.linalg.inv(parent) @ matrix
