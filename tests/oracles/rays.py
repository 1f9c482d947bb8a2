# SPDX-License-Identifier: GPL-3.0-or-later
"""A million segments against two independent ray libraries.

Embree (embreex) is fast and works in single precision; where its answer and ours differ by more than that can explain, and
that is a handful of segments grazing an edge, trimesh's own ray caster decides in double precision.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import trimesh
from solver_scenes import shape

from palpate.core.compiled.kernels import kernel
from palpate.core.geometry import bvh
from palpate.core.geometry.mesh import TriangleMesh, face_normals

NONE = 2.0


@kernel
def _entries(origins, vectors, tree, t, triangle):
    for i in range(len(origins)):
        o, d = origins[i], vectors[i]
        t[i], triangle[i], _ = bvh.segment_entry(bvh.Segment(o[0], o[1], o[2], d[0], d[1], d[2]), 0, -1, tree)


def entries(mesh: TriangleMesh, origins: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position of each segment's first entry (2 where there is none), and its triangle (-1)."""
    tree = bvh.build_tree([mesh])
    t, triangle = np.empty(len(origins)), np.empty(len(origins), np.int64)
    _entries(np.ascontiguousarray(origins), np.ascontiguousarray(vectors), tree, t, triangle)
    return t, np.where(triangle >= 0, tree.source[triangle], -1)


def solids() -> dict[str, TriangleMesh]:
    """Round, hollow, sharp, uneven, long and thin."""
    made = {
        "ball": trimesh.creation.icosphere(4),
        "torus": trimesh.creation.torus(1.0, 0.4, 96, 48),
        "cone": trimesh.creation.cone(0.8, 1.6, sections=200),
        "ring": trimesh.creation.annulus(0.4, 1.0, 0.8, sections=128),
        "needle": trimesh.creation.cylinder(0.02, 2.4, sections=64),
    }
    bumpy = trimesh.creation.icosphere(4)
    bumpy.vertices *= 1.0 + 0.2 * np.sin(7 * bumpy.vertices[:, :1]) * np.cos(5 * bumpy.vertices[:, 1:2])
    made["bumpy"] = bumpy
    return {name: shape(solid, name) for name, solid in made.items()}


def _random_segments(rng: np.random.Generator, mesh: TriangleMesh, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments from anywhere around or inside a solid to anywhere near its surface, and on."""
    center, size = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0)
    origins = center + rng.uniform(-0.75, 0.75, (n, 3)) * (size + 0.1 * size.max())
    corners = mesh.vertices[mesh.triangles[rng.integers(0, len(mesh.triangles), n)]]
    aims = np.einsum("nc,ncx->nx", rng.dirichlet(np.ones(3), n), corners)
    aims += rng.normal(size=(n, 3)) * 0.02 * size
    return origins, (aims - origins) * rng.uniform(0.5, 2.0, (n, 1))


def _first_entry(caster, mesh, origins, vectors) -> np.ndarray:
    """Position of the first of all hits of a ray caster that enters the surface; one in the plane of a triangle is none."""
    points, ray, triangle = caster.intersects_location(origins, vectors, multiple_hits=True)
    t = np.einsum("ij,ij->i", points - origins[ray], vectors[ray]) / np.einsum("ij,ij->i", vectors[ray], vectors[ray])
    into = np.einsum("ij,ij->i", face_normals(mesh)[triangle], vectors[ray]) < 0.0
    nearest = np.full(len(origins), NONE)
    good = into & (t <= 1.0) & (t >= 0.0)
    np.minimum.at(nearest, ray[good], t[good])
    return nearest


def compare(name: str, mesh: TriangleMesh, n: int, seed: int = 11) -> dict:
    """Ask for `n` random segments.

    Returns
    -------
    result : dict
        `met`: how many entered the solid; `doubtful`: how many Embree's single precision could not confirm; `wrong`: those of
        them in which trimesh's double precision contradicts as well; `off`: largest distance along a segment, as a share of
        it, between our entry and the plane of the triangle that Embree and we agree on.
    """
    from trimesh.ray import ray_pyembree, ray_triangle

    solid = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    fast, careful = ray_pyembree.RayMeshIntersector(solid), ray_triangle.RayMeshIntersector(solid)
    rng = np.random.default_rng([seed, len(mesh.triangles)])
    met = doubtful = wrong = 0
    off, normals = 0.0, face_normals(mesh)
    for chunk in _chunks(n, 100_000):
        origins, vectors = _random_segments(rng, mesh, chunk)
        t, triangle = entries(mesh, origins, vectors)
        expected = _first_entry(fast, mesh, origins, vectors)
        length = np.linalg.norm(vectors, axis=1)
        same = np.abs(t - expected) * length < 1e-4
        hit = triangle >= 0
        met += int(hit.sum())
        at, normal = mesh.vertices[mesh.triangles[triangle[hit], 0]], normals[triangle[hit]]
        slope = np.einsum("ij,ij->i", normal, vectors[hit])
        plane = np.einsum("ij,ij->i", normal, at - origins[hit]) / slope
        off = max(off, float((np.abs(plane - t[hit]) * np.abs(slope)).max()))
        unsure = np.flatnonzero(~same)
        doubtful += len(unsure)
        if len(unsure):
            second = _first_entry(careful, mesh, origins[unsure], vectors[unsure])
            wrong += int((np.abs(t[unsure] - second) * length[unsure] > 1e-6).sum())
    return {"name": name, "met": met, "doubtful": doubtful, "wrong": wrong, "off": off}


def _chunks(n: int, size: int) -> Iterator[int]:
    while n > 0:
        yield min(n, size)
        n -= size


def leaks(mesh: TriangleMesh, scale: float, place: np.ndarray, seed: int = 5) -> tuple[int, int]:
    """Count the segments that get through a closed solid's skin at a vertex or an edge, and all that were tried.

    Each starts outside, goes exactly through a vertex, an edge's middle or a random point of an edge, and ends inside. It
    is turned, scaled and moved first, so that every coordinate is rounded again.
    """
    rng = np.random.default_rng(seed)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    moved = TriangleMesh(scale * (mesh.vertices @ turn.T + place), mesh.triangles)
    normals = np.zeros_like(moved.vertices)
    np.add.at(normals, moved.triangles.T, face_normals(moved)[None])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = np.unique(np.sort(moved.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    ends, share = moved.vertices[edges], rng.random((len(edges), 1))
    aims = np.vstack([moved.vertices, ends.mean(axis=1), ends[:, 0] * share + ends[:, 1] * (1 - share)])
    along = normals[edges].mean(axis=1)
    out = np.vstack([normals, along, along])
    short = 0.02 * np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).min()
    out = out / np.linalg.norm(out, axis=1, keepdims=True) + 0.1 * rng.uniform(-1, 1, out.shape)
    t, _ = entries(moved, aims + short * out, -2.0 * short * out)
    return int((t == NONE).sum()), len(t)
