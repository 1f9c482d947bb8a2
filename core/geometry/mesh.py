# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes: normals, areas, mass properties, and a check for defects."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from ..errors import MeshError, ParameterError

LEAST_VOLUME = 1e-9
"""Volume in cubes of a mesh's longest side, above which a closed mesh counts as a solid: far above rounding, some 1e-16,
and far below thin solids, as a sheet of paper with 2e-4."""


@dataclass(frozen=True)
class TriangleMesh:
    """A triangulated surface, counter-clockwise from outside.

    Attributes
    ----------
    vertices : (nv, 3) float, metres
    triangles : (nt, 3) int
    quads : (nq, 4) int or None
        The mesh's four-sided faces before they were triangulated, where known; grids are recognised by them.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    quads: np.ndarray | None = None


def checked_mesh(
    vertices: np.ndarray, triangles: np.ndarray, name: str, quads: np.ndarray | None = None
) -> tuple[TriangleMesh, list[str]]:
    """Return a mesh that the solver can use, and warnings about its defects.

    Faces without area are left out, since they have no normal. Open or branching edges are allowed: a single sheet is a valid
    target, although it has no inside.

    Parameters
    ----------
    vertices : (nv, 3) float, metres
    triangles : (nt, 3) int
    name : str
        The object's name, for messages.
    quads : (nq, 4) int, optional

    Returns
    -------
    mesh : TriangleMesh
    warnings : list of str

    Raises
    ------
    MeshError
        A vertex is NaN or infinite, there is no face, or no face has an area.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64).reshape(-1, 3)
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        raise MeshError(
            f"Vertex {np.flatnonzero(~finite)[0]} of '{name}' has a NaN or infinite coordinate: "
            "delete it or check the modifier that makes it."
        )
    if len(triangles) == 0:
        raise MeshError(f"'{name}' has no faces: forces act on faces, so add some or take the object out.")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise MeshError(f"A face of '{name}' refers to a vertex that does not exist: the mesh is damaged, repair it first.")

    found = []
    mesh = TriangleMesh(vertices, triangles, quads)
    solid = have_area(mesh)
    if not solid.any():
        raise MeshError(f"All faces of '{name}' have zero area: give it a size (check its scale and shape).")
    if not solid.all():
        found.append(f"{np.count_nonzero(~solid)} faces of '{name}' have zero area and were left out.")
        mesh = TriangleMesh(vertices, np.ascontiguousarray(triangles[solid]), quads)
    open_edges, branching, flipped = edge_defects(mesh.triangles)
    if branching:
        found.append(f"{branching} edges of '{name}' join more than two faces (non-manifold): every face is used as it is.")
    if flipped:
        found.append(
            f"{flipped} edges of '{name}' join faces that point to opposite sides: recalculate the normals, "
            "faces that point away make no contact."
        )
    return mesh, found


def unique_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the edges of triangles, each once.

    Parameters
    ----------
    triangles : (nt, 3) int

    Returns
    -------
    edges : (ne, 2) int
        The lower vertex first, in lexicographic order.
    which : (nt, 3) int
        The edge from each corner of a triangle to the next.
    count : (ne,) int
        Triangles at each edge.
    """
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1), axis=-1).astype(np.int64)
    size = int(triangles.max(initial=0)) + 1
    keys, which, count = np.unique(ends[..., 0] * size + ends[..., 1], return_inverse=True, return_counts=True)
    return np.stack(np.divmod(keys, size), axis=1), which.reshape(-1, 3), count


def edge_defects(triangles: np.ndarray) -> tuple[int, int, int]:
    """Count edges with one face, with more than two faces, and between two faces of opposite orientation.

    Parameters
    ----------
    triangles : (nt, 3) int

    Returns
    -------
    open_edges, branching, flipped : int
    """
    _, which, count = unique_edges(triangles)
    along = np.bincount(which.ravel(), (triangles < np.roll(triangles, -1, axis=1)).ravel())
    return int((count == 1).sum()), int((count > 2).sum()), int(((count == 2) & (along != 1)).sum())


def is_closed(triangles: np.ndarray) -> bool:
    """True if every edge joins exactly two faces of one orientation, so that the surface has an inside."""
    return edge_defects(triangles) == (0, 0, 0)


def outward_faces(mesh: TriangleMesh, name: str) -> tuple[TriangleMesh, list[str]]:
    """Return an indenter with its faces turned outwards where it encloses a negative volume, and a warning that says so.

    Faces make contact in front only, so a solid whose faces all point inwards would press nothing.
    """
    if not is_closed(mesh.triangles):
        return mesh, []
    middle, size = _extent(mesh)
    a, b, c = _corners(TriangleMesh((mesh.vertices - middle) / size.max(), mesh.triangles))
    if np.einsum("ij,ij->", a, np.cross(b, c)) > -6.0 * LEAST_VOLUME:
        return mesh, []
    quads = None if mesh.quads is None else mesh.quads[:, ::-1]
    warning = f"The faces of '{name}' point inwards: they are taken as turned outwards, flip its normals to have them so."
    return TriangleMesh(mesh.vertices, np.ascontiguousarray(mesh.triangles[:, ::-1]), quads), [warning]


def turned_outwards(mesh: TriangleMesh, name: str) -> TriangleMesh:
    """Return the mesh of :func:`outward_faces`; Python's own warning says what it says."""
    turned, found = outward_faces(mesh, name)
    for sentence in found:
        warnings.warn(sentence, stacklevel=3)
    return turned


