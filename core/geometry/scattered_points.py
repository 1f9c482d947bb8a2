# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels spread evenly over a region without rows: a relaxed Poisson-disk pattern ("blue noise").

The region is cut into small triangles; their corners, in random order, become texels where no other is near; each texel then
moves to the middle of the part of the region that is nearest to it, a few times (Lloyd 1982); parts that meet in a point are
joined by a face. Distances are straight, but growth
follows the surface, so that the two sides of a thin finger do not affect each other.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np

from ..errors import SensorError
from .mesh import TriangleMesh, face_normals, triangle_areas, unique_edges
from .texel_arrays import TexelMesh, mesh_of_faces, nearest_point

# A number of points spread evenly over a surface, each with the normal of the surface below it.
#
# Many samples, as dense as the area, are divided among the points: each point has those that are nearest to it, and moves to
# the middle of them (Lloyd 1982). Normals count in the distance, so that the two sides of a thin plate do not share a point.
# Every island of the surface has its own points, in proportion to its area.

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
    meeting, found = _triangles_at(mesh), np.zeros((len(face), 3))
    for row, (one, shares) in enumerate(zip(face.tolist(), weight, strict=True)):
        for vertex, share in zip(mesh.triangles[one].tolist(), shares, strict=True):
            around = normals[meeting[vertex]]
            corner = around[around @ normals[one] > SMOOTH].sum(axis=0)
            found[row] += share * corner / np.linalg.norm(corner)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


FINENESS = 5.0
"""Small triangles per spacing."""
RADIUS = 0.84
"""Radius of the discs as a share of the spacing. After relaxation, neighbours are then about one spacing apart."""
RELAXATIONS = 6
"""How often each texel moves to the middle of its part of the region. On a box, a ball and a rectangle the smallest spacing is
0.78, 0.85 and 0.74 of the mean spacing after 6 rounds, and the same after 12 and 20; on the rectangle it is 0.73 after 3."""
MOST = 60_000
"""Texels at the most; more would take minutes."""


def scatter(mesh: TriangleMesh, spacing: float, seed: int = 0) -> TexelMesh:
    """Spread texels over a region.

    Parameters
    ----------
    mesh : TriangleMesh
        The region, metres.
    spacing : float, metres
        Usual distance between neighbours.
    seed : int
        Each seed gives another pattern.

    Raises
    ------
    SensorError
        The spacing is too large for a single face, or so small that there would be more than :data:`MOST` texels.
    """
    if not spacing > 0:
        raise SensorError(f"The spacing of texels is {spacing * 1e3:g} mm: give a length above zero.")
    expected = float(triangle_areas(mesh).sum()) / (0.87 * spacing**2)
    if expected > MOST:
        raise SensorError(
            f"A spacing of {spacing * 1e3:g} mm makes about {expected:.0f} texels: give a larger one, {MOST} are the most."
        )
    fine = refined(mesh, spacing / FINENESS)
    links = _links(fine)
    weight = np.bincount(fine.triangles.ravel(), np.repeat(triangle_areas(fine) / 3.0, 3), len(fine.vertices))  # of area
    sites = _discs(fine.vertices, links, RADIUS * spacing, np.random.default_rng(seed))
    points = fine.vertices[sites]
    for _ in range(RELAXATIONS):
        owner = _nearest(fine.vertices, links, points, sites)
        middle, sites = _centres(fine.vertices, weight, owner, len(sites))
        points = fine.vertices[sites]
    points = _on_surface(fine, middle, sites)
    owner = _nearest(fine.vertices, links, points, sites)
    faces = _duals(fine.triangles, owner)
    if not len(faces):
        raise SensorError(f"No three texels {spacing * 1e3:g} mm apart fit into the region: use a smaller spacing.")
    return mesh_of_faces(points, faces)


def refined(mesh: TriangleMesh, longest: float) -> TriangleMesh:
    """Split the triangles of a mesh until no edge is longer than `longest`; triangles at an edge are split alike.

    Parameters
    ----------
    mesh : TriangleMesh
    longest : float, metres
    """
    used, triangles = np.unique(mesh.triangles, return_inverse=True)
    vertices, triangles = mesh.vertices[used], triangles.reshape(-1, 3)
    while True:
        edges, which, _ = unique_edges(triangles)
        long = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1) > longest
        if not long.any():
            return TriangleMesh(vertices, triangles)
        middle = np.where(long, len(vertices) + np.cumsum(long) - 1, -1)
        vertices = np.vstack([vertices, vertices[edges[long]].mean(axis=1)])
        triangles = _split(triangles, middle[which])


