# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices of a mesh region become texels (paper, section 3.1 and Fig. 3)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..errors import RegionError, SensorError
from .grid_layout import GridLayout, grid_layout
from .mesh import TriangleMesh, vertex_areas, vertex_normals
from .texture_maps import UVLayout, front_triangles, uv_layout

FRAME_POSITION, FRAME_NORMAL, FRAME_TANGENT = slice(0, 3), slice(3, 6), slice(6, 9)
"""Columns of :attr:`Texels.local_frames`."""

KEPT_LAYOUTS = 8
"""Layouts of texels that are kept: a scene is read again whenever something in it has changed, and mostly not its sensors."""
_last_layouts: dict[bytes, tuple[GridLayout | UVLayout, np.ndarray]] = {}
"""By a digest of what they were made of, the last one last."""


@dataclass(frozen=True)
class Texels:
    """The tactile elements of one sensor, in the frame of the sensor's body.

    Attributes
    ----------
    vertex : (n,) int
        Vertex of the sensor's mesh that each texel stands on.
    position : (n, 3) float, metres
    normal : (n, 3) float
        Unit vectors, out of the sensor: normalised sum of the unit normals of the adjoining triangles.
    tangent : (n, 3) float
        Unit vectors of the texel's x axis; its y axis is ``normal × tangent``. Along the columns where the texels form a grid.
    area : (n,) float, square metres
        A third of the area of the adjoining triangles of the region.
    layout : GridLayout or UVLayout
        Arrangement of the texels in a tactile image.
    """

    vertex: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray
    area: np.ndarray
    layout: GridLayout | UVLayout

    def __len__(self) -> int:
        return len(self.position)

    @property
    def local_frames(self) -> np.ndarray:
        """(n, 9) position (m), normal and tangent of each texel."""
        return np.hstack([self.position, self.normal, self.tangent])

    def with_local_frames(self, frames: np.ndarray) -> Texels:
        """Return the same texels with other frames, given as in :attr:`local_frames`; they are made orthonormal."""
        normal = frames[:, FRAME_NORMAL] / np.linalg.norm(frames[:, FRAME_NORMAL], axis=1, keepdims=True)
        tangent = frames[:, FRAME_TANGENT] - np.einsum("ij,ij->i", frames[:, FRAME_TANGENT], normal)[:, None] * normal
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        return replace(self, position=frames[:, FRAME_POSITION], normal=normal, tangent=tangent)

    @cached_property
    def bitangent(self) -> np.ndarray:
        """(n, 3) unit vectors of the texels' y axes."""
        return np.cross(self.normal, self.tangent)


def texels_from_region(mesh: TriangleMesh, region: np.ndarray, name: str = "sensor") -> Texels:
    """Build the texels of the vertices that `region` selects.

    Parameters
    ----------
    mesh : TriangleMesh
        The sensor's mesh, in its body's frame, metres.
    region : (nv,) bool
        True for each vertex that becomes a texel. A triangle belongs to the region when its three vertices do; normals are
        taken from *all* adjoining triangles, as the paper does, areas from those of the region only.
    name : str
        Used in error messages.

    Raises
    ------
    SensorError
        The region is empty, has no triangle, or a texel has no normal.
    """
    region = np.asarray(region, dtype=bool)
    inside = _triangles_inside(mesh, region, name)
    vertex = np.unique(mesh.triangles[inside])
    normals = vertex_normals(mesh)[vertex]
    flat = np.linalg.norm(normals, axis=1) < 0.5
    if flat.any():
        raise SensorError(
            f"Vertex {vertex[flat][0]} of sensor '{name}' has no normal, its faces cancel out: "
            "recalculate the normals or leave the vertex out."
        )
    texel = np.full(len(mesh.vertices), -1)
    texel[vertex] = np.arange(len(vertex))
    position, triangles = mesh.vertices[vertex], texel[mesh.triangles[inside]]
    quads = texel[mesh.quads[region[mesh.quads].all(axis=1)]] if mesh.quads is not None else None
    layout, along = _layout(position, normals, triangles, quads)
    return Texels(
        vertex=vertex,
        position=position,
        normal=normals,
        tangent=_tangents(along, normals),
        area=vertex_areas(mesh, inside)[vertex],
        layout=layout,
    )


