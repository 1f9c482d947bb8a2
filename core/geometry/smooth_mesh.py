# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth values on any mesh: the faces subdivided as Catmull and Clark do, with the values corrected as on a grid.

:mod:`.smooth_grid` is the same surface on rows and columns, in closed form. The indented surface of a baked sensor is made of
Blender's nodes for the same subdivision; this module is for what is drawn without them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .smooth_grid import blur_matrix, sharpened_by

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


@dataclass(frozen=True)
class SmoothMesh:
    """The subdivided faces of a mesh, and how its vertices' values become values at the finer vertices.

    Attributes
    ----------
    quads : (m, 4) int
        Finer faces, by finer vertices.
    face : (m,) int
        The face of the mesh of which each is a part.
    even : (v, nv) csr_matrix
        Weights of the mesh's vertices where faces are cut evenly: of positions and colours.
    limit : (v, nv) csr_matrix
        Weights of the sharpened values on the limit surface of the subdivision.
    blur : (nv, nv) csr_matrix
        Mean of each vertex and its neighbours.
    """

    quads: np.ndarray
    face: np.ndarray
    even: Any
    limit: Any
    blur: Any

    def smooth(self, values: np.ndarray) -> np.ndarray:
        """Return (nv,) values at the finer vertices, (v,) float: smooth, near the given ones, and nowhere negative.

        What is below zero is a depth without contact and counts as none.
        """
        values = np.maximum(np.asarray(values, float), 0.0)
        return np.maximum(self.limit @ sharpened_by(self.blur, values), 0.0)


def smooth_mesh(starts: np.ndarray, corners: np.ndarray, count: int, levels: int) -> SmoothMesh:
    """Subdivide the faces of a mesh.

    Parameters
    ----------
    starts : (nf,) int
        Place of each face's first corner in `corners`.
    corners : (nc,) int
        Vertices at the corners of the faces, in order around each face.
    count : int
        Number of vertices.
    levels : int
        One or more: a quad becomes ``4 ** levels`` quads, and a face of n corners n times ``4 ** (levels - 1)``.

    Returns
    -------
    SmoothMesh

    Notes
    -----
    Catmull and Clark, Computer-Aided Design 10 (1978) 350. Borders follow the cubic B-spline through their own vertices,
    corners included; the last vertices are moved to the limit surface (Halstead, Kass and DeRose, SIGGRAPH 1993).
    """
    from scipy.sparse import identity

    starts, corners = np.asarray(starts, np.int64), np.asarray(corners, np.int64)
    blur = blur_matrix(_Topology.of(starts, corners, count).ends, count)
    face = np.arange(len(starts))
    even = limit = identity(count, format="csr")
    for _ in range(levels):
        topology = _Topology.of(starts, corners, even.shape[0])
        step_even, step_smooth = _even_step(topology), _smooth_step(topology)
        even, limit = step_even @ even, step_smooth @ limit
        face = face[topology.face]
        quads = _quads(topology)
        starts, corners = 4 * np.arange(len(quads)), quads.ravel()
    limit = _limit_step(_Topology.of(starts, corners, even.shape[0])) @ limit
    return SmoothMesh(corners.reshape(-1, 4), face, even.tocsr(), limit.tocsr(), blur)


@dataclass(frozen=True)
class _Topology:
    """Corners of faces and the edges that begin at them.

    Attributes
    ----------
    vertex, face, edge, before : (nc,) int
        Of each corner: its vertex, its face, the edge to the next corner, and the edge from the corner before.
    ends : (ne, 2) int
        Vertices of the edges.
    sides : (ne,) int
        Number of faces at each edge.
    count, faces : int
        Number of vertices and of faces.
    """

    vertex: np.ndarray
    face: np.ndarray
    edge: np.ndarray
    before: np.ndarray
    ends: np.ndarray
    sides: np.ndarray
    count: int
    faces: int

    @classmethod
    def of(cls, starts: np.ndarray, corners: np.ndarray, count: int) -> _Topology:
        sizes = np.diff(np.append(starts, len(corners)))
        face = np.repeat(np.arange(len(starts)), sizes)
        following = np.arange(1, len(corners) + 1)
        following[starts + sizes - 1] = starts
        previous = np.empty_like(following)
        previous[following] = np.arange(len(corners))
        pairs = np.sort(np.column_stack([corners, corners[following]]), axis=1)
        ends, edge, sides = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        edge = edge.ravel()
        return cls(corners, face, edge, edge[previous], ends, sides, count, len(starts))


def _even_step(topology: _Topology) -> csr_matrix:
    """Return weights that keep the vertices, and put new ones into the middle of edges and of faces."""
    from scipy.sparse import identity, vstack

    return vstack([identity(topology.count), _edge_middles(topology), _face_middles(topology)], format="csr")