def _split(triangles: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Cut triangles at the middles of their edges; −1 in `middle` (m, 3) is an edge that stays whole."""
    count = (middle >= 0).sum(axis=1)
    parts = [triangles[count == 0]]
    for turn in range(3):  # rotate the corners so that the edge that decides comes first
        a, b, c = np.roll(triangles, -turn, axis=1).T
        ab, bc, ca = np.roll(middle, -turn, axis=1).T
        one = (count == 1) & (ab >= 0)
        parts += [np.stack([a, ab, c], axis=1)[one], np.stack([ab, b, c], axis=1)[one]]
        two = (count == 2) & (ca < 0)
        parts += [
            np.stack([ab, b, bc], axis=1)[two],
            np.stack([a, ab, bc], axis=1)[two],
            np.stack([a, bc, c], axis=1)[two],
        ]
        if turn == 0:
            three = count == 3
            for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)):
                parts.append(np.stack(corners, axis=1)[three])
    return np.concatenate(parts)


def _links(mesh: TriangleMesh) -> list[list[int]]:
    """Neighbours of each vertex."""
    edges, _, _ = unique_edges(mesh.triangles)
    ends = edges[:, ::-1].T.ravel()
    return [ends[which].tolist() for which in _grouped(edges.T.ravel(), len(mesh.vertices))]


def _triangles_at(mesh: TriangleMesh) -> list[np.ndarray]:
    """Triangles at each vertex."""
    return [which // 3 for which in _grouped(mesh.triangles.ravel(), len(mesh.vertices))]


def _grouped(numbers: np.ndarray, count: int) -> list[np.ndarray]:
    """Return for each number below `count` the places, ascending, where it is among `numbers`."""
    order = np.argsort(numbers, kind="stable")
    return np.split(order, np.searchsorted(numbers[order], np.arange(1, count)))


def _discs(vertices: np.ndarray, links: list[list[int]], radius: float, rng: np.random.Generator) -> np.ndarray:
    """Choose vertices in random order, none within `radius` of another as far as the surface in between goes."""
    free, places = [True] * len(vertices), vertices.tolist()
    chosen = []
    for start in rng.permutation(len(vertices)).tolist():
        if not free[start]:
            continue
        chosen.append(start)
        free[start] = False
        reached, front = {start}, [start]
        while front:
            here = front.pop()
            for other in links[here]:
                if other not in reached and math.dist(places[other], places[start]) < radius:
                    reached.add(other)
                    free[other] = False
                    front.append(other)
    return np.array(chosen)


def _nearest(vertices: np.ndarray, links: list[list[int]], points: np.ndarray, sites: np.ndarray) -> np.ndarray:
    """(nv,) int: which point each vertex is nearest to; every part is connected and holds its site."""
    owner = [-1] * len(vertices)
    places, targets = vertices.tolist(), points.tolist()
    heap = [(0.0, int(site), number) for number, site in enumerate(sites)]
    heapq.heapify(heap)
    while heap:
        _, here, number = heapq.heappop(heap)
        if owner[here] >= 0:
            continue
        owner[here] = number
        for other in links[here]:
            if owner[other] < 0:
                heapq.heappush(heap, (math.dist(places[other], targets[number]), other, number))
    return np.array(owner)


def _centres(vertices: np.ndarray, weight: np.ndarray, owner: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres of area of the parts, (count, 3), and the vertex of each part that is nearest to it, (count,)."""
    there = owner >= 0
    total = np.bincount(owner[there], weights=weight[there], minlength=count)
    middle = np.stack(
        [np.bincount(owner[there], weights=(weight * vertices[:, i])[there], minlength=count) / total for i in range(3)], axis=1
    )
    distance = np.where(there, np.linalg.norm(vertices - middle[owner], axis=1), np.inf)
    order = np.lexsort((distance, owner))
    return middle, order[np.searchsorted(owner[order], np.arange(count))]


def _on_surface(mesh: TriangleMesh, points: np.ndarray, sites: np.ndarray) -> np.ndarray:
    """(n, 3) float: points moved onto the triangles around the vertices that they are nearest to."""
    meeting = _triangles_at(mesh)
    around = (TriangleMesh(mesh.vertices, mesh.triangles[meeting[site]]) for site in sites)
    return np.array([nearest_point(near, point)[0] for near, point in zip(around, points)])


def _duals(triangles: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(m, 3) int: faces between parts of which three meet in a small triangle, each once, wound like it."""
    labels = owner[triangles]
    meet = (labels[:, 0] != labels[:, 1]) & (labels[:, 1] != labels[:, 2]) & (labels[:, 2] != labels[:, 0])
    labels = labels[meet & (labels >= 0).all(axis=1)]
    if not len(labels):
        return labels
    first = np.argmin(labels, axis=1)
    labels = np.take_along_axis(labels, (first[:, None] + np.arange(3)) % 3, axis=1)
    faces, count = np.unique(labels, axis=0, return_counts=True)
    # Two windings of one face, or a third face on an edge, come from parts that touch twice: the rarer one goes.
    order = np.argsort(-count, kind="stable")
    kept: list[tuple[int, int, int]] = []
    taken: set[tuple[int, int]] = set()
    for a, b, c in faces[order].tolist():
        directed = {(a, b), (b, c), (c, a)}
        if not directed & taken:
            taken |= directed
            kept.append((a, b, c))
    return np.array(kept)
