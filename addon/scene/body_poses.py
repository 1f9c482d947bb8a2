# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of the bodies' objects at a scene's present frame."""

from __future__ import annotations

import numpy as np

from ...core.errors import SceneError
from ..session import transforms, units


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
    return np.concatenate([position * units.metres_per_unit(scene), quaternion])