def _smooth_step(topology: _Topology) -> csr_matrix:
    """Return the weights of Catmull and Clark: new places of the vertices, then those of edges and of faces."""
    from scipy.sparse import diags, vstack

    edges, faces = _edge_middles(topology), _face_middles(topology)
    beside = _table(topology.edge, topology.face, 1.0, (len(topology.ends), topology.faces))
    inner = (topology.sides == 2).astype(float)
    smooth_edges = diags(1.0 - 0.5 * inner) @ edges + diags(0.25 * inner) @ beside @ faces
    own, neighbours, is_inner, is_border = _around(topology)
    valence = np.maximum(own, 1.0)
    at_faces = _table(topology.vertex, topology.face, 1.0, (topology.count, topology.faces))
    at_edges = _at_edges(topology)
    # inside: the mean of faces, twice the mean of the edges' middles, and (n − 3) times the vertex, over n
    inside = diags(is_inner / valence**2) @ (at_faces @ faces + 2.0 * at_edges @ edges)
    kept = np.where(is_inner > 0.0, (own - 3.0) / valence, np.where(is_border > 0.0, 0.75, 1.0))
    border = diags(0.125 * is_border) @ neighbours
    return vstack([diags(kept) + inside + border, smooth_edges, faces], format="csr")


def _limit_step(topology: _Topology) -> csr_matrix:
    """Return the weights that move the vertices of a mesh of quads to the limit surface."""
    from scipy.sparse import diags

    own, neighbours, is_inner, is_border = _around(topology)
    faces = _face_middles(topology)
    at_faces = _table(topology.vertex, topology.face, 1.0, (topology.count, topology.faces))
    at_edges = _at_edges(topology)
    whole = np.maximum(own * (own + 5.0), 1.0)
    # n² of the vertex, four of each neighbour and one of each opposite corner: a face's sum is itself, two neighbours and it
    ring = 4.0 * at_faces @ faces + 4.0 * at_edges @ _edge_middles(topology)
    inside = diags(is_inner / whole) @ ring
    kept = np.where(is_inner > 0.0, (own * own - 3.0 * own) / whole, np.where(is_border > 0.0, 2.0 / 3.0, 1.0))
    return (diags(kept) + inside + diags(is_border / 6.0) @ neighbours).tocsr()


def _around(topology: _Topology) -> tuple[np.ndarray, csr_matrix, np.ndarray, np.ndarray]:
    """Return the number of edges at each vertex, the sum over neighbours along borders, and which vertices are which.

    A vertex is inner when each of its edges has two faces, and on the border when just two of its edges have one face and the
    others two. Any other vertex, as where sheets meet, keeps its place.
    """
    ends = topology.ends
    own = np.bincount(ends.ravel(), minlength=topology.count).astype(float)
    rims, odd = topology.sides == 1, topology.sides > 2
    at_rim = np.bincount(ends[rims].ravel(), minlength=topology.count)
    at_odd = np.bincount(ends[odd].ravel(), minlength=topology.count)
    is_inner = (own > 0) & (at_rim == 0) & (at_odd == 0)
    is_border = (at_rim == 2) & (at_odd == 0)
    first, second = ends[rims].T
    shape = (topology.count, topology.count)
    neighbours = _table(np.append(first, second), np.append(second, first), 1.0, shape)
    return own, neighbours, is_inner.astype(float), is_border.astype(float)


def _edge_middles(topology: _Topology) -> csr_matrix:
    rows = np.repeat(np.arange(len(topology.ends)), 2)
    return _table(rows, topology.ends.ravel(), 0.5, (len(topology.ends), topology.count))


def _face_middles(topology: _Topology) -> csr_matrix:
    sizes = np.bincount(topology.face, minlength=topology.faces)
    return _table(topology.face, topology.vertex, 1.0 / sizes[topology.face], (topology.faces, topology.count))


def _at_edges(topology: _Topology) -> csr_matrix:
    columns = np.repeat(np.arange(len(topology.ends)), 2)
    return _table(topology.ends.ravel(), columns, 1.0, (topology.count, len(topology.ends)))


def _table(rows: np.ndarray, columns: np.ndarray, values: np.ndarray | float, shape: tuple[int, int]) -> csr_matrix:
    from scipy.sparse import csr_matrix

    return csr_matrix((np.broadcast_to(values, len(rows)), (rows, columns)), shape=shape)


def _quads(topology: _Topology) -> np.ndarray:
    """Return the finer faces, (nc, 4): one at each corner, from its vertex over the edge after it and the face's middle."""
    edges, faces = topology.count, topology.count + len(topology.ends)
    return np.column_stack([topology.vertex, edges + topology.edge, faces + topology.face, edges + topology.before])