def texels_with_normals(
    mesh: TriangleMesh,
    normal: np.ndarray,
    tangent: np.ndarray | None = None,
    area: np.ndarray | None = None,
    grid: tuple[np.ndarray, np.ndarray] | None = None,
) -> Texels:
    """Build a texel at every vertex of a mesh, with normals that are known.

    Parameters
    ----------
    mesh : TriangleMesh
        Texels at the corners of its triangles.
    normal : (nv, 3) float
        Unit vectors.
    tangent : (nv, 3) float, optional
        Unit vectors across the normals. Default: along the layout.
    area : (nv,) float, square metres, optional
        Default: a third of the adjoining triangles.
    grid : ((nv,) int, (nv,) int), optional
        Row and column of each texel, where they form a grid.
    """
    if grid is None:
        layout, along = _layout(mesh.vertices, normal, mesh.triangles, mesh.quads)
    else:
        row, column = grid
        layout = GridLayout(int(row.max()) + 1, int(column.max()) + 1, row, column, mesh.triangles)
        first = np.lexsort((column, row))
        along = np.tile(mesh.vertices[first[-1]] - mesh.vertices[first[-1 - int(column.max())]], (len(normal), 1))
    if area is None:
        area = vertex_areas(mesh, np.ones(len(mesh.triangles), bool))
        area = np.where(area > 0.0, area, np.median(area[area > 0.0]))
    across = _tangents(along, normal) if tangent is None else tangent
    return Texels(np.arange(len(normal)), mesh.vertices, normal, across, area, layout)


def _triangles_inside(mesh: TriangleMesh, region: np.ndarray, name: str) -> np.ndarray:
    """Return which triangles have all corners in the region, (nt,) bool; raises RegionError when none has."""
    if not region.any():
        raise RegionError(
            f"The region of sensor '{name}' is empty: select or paint all corners of at least one face, or take its role away."
        )
    inside = region[mesh.triangles].all(axis=1)
    if not inside.any():
        raise RegionError(
            f"The {np.count_nonzero(region)} vertices of sensor '{name}' span no face: "
            "select or paint all corners of at least one face."
        )
    return inside


def _layout(
    position: np.ndarray, normals: np.ndarray, triangles: np.ndarray, quads: np.ndarray | None
) -> tuple[GridLayout | UVLayout, np.ndarray]:
    """Return a grid where the texels form one, a texture map otherwise; and (n, 3) directions of the image's x axis.

    Of a region that is as it was at one of the last calls, the result is that of then. It must not be changed.
    """
    digest = hashlib.blake2b(digest_size=32)
    for array in (position, normals, triangles, quads):
        digest.update(b"" if array is None else f"{array.dtype}{array.shape}".encode() + array.tobytes())
    found = _last_layouts.pop(digest.digest(), None)
    if found is None:
        grid, along = grid_layout(position, normals, triangles, quads)
        found = uv_layout(position, normals, triangles) if grid is None or along is None else (grid, along)
    _last_layouts[digest.digest()] = found
    while len(_last_layouts) > KEPT_LAYOUTS:
        _last_layouts.pop(next(iter(_last_layouts)), None)
    return found


