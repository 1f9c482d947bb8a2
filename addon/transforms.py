# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's matrices and the solver's poses.

A body's frame has the location and rotation of its object; what else is in the matrix, scale and shear, is its *stretch*
and goes into the vertices: ``matrix = translation · rotation · stretch``.
"""

from __future__ import annotations

import numpy as np

SHEAR = 1e-5
"""Cosine between two axes of a matrix above which it counts as sheared; a 32-bit rotation matrix stays below 1e-6."""


def array(matrix) -> np.ndarray:
    """(4, 4) float64 of a mathutils Matrix."""
    return np.array(matrix, dtype=float)


def split(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Take a matrix apart.

    Parameters
    ----------
    matrix : (4, 4) float
        Not singular.

    Returns
    -------
    location : (3,) float, Blender units
    quaternion : (4,) float, (w, x, y, z)
    stretch : (3, 3) float
        Diagonal unless the matrix is sheared; of negative determinant where the matrix mirrors.
    """
    linear = matrix[:3, :3]
    lengths = np.linalg.norm(linear, axis=0)
    axes = linear / lengths
    if np.abs(axes.T @ axes - np.eye(3)).max() < SHEAR:
        rotation, stretch = axes, np.diag(lengths)
    else:  # polar decomposition: the rotation nearest to the matrix
        left, size, right = np.linalg.svd(linear)
        rotation, stretch = left @ right, right.T @ np.diag(size) @ right
    if np.linalg.det(linear) < 0:  # as Blender does: mirror all three axes
        rotation, stretch = -rotation, -stretch
    return matrix[:3, 3].copy(), quaternion(rotation), stretch


def is_singular(matrix: np.ndarray) -> bool:
    """Whether a matrix flattens what it moves."""
    size = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return not size[2] > 1e-6 * size[0]


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """(4,) unit quaternion with w ≥ 0 of a (3, 3) rotation matrix."""
    m = rotation
    four = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [0.0, m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [0.0, 0.0, m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [0.0, 0.0, 0.0, m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    # 4 q qᵀ = I + this symmetric matrix, so every row is parallel to q; the longest loses the fewest digits.
    outer = four + np.triu(four, 1).T + np.eye(4)
    best = outer[np.argmax(np.diag(outer))]
    result = best / np.linalg.norm(best)
    return -result if result[0] < 0 else result


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) rotation matrix of a unit quaternion."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rigid(location: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """(4, 4) matrix of a pose."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(quaternion)
    matrix[:3, 3] = location
    return matrix
