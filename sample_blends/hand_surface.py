# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin of a hand as one mesh: a smooth union of bones with flesh around them, meshed by surface nets.

Lengths are millimetres. The field is a signed distance near the surface, negative inside.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

Field = Callable[[np.ndarray], np.ndarray]
"""Maps (n, 3) points to (n,) distances."""
ROUNDS = 6
"""Rounds in which vertices are evened out and put back onto the surface."""
_STEP = 0.02
"""Of central differences, mm."""


def tapered(chain: np.ndarray) -> Field:
    """Return the field of a chain of (m, 4) points and radii, with round ends, whose radius is linear in between."""

    def field(points: np.ndarray) -> np.ndarray:
        distance = np.full(len(points), np.inf)
        for (*start, first), (*end, second) in pairwise(chain):
            way = np.subtract(end, start)
            share = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
            apart = np.linalg.norm(points - start - share[:, None] * way, axis=1)
            distance = np.minimum(distance, apart - (1.0 - share) * first - share * second)
        return distance

    return field


def cut_off(field: Field, place, ahead) -> Field:
    """Return a field without what lies ahead of a plane."""
    return lambda points: np.maximum(field(points), (points - place) @ ahead)


def union(fields: list[Field], blend: float) -> Field:
    """Return the union of fields, which run into one another over a width in mm: a polynomial smooth minimum (Quilez 2013)."""

    def field(points: np.ndarray) -> np.ndarray:
        result = fields[0](points)
        for other in fields[1:]:
            distance = other(points)
            share = np.clip(0.5 + 0.5 * (distance - result) / blend, 0.0, 1.0)
            result = (1.0 - share) * distance + share * result - blend * share * (1.0 - share)
        return result

    return field


def surface_net(field: Field, low, high, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) and quads (m, 4) of the surface on which a field is zero (Gibson 1998).

    Parameters
    ----------
    field : Field
    low, high : (3,) float, mm
        Corners of a box that holds the surface.
    step : float, mm
        Width of the cells: each that the surface crosses has one vertex.
    """
    low = np.asarray(low, float)
    shape = np.ceil((np.asarray(high) - low) / step).astype(int) + 1
    grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    inside = (field((low + step * grid).reshape(-1, 3)) < 0.0).reshape(shape)
    corners = [inside[i : shape[0] - 1 + i, j : shape[1] - 1 + j, k : shape[2] - 1 + k] for i, j, k in np.ndindex(2, 2, 2)]
    crossed = np.any(corners, axis=0) & ~np.all(corners, axis=0)
    number = np.full(crossed.shape, -1)
    number[crossed] = np.arange(crossed.sum())
    quads = np.concatenate([_quads(inside, number, axis) for axis in range(3)])
    vertices = low + step * (np.argwhere(crossed) + 0.5)
    neighbours = np.concatenate([quads[:, [i, (i + 1) % 4]] for i in range(4)])
    for _ in range(ROUNDS):
        vertices = onto_surface(field, _evened(vertices, neighbours), step)
    return vertices, quads


def onto_surface(field: Field, points: np.ndarray, most: float) -> np.ndarray:
    """Return points moved towards the surface by a Newton step of at most a length in mm."""
    slope = gradient(field, points)
    move = field(points) / np.maximum((slope**2).sum(axis=1), 0.1)
    length = np.abs(move) * np.linalg.norm(slope, axis=1)
    return points - (move * np.minimum(1.0, most / np.maximum(length, 1e-9)))[:, None] * slope


def gradient(field: Field, points: np.ndarray) -> np.ndarray:
    """Return the gradient of a field at (n, 3) points."""
    steps = _STEP * np.eye(3)
    return np.stack([field(points + step) - field(points - step) for step in steps], axis=1) / (2.0 * _STEP)


def _quads(inside: np.ndarray, number: np.ndarray, axis: int) -> np.ndarray:
    """Return the quads around the edges of the grid along an axis that the surface crosses, (m, 4), facing outwards."""
    one, other = (axis + 1) % 3, (axis + 2) % 3
    first = np.take(inside, range(inside.shape[axis] - 1), axis)
    second = np.take(inside, range(1, inside.shape[axis]), axis)
    edges = np.argwhere(first != second)
    leaving = first[tuple(edges.T)]
    corners = []
    for back_one, back_other in ((1, 1), (0, 1), (0, 0), (1, 0)):
        cell = edges.copy()
        cell[:, one] -= back_one
        cell[:, other] -= back_other
        corners.append(number[tuple(cell.T)])
    quads = np.stack(corners, axis=1)
    quads[~leaving] = quads[~leaving][:, ::-1]
    return quads


def _evened(vertices: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    """Return vertices moved half of the way to the mean of their neighbours."""
    total, count = np.zeros_like(vertices), np.zeros(len(vertices))
    for a, b in (neighbours.T, neighbours.T[::-1]):
        np.add.at(total, a, vertices[b])
        np.add.at(count, a, 1.0)
    return 0.5 * vertices + 0.5 * total / count[:, None]
