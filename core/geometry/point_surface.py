# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles between points that lie on a surface, from the points and their normals."""

from __future__ import annotations

import numpy as np

from ..errors import SensorError

NEIGHBOURS = 20
"""Points of which each point's triangles are made. On an even pattern six are next to it; in a grid whose rows
are three times as far apart as its columns, the next rows are the seventh to twelfth."""
LONGEST_EDGE = 2.5
"""Longest edge of a triangle, in the usual distance to a fourth neighbour around it; across a gap there is no surface. 
The fourth is one step away in a square grid, and two along the rows of a grid whose rows are further apart."""


def triangles_between(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return triangles that join neighbouring points of a surface.

    Around each point its neighbours are laid into its tangent plane, and their Delaunay triangles at this point are taken
    (Gopi, Krishnan and Silva, Eurographics 2000). A triangle is kept where all three of its corners have it. Each remaining
    point gets the triangle with its two nearest neighbours.

    Parameters
    ----------
    points : (n, 3) float, metres
    normals : (n, 3) float
        Unit vectors, out of the surface.

    Returns
    -------
    (m, 3) int
        Anticlockwise seen from outside; each point is a corner of one.

    Raises
    ------
    SensorError
        There are fewer than three points, two are at one place, one is further away than can be squared, or all lie on a line.
    """
    from scipy.spatial import cKDTree

    count = len(points)
    if count < 3:
        raise SensorError(f"{count} points span no surface: a sensor has at least three texels.")
    distance, near = cKDTree(points).query(points, min(NEIGHBOURS + 1, count))
    if not np.isfinite(distance).all():
        far = int(np.abs(points).max(axis=1).argmax())
        raise SensorError(f"Texel {far} is immeasurably far from the others: check its position.")
    if distance[:, 1].min() == 0.0:
        raise SensorError(f"Texel {int(distance[:, 1].argmin())} is at the same place as another: leave one of them out.")
    reach = LONGEST_EDGE * np.median(distance[near[:, 1:], min(4, count - 1)], axis=1)
    votes: dict[tuple[int, ...], int] = {}
    for point in range(count):
        own = [other for other, far in zip(near[point, 1:], distance[point, 1:]) if far <= reach[point]]
        own = [other for other in own if normals[other] @ normals[point] > 0.0]
        for triangle in _triangles_at(points, normals[point], [point, *own]):
            votes[triangle] = votes.get(triangle, 0) + 1
    found = [triangle for triangle, number in votes.items() if number == 3]
    missing = sorted(set(range(count)) - {corner for triangle in found for corner in triangle})
    found += [tuple(sorted((point, *near[point, 1:3].tolist()))) for point in missing]
    triangles = np.array(sorted(set(found)))
    a, b, c = (points[triangles[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    if not (np.linalg.norm(across, axis=1) > 0.0).any():
        raise SensorError("All texels lie on a line: they span no surface.")
    inward = np.einsum("ij,ij->i", across, normals[triangles].sum(axis=1)) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return triangles


def _triangles_at(points: np.ndarray, normal: np.ndarray, own: list[int]) -> list[tuple[int, ...]]:
    """Return the Delaunay triangles, in a plane, that have the first of some points as a corner; corners in ascending order."""
    from scipy.spatial import Delaunay, QhullError

    if len(own) < 3:
        return []
    axis = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    axis /= np.linalg.norm(axis)
    flat = (points[own] - points[own[0]]) @ np.stack([axis, np.cross(normal, axis)], axis=1)
    # A regular grid has four points on each circle; a shear of a millionth decides alike for all of them.
    flat = flat + 1e-6 * np.column_stack([(points[own] @ [0.3, 0.5, 0.7]), (points[own] @ [0.2, -0.4, 0.6])])
    try:
        simplices = Delaunay(flat).simplices
    except QhullError:  # all on a line
        return []
    return [tuple(sorted(own[i] for i in simplex)) for simplex in simplices if 0 in simplex]