def _corners(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b, c = mesh.triangles.T
    return mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]


def triangle_areas(mesh: TriangleMesh) -> np.ndarray:
    """Area of each triangle, (nt,) float, m²."""
    a, b, c = _corners(mesh)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def have_area(mesh: TriangleMesh) -> np.ndarray:
    """Return which triangles have a reliable normal, (nt,) bool.

    A sliver whose height is smaller than the rounding of its coordinates has none, whatever the cross product of its edges is.
    """
    return _exceed_rounding(mesh, triangle_areas(mesh))


def _exceed_rounding(mesh: TriangleMesh, area: np.ndarray) -> np.ndarray:
    a, b, c = _corners(mesh)
    longest = np.sqrt(np.max([np.einsum("ij,ij->i", edge, edge) for edge in (b - a, c - b, a - c)], axis=0))
    scale = np.abs(mesh.vertices).max(initial=0.0) + longest.max(initial=0.0)
    return area > 1e-13 * scale * longest


def face_normals(mesh: TriangleMesh) -> np.ndarray:
    """Outward unit normal of each triangle, (nt, 3) float; zero for one without area (:func:`have_area`)."""
    a, b, c = _corners(mesh)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=_exceed_rounding(mesh, 0.5 * length[:, 0])[:, None])


def vertex_normals(mesh: TriangleMesh) -> np.ndarray:
    """Normalised sum of the unit normals of the triangles at each vertex (paper, section 3.1), (nv, 3) float.

    A vertex without triangles, or whose triangles' normals cancel, gets a zero vector.
    """
    total = np.zeros_like(mesh.vertices)
    normals = face_normals(mesh)
    for corner in range(3):
        np.add.at(total, mesh.triangles[:, corner], normals)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 1e-9)


def vertex_areas(mesh: TriangleMesh, chosen: np.ndarray) -> np.ndarray:
    """A third of the area of the chosen triangles at each vertex, (nv,) float, m².

    Parameters
    ----------
    mesh : TriangleMesh
    chosen : (nt,) bool
    """
    share = triangle_areas(mesh)[chosen] / 3.0
    return np.bincount(mesh.triangles[chosen].T.ravel(), np.tile(share, 3), len(mesh.vertices)).astype(float)


def mass_properties(mesh: TriangleMesh, mass: float, name: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Centre of mass and inertia of a solid of uniform density.

    A surface that encloses no volume is treated as a solid box of its own extent, with a warning.

    Parameters
    ----------
    mesh : TriangleMesh
    mass : float, kg
    name : str

    Returns
    -------
    center_of_mass : (3,) float, metres
    inertia : (3, 3) float, kg·m², about the centre of mass
    warnings : list of str

    Raises
    ------
    ParameterError
        The mass is not above zero.
    """
    if not (np.isfinite(mass) and mass > 0):
        raise ParameterError(f"The mass of free body '{name}' is {mass:g} kg: give it a value above zero.")
    middle, size = _extent(mesh)
    if is_closed(mesh.triangles):
        import trimesh

        # Computed about the middle and in units of the size, so that small and far objects lose no digits.
        unit = (mesh.vertices - middle) / size.max()
        properties = trimesh.triangles.mass_properties(unit[mesh.triangles])
        volume = float(properties["volume"])
        if volume > LEAST_VOLUME:
            inertia = np.asarray(properties["inertia"]) * (mass / volume) * size.max() ** 2
            center = np.asarray(properties["center_mass"]) * size.max() + middle
            return center, 0.5 * (inertia + inertia.T), []
    size = np.maximum(size, 1e-3 * size.max())
    squares = size**2
    inertia = np.diag(mass / 12.0 * (squares.sum() - squares))
    return (
        middle,
        inertia,
        [f"'{name}' is not a closed solid: its inertia was taken from a box of its size, close the mesh to have its own."],
    )


def _extent(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    corners = mesh.vertices[np.unique(mesh.triangles)]
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high), high - low
