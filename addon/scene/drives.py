# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies: their settings become a :class:`.Drive`; their parents move them like any child object.

The animation of a driven object is the target of its drive. Its own location and rotation are those of its start; a bake
keyframes them as it does for a free body.
"""

from __future__ import annotations

import numpy as np

from ...core.errors import SceneError
from ...core.model.body import Drive, Signal
from ..properties.parameter_properties import DRIVE_PARAMETER_PROPERTIES, drive_parameters
from ..session import transforms

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
    matrix = transforms.as_array(obj.parent.evaluated_get(depsgraph).matrix_world)
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


def matrix_without_drive(matrix: np.ndarray, parent: np.ndarray, parent_now: np.ndarray) -> np.ndarray:
    """Return the world matrix that a driven object would have now without its drive, (4, 4) float.

    Parameters
    ----------
    matrix : (4, 4) float
        World matrix at the start.
    parent, parent_now : (4, 4) float
        The share of its parents in the matrix, at the start and now.
    """
    return parent_now @ np.linalg.inv(parent) @ matrix