def _tangents(along: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return (n, 3) unit vectors: the parts of `along` that are perpendicular to the normals."""
    tangent = along - np.einsum("ij,ij->i", along, normals)[:, None] * normals
    length = np.linalg.norm(tangent, axis=1)
    parallel = length < 1e-9
    if parallel.any():  # any perpendicular direction will do, as long as it is always the same
        tangent[parallel] = np.cross(normals[parallel], np.eye(3)[np.abs(normals[parallel]).argmin(axis=1)])
        length = np.linalg.norm(tangent, axis=1)
    return tangent / length[:, None]


class DeformedTexels:
    """Texels on a mesh whose vertices move.

    Normals follow from the moved vertices. Each texel's x axis keeps its angle to the edge of the mesh that is nearest to it in
    direction.

    Parameters
    ----------
    texels : Texels
    mesh : TriangleMesh
        In the shape in which the texels were made.
    """

    def __init__(self, texels: Texels, mesh: TriangleMesh):
        self._mesh, self._vertex, self.rest_vertices = mesh, texels.vertex, mesh.vertices
        edges = mesh.triangles[:, [0, 1, 1, 2, 2, 0, 1, 0, 2, 1, 0, 2]].reshape(-1, 2)
        number = np.full(len(mesh.vertices), -1)
        number[texels.vertex] = np.arange(len(texels))
        edges = edges[number[edges[:, 0]] >= 0]
        texel = number[edges[:, 0]]
        across = _across(mesh.vertices[edges[:, 1]] - mesh.vertices[edges[:, 0]], texels.normal[texel])
        along = np.einsum("ij,ij->i", across, texels.tangent[texel])
        best = np.lexsort([-along, texel])
        first = np.searchsorted(texel[best], np.arange(len(texels)))
        chosen = best[first]
        self._other = edges[chosen, 1]
        self._cosine = along[chosen]
        self._sine = np.einsum("ij,ij->i", np.cross(texels.normal, across[chosen]), texels.tangent)

    def local_frames(self, vertices: np.ndarray, name: str) -> np.ndarray:
        """Return :attr:`Texels.local_frames` on the mesh in another shape.

        Parameters
        ----------
        vertices : (nv, 3) float, metres
        name : str
            Of the sensor, for the message.

        Raises
        ------
        SensorError
            A texel has no normal there.
        """
        normal = vertex_normals(TriangleMesh(vertices, self._mesh.triangles))[self._vertex]
        edge = _across(vertices[self._other] - vertices[self._vertex], normal)
        tangent = self._cosine[:, None] * edge + self._sine[:, None] * np.cross(normal, edge)
        bad = (np.linalg.norm(normal, axis=1) < 0.5) | (np.linalg.norm(edge, axis=1) < 0.5)
        if bad.any():
            raise SensorError(
                f"Vertex {self._vertex[bad][0]} of sensor '{name}' loses its normal as it deforms: "
                "keep its faces from collapsing."
            )
        return np.hstack([vertices[self._vertex], normal, tangent])


def _across(vectors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return unit vectors along the parts of (n, 3) vectors that are perpendicular to the normals; zero where there is none."""
    flat = vectors - np.einsum("ij,ij->i", vectors, normal)[:, None] * normal
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    return np.divide(flat, length, out=np.zeros_like(flat), where=length > 0)


HIDDEN_SHARE = 0.05
"""Share of the area that may face away in a single view; of a surface that hides more there are two."""
ONE_SIDED = 0.2
"""Length of the mean normal from which it says where outside is: 0.5 for half of a ball, 0 for a closed surface."""
APART = 0.06
"""Distance between two views, as a share of their longer side."""


@dataclass(frozen=True)
class Projection:
    """Views of texels side by side, in orthographic projection; values are linear on each triangle.

    Attributes
    ----------
    names : tuple of str
        Of the views, from left to right: the direction from which each is seen, along an axis of the sensor's body, as in
        "+Z"; a single empty string for one view along the mean normal.
    height, width : int, pixels
    pixel : (p,) int
        Pixels that show the surface, flat indices.
    corner : (p, 3) int
        Texels of the triangle in front at each of them.
    weights : (p, 3) float
        Of these texels, sum 1.
    """

    names: tuple[str, ...]
    height: int
    width: int
    pixel: np.ndarray
    corner: np.ndarray
    weights: np.ndarray

    def image(self, values: np.ndarray) -> np.ndarray:
        """Return the picture of (n,) values: (height, width) float, row 0 at the bottom, zero beside the surface."""
        picture = np.zeros(self.height * self.width)
        picture[self.pixel] = np.einsum("ij,ij->i", np.asarray(values, float)[self.corner], self.weights)
        return picture.reshape(self.height, self.width)

    def mask(self) -> np.ndarray:
        """Return (height, width) bool: which pixels show the surface."""
        mask = np.zeros(self.height * self.width, bool)
        mask[self.pixel] = True
        return mask.reshape(self.height, self.width)


def projection_of(texels: Texels, side: int) -> Projection:
    """Return the texels as seen from outside, in one view, or in two from opposite directions.

    Parameters
    ----------
    texels : Texels
        With a layout that has triangles.
    side : int, pixels
        Longer side of each view.
    """
    triangles, names, out = texels.layout.triangles, *_directions(texels)
    views = [_axes(direction) for direction in out]
    flat = texels.position @ views[0].T  # the other view is its mirror image: equally large
    low, extent = flat.min(axis=0), np.maximum(np.ptp(flat, axis=0), 1e-12)[:2]
    scale = (side - 1) / extent.max()
    width, height = (int(length) for length in np.ceil(extent * scale - 1e-9) + 1)
    step = width + round(APART * side)
    parts = []
    for number, axes in enumerate(views):
        seen = texels.position @ axes.T
        seen -= [seen[:, 0].min(), low[1], 0.0]
        corners = seen[triangles] * [scale, scale, 1.0]
        pixel, triangle, weights = front_triangles(corners, height, width)
        x, y = pixel % width + number * step, pixel // width
        parts.append((y * (step * (len(views) - 1) + width) + x, triangles[triangle], weights))
    pixel, corner, weights = (np.concatenate(part) for part in zip(*parts))
    return Projection(names, height, step * (len(views) - 1) + width, pixel, corner, weights)


def _directions(texels: Texels) -> tuple[tuple[str, ...], Sequence[np.ndarray]]:
    """Return the names of the views and the directions, (3,) each, from which they are seen."""
    weight = texels.area / max(float(texels.area.sum()), 1e-300)
    mean = weight @ texels.normal
    if np.linalg.norm(mean) > ONE_SIDED:
        out = mean / np.linalg.norm(mean)
        if weight[texels.normal @ out <= 0.0].sum() <= HIDDEN_SHARE:
            return ("",), (out,)
        axis = int(np.abs(mean).argmax())
        out = np.sign(mean[axis]) * np.eye(3)[axis]
    else:
        axis = int(np.ptp(texels.position, axis=0).argmin())  # across it there is most to see
        out = np.eye(3)[axis]
    return tuple(("+" if way[axis] > 0 else "−") + "XYZ"[axis] for way in (out, -out)), (out, -out)


def _axes(out: np.ndarray) -> np.ndarray:
    """Return (3, 3): right, up and towards the viewer; up is the body's z, or its y where it is seen along z."""
    up = np.eye(3)[2 if abs(out[2]) < 0.9 else 1]
    right = np.cross(up, out)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(out, right), out])
