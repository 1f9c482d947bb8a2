# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion between Blender's matrices and the solver's poses.

A body's frame has the location and rotation of its object. The rest of the matrix, scale and shear, is its *stretch* and is
applied to the vertices: ``matrix = translation · rotation · stretch``.
"""

from __future__ import annotations

import math

import numpy as np


def metres_per_unit(scene) -> float:
    """Return the length of one Blender unit, metres. Without a unit system Blender ignores its scale, and so does this."""
    settings = scene.unit_settings
    return 1.0 if settings.system == "NONE" else float(settings.scale_length)


def gravity(scene) -> np.ndarray:
    """Return the gravity of a scene, (3,) float, m/s².

    The scene's number is taken in m/s² for any unit scale, as Blender's own physics does: a scene in millimetres keeps −9.81.
    """
    return np.array([as_typed(value) for value in scene.gravity]) if scene.use_gravity else np.zeros(3)


def frames_per_second(scene) -> float:
    """Return the frame rate, divided by its base (30 / 1.001 is 29.97)."""
    return scene.render.fps / scene.render.fps_base


def as_typed(value: float) -> float:
    """Return the number that the user typed. Blender stores 32 bits of it, which would turn 0.0583 into 0.05829999968."""
    return float(str(np.float32(value)))


SHEAR = 1e-5
"""Cosine between two axes of a matrix above which it counts as sheared; a 32-bit rotation matrix stays below 1e-6."""


def as_array(matrix) -> np.ndarray:
    """Return a mathutils Matrix as an array, e.g. (4, 4) float64."""
    return np.array([*map(tuple, matrix)])


def values_of(items, key: str, kind: type = np.float32, width: int = 1) -> np.ndarray:
    """Return a property of all items of one of Blender's collections, (width · n,) of the type in which Blender holds it."""
    found = np.empty(width * len(items), dtype=kind)
    items.foreach_get(key, found)
    return found


def decompose(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Decompose a matrix into location, rotation and stretch.

    Parameters
    ----------
    matrix : (4, 4) float
        Not singular.

    Returns
    -------
    location : (3,) float, Blender units
    quaternion : (4,) float, (w, x, y, z)
    stretch : (3, 3) float
        Diagonal unless the matrix is sheared; of negative determinant where the matrix mirrors. The rotation then has the y and
        z axes of the object, and x against its x axis, so that equal forces on a left and a right finger read the same along z.
    """
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = matrix.tolist()  # plain numbers take a tenth of the time of small arrays
    columns = (a, d, g), (b, e, h), (c, f, i)
    lengths = [math.sqrt(_dot(column, column)) for column in columns]
    u, v, w = ([value / length for value in column] for column, length in zip(columns, lengths, strict=True))
    if max(abs(_dot(u, v)), abs(_dot(v, w)), abs(_dot(w, u))) < SHEAR:
        rotation, stretch = list(zip(u, v, w, strict=True)), np.diag(lengths)
    else:  # polar decomposition: the rotation nearest to the matrix
        left, size, right = np.linalg.svd(matrix[:3, :3])
        rotation, stretch = (left @ right).tolist(), right.T @ np.diag(size) @ right
    if _determinant(((a, b, c), (d, e, f), (g, h, i))) < 0:
        rotation = [[-x, y, z] for x, y, z in rotation]
        stretch = np.diag([-1.0, 1.0, 1.0]) @ stretch
    return np.array([x, y, z]), np.array(_quaternion(rotation)), stretch


def _determinant(rows) -> float:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)


def _dot(one, other) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def is_singular(matrix: np.ndarray) -> bool:
    """Return True when a matrix maps space to a plane, a line or a point."""
    (a, b, c, _), (d, e, f, _), (g, h, i, _), _ = rows = matrix.tolist()
    squares = sum(_dot(row, row) for row in rows[:3])
    if abs(_determinant(((a, b, c), (d, e, f), (g, h, i)))) > 1e-6 * squares**1.5:
        return False  # the smallest size is the determinant over the others, which are at most the root of `squares`
    size = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return not size[2] > 1e-6 * size[0]


def _quaternion(rotation) -> list[float]:
    (a, b, c), (d, e, f), (g, h, i) = rotation
    # The rows of 4 q qᵀ, each parallel to q; the longest loses the fewest digits.
    rows = (
        (1 + a + e + i, h - f, c - g, d - b),
        (h - f, 1 + a - e - i, b + d, c + g),
        (c - g, b + d, 1 - a + e - i, f + h),
        (d - b, c + g, f + h, 1 - a - e + i),
    )
    best = rows[max(range(4), key=lambda k: rows[k][k])]
    length = math.sqrt(sum(value * value for value in best))
    return [value / (-length if best[0] < 0 else length) for value in best]


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) rotation matrix of a unit quaternion, or (n, 3, 3) of (n, 4)."""
    w, x, y, z = (
        quaternion.tolist() if quaternion.ndim == 1 else quaternion.T
    )  # plain numbers are ten times as fast as arrays of one element
    rows = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return rows if rows.ndim == 2 else np.moveaxis(rows, 2, 0)


def pose_matrix(location: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Return the (4, 4) matrix of a pose."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(quaternion)
    matrix[:3, 3] = location
    return matrix
