# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles between points that lie on a surface, from the points and their normals."""

from __future__ import annotations

import numpy as np

from ..errors import SensorError

NEIGHBOURS = 20
"""Points of which each point's triangles are made. On an even pattern six are next to it; in a grid whose rows
are three times as far apart as its columns, the next rows are the seventh to twelfth."""
FLAT_ENOUGH = 0.3
"""Cosine between each normal and their mean from which on the points are joined in one plane."""
LEAST_SINE = 0.1
"""Of the angle between the sides of a triangle that a point gets which has none."""
LONGEST_EDGE = 2.5
"""Longest edge of a triangle, in the usual distance to a fourth neighbour around it; across a gap there is no surface. 
The fourth is one step away in a square grid, and two along the rows of a grid whose rows are further apart."""


def triangles_between(points: np.ndarray, normals: np.ndarray, island: np.ndarray | None = None) -> np.ndarray:
    """Return triangles that join neighbouring points of a surface.

    Around each point its neighbours are laid into its tangent plane, and their Delaunay triangles at this point are taken
    (Gopi, Krishnan and Silva, Eurographics 2000). A triangle is kept where all three of its corners have it. Each remaining
    point gets the triangle with its two nearest neighbours.

    Parameters
    ----------
    points : (n, 3) float, metres
    normals : (n, 3) float
        Unit vectors, out of the surface.
    island : (n,) int, optional
        Number of the part of the surface that each point is on: only points of one part are joined, if it has three.

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
    mean = normals.mean(axis=0) / max(float(np.linalg.norm(normals.mean(axis=0))), 1e-12)
    if (normals @ mean).min() > FLAT_ENOUGH:  # one plane sees all of the surface, and decides alike for all points
        found = _triangles_in_plane(points, mean, reach)
    else:
        found = _triangles_by_votes(points, normals, distance, near, reach)
    if island is not None:
        found = [triangle for triangle in found if len({int(island[corner]) for corner in triangle}) == 1]
    missing = sorted(set(range(count)) - {corner for triangle in found for corner in triangle})
    found += [_nearest_triangle(points, point, near[point, 1:]) for point in missing]
    triangles = np.array(sorted(set(found)))
    a, b, c = (points[triangles[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    if not (np.linalg.norm(across, axis=1) > 0.0).any():
        raise SensorError("All texels lie on a line: they span no surface.")
    inward = np.einsum("ij,ij->i", across, normals[triangles].sum(axis=1)) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return triangles


def _triangles_by_votes(
    points: np.ndarray, normals: np.ndarray, distance: np.ndarray, near: np.ndarray, reach: np.ndarray
) -> list[tuple[int, ...]]:
    """Return the triangles that all of their corners have among the Delaunay triangles of their own tangent plane."""
    votes: dict[tuple[int, ...], int] = {}
    for point in range(len(points)):
        own = [other for other, far in zip(near[point, 1:], distance[point, 1:]) if far <= reach[point]]
        own = [other for other in own if normals[other] @ normals[point] > 0.0]
        for triangle in _triangles_at(points, normals[point], [point, *own]):
            votes[triangle] = votes.get(triangle, 0) + 1
    return [triangle for triangle, number in votes.items() if number == 3]


def _triangles_in_plane(points: np.ndarray, normal: np.ndarray, reach: np.ndarray) -> list[tuple[int, ...]]:
    """Return the Delaunay triangles across a direction whose edges are not longer than the reach of both of their ends."""
    flat = _flattened(points, normal, points[0])
    simplices = _delaunay(flat)
    ends = simplices[:, [[0, 1], [1, 2], [2, 0]]]
    length = np.linalg.norm(points[ends[:, :, 0]] - points[ends[:, :, 1]], axis=2)
    a, b, c = (flat[simplices[:, i]] for i in range(3))
    doubled = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    kept = (length <= reach[ends].min(axis=2)).all(axis=1)
    kept &= doubled > LEAST_SINE * length.max(axis=1) * length.min(axis=1)  # none along a straight border
    return [tuple(sorted(simplex)) for simplex in simplices[kept].tolist()]


def _nearest_triangle(points: np.ndarray, point: int, near: np.ndarray) -> tuple[int, ...]:
    """Return the triangle of a point with its nearest neighbour and the nearest one that is not in line with both."""
    first, rest = int(near[0]), near[1:].tolist()
    along = points[first] - points[point]
    for other in rest:
        side = points[other] - points[point]
        if np.linalg.norm(np.cross(along, side)) > LEAST_SINE * np.linalg.norm(along) * np.linalg.norm(side):
            return tuple(sorted((point, first, other)))
    return tuple(sorted((point, first, rest[0])))


def _triangles_at(points: np.ndarray, normal: np.ndarray, own: list[int]) -> list[tuple[int, ...]]:
    """Return the Delaunay triangles, in a plane, that have the first of some points as a corner; corners in ascending order."""
    if len(own) < 3:
        return []
    simplices = _delaunay(_flattened(points[own], normal, points[own[0]]))
    return [tuple(sorted(own[i] for i in simplex)) for simplex in simplices if 0 in simplex]


def _delaunay(flat: np.ndarray) -> np.ndarray:
    """Return the Delaunay triangles of points in a plane, (m, 3) int."""
    from scipy.spatial import Delaunay, QhullError

    try:
        return np.asarray(Delaunay(flat).simplices)
    except QhullError:  # all on a line
        return np.zeros((0, 3), int)


def _flattened(points: np.ndarray, normal: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Return coordinates in the plane across a normal, (n, 2) metres."""
    axis = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    axis /= np.linalg.norm(axis)
    flat = (points - origin) @ np.stack([axis, np.cross(normal, axis)], axis=1)
    # A regular grid has four points on each circle; a shear of a millionth decides alike for all of them.
    sheared: np.ndarray = flat + 1e-6 * np.column_stack([points @ [0.3, 0.5, 0.7], points @ [0.2, -0.4, 0.6]])
    return sheared
