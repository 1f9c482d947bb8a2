# SPDX-License-Identifier: GPL-3.0-or-later
"""A number of points spread evenly over a surface, each with the normal of the surface below it.

Many samples, as dense as the area, are divided among the points: each point has those that are nearest to it, and moves to the
middle of them (Lloyd 1982). Normals count in the distance, so that the two sides of a thin plate do not share a point. Every
island of the surface has its own points, in proportion to its area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh import TriangleMesh, face_normals, triangle_areas

SAMPLES, ROUNDS = 60, 20
"""Samples for each point, and rounds of Lloyd's algorithm: the spacing of neighbours then differs by a tenth."""
FIRST_SAMPLES = 10
"""Samples for each point among which the first points are chosen, each the farthest from all before."""
NORMAL_WEIGHT = 1.5
"""Distance for which a difference of normals of 1 counts, in spacings."""
SMOOTH = np.cos(np.radians(30.0))
"""Faces at a smaller angle are facets of a smooth surface: the normal is interpolated across their edge."""


@dataclass(frozen=True)
class EvenPoints:
    """Points on a surface.

    Attributes
    ----------
    position, normal : (n, 3) float, metres, and unit vectors
    island : (n,) int
        Number of the connected part of the surface that each point is on, the largest one first.
    without : list of (3,) float
        Centres (m) of the islands that are too small for a point.
    """

    position: np.ndarray
    normal: np.ndarray
    island: np.ndarray
    without: list[np.ndarray]


def even_points(mesh: TriangleMesh, count: int, seed: int = 0) -> EvenPoints:
    """Spread points over a surface.

    Parameters
    ----------
    mesh : TriangleMesh
    count : int
        Of the points.
    seed : int
    """
    rng, area, island = np.random.default_rng(seed), triangle_areas(mesh), islands(mesh)
    areas = np.bincount(island, weights=area)
    order = np.argsort(-areas, kind="stable")
    quota = _quotas(areas[order], count)
    parts = [_on_island(mesh, area, np.flatnonzero(island == one), n, rng) for one, n in zip(order, quota, strict=True) if n]
    number = np.repeat(np.arange(len(order)), quota)
    corners = mesh.vertices[mesh.triangles].mean(axis=1)
    without = [np.average(corners[island == one], axis=0, weights=area[island == one]) for one in order[quota == 0]]
    return EvenPoints(np.concatenate([p for p, _ in parts]), np.concatenate([n for _, n in parts]), number, without)


def islands(mesh: TriangleMesh) -> np.ndarray:
    """Return for each triangle the number of the connected part that it is in, (nt,) int; vertices at one place are one."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    place = np.unique(mesh.vertices, axis=0, return_inverse=True)[1].reshape(-1)
    a, b, c = place[mesh.triangles].T
    ones = np.ones(2 * len(a), bool)
    size = int(place.max()) + 1
    links = coo_matrix((ones, (np.concatenate([a, b]), np.concatenate([b, c]))), (size, size))
    label = connected_components(links, directed=False)[1][a]
    return np.unique(label, return_inverse=True)[1]


def _quotas(areas: np.ndarray, count: int) -> np.ndarray:
    """Return points for each island in proportion to its area, one at least while there are enough; areas are descending."""
    share = count * areas / areas.sum()
    quota = np.maximum(np.floor(share).astype(int), 0)
    if len(areas) <= count:
        quota = np.maximum(quota, 1)
    while quota.sum() != count:
        if quota.sum() < count:
            quota[int(np.argmax(share - quota))] += 1
        else:
            quota[int(np.argmax(np.where(quota > 1, quota - share, -np.inf)))] -= 1
    return quota


def _on_island(
    mesh: TriangleMesh, area: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and normals of the points on some faces."""
    from scipy.spatial import cKDTree

    total = SAMPLES * count
    face = faces[np.searchsorted(np.cumsum(area[faces]), rng.uniform(0.0, area[faces].sum(), total)).clip(max=len(faces) - 1)]
    u, v = rng.random((2, total))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    weight = np.stack([1.0 - u - v, u, v], axis=1)
    place = np.einsum("ij,ijk->ik", weight, mesh.vertices[mesh.triangles[face]])
    spacing = float(np.sqrt(area[faces].sum() / (0.87 * count)))
    features = np.hstack([place, NORMAL_WEIGHT * spacing * face_normals(mesh)[face]])
    points = features[_farthest(features[: FIRST_SAMPLES * count], count)]
    for _ in range(ROUNDS):
        owner = cKDTree(points).query(features)[1]
        held = np.bincount(owner, minlength=count)
        sums = np.stack([np.bincount(owner, weights=column, minlength=count) for column in features.T], axis=1)
        points = np.where(held[:, None] > 0, sums / np.maximum(held, 1)[:, None], points)
    chosen = cKDTree(features).query(points)[1]
    return place[chosen], _smooth_normals(mesh, face[chosen], weight[chosen])


def _farthest(features: np.ndarray, count: int) -> np.ndarray:
    """Return indices of `count` features, each the farthest from all before."""
    chosen = np.zeros(count, int)
    away = np.full(len(features), np.inf)
    for number in range(1, count):
        away = np.minimum(away, ((features - features[chosen[number - 1]]) ** 2).sum(axis=1))
        chosen[number] = int(np.argmax(away))
    return chosen


def _smooth_normals(mesh: TriangleMesh, face: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return unit normals at barycentric coordinates (n, 3) of faces (n,), interpolated where the surface is smooth."""
    normals = face_normals(mesh)
    order = np.argsort(mesh.triangles.ravel(), kind="stable")
    starts = np.searchsorted(mesh.triangles.ravel()[order], np.arange(len(mesh.vertices) + 1))
    found = np.zeros((len(face), 3))
    for row, (one, shares) in enumerate(zip(face.tolist(), weight, strict=True)):
        for vertex, share in zip(mesh.triangles[one].tolist(), shares, strict=True):
            around = normals[order[starts[vertex] : starts[vertex + 1]] // 3]
            corner = around[around @ normals[one] > SMOOTH].sum(axis=0)
            found[row] += share * corner / np.linalg.norm(corner)
    return found / np.linalg.norm(found, axis=1, keepdims=True)
