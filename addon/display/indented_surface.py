# SPDX-License-Identifier: GPL-3.0-or-later
"""The indented surface of a sensor as arrays, for the overlay: the one that :mod:`.indentation` makes of geometry nodes.

It is drawn while playing, where the scene itself must stay as it is, and after a bake in Solid view.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass, replace

import numpy as np

from ...core.geometry.smooth_mesh import SmoothMesh, smooth_mesh
from ...core.geometry.texels import Texels
from ..scene import mesh_arrays, participants
from . import indentation, materials


@dataclass(frozen=True)
class IndentedSurface:
    """Finer faces of a sensor's region, at rest.

    Attributes
    ----------
    mesh : SmoothMesh
        Of the whole object; `quads` are its faces in the region.
    quads : (m, 4) int
    used : (v,) int
        Finer vertices of the mesh that `quads` name, in their order.
    position, normal, tangent : (v, 3) float
        Between the texels as between the corners of a face; position in metres, in the frame of the sensor's body.
    rise : (v,) float, metres
        By how much at most the coarse faces, as Blender draws them in triangles, lie above `position`: that of a quad that is
        not plane is a bilinear patch.
    vertex : (n,) int
        Vertex of each texel.
    texel_normal : (n, 3) float
        Normals of the texels.
    """

    mesh: SmoothMesh
    quads: np.ndarray
    used: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray
    rise: np.ndarray
    vertex: np.ndarray
    texel_normal: np.ndarray

    def between(self, values: np.ndarray) -> np.ndarray:
        """Return (n, …) values of the texels at the finer vertices, as between the corners of a face."""
        return (self.mesh.even @ self._on_vertices(values))[self.used]

    def displaced(self, displacement: np.ndarray, touched: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the indented surface.

        Parameters
        ----------
        displacement : (n,) float, metres
            Of the texels, inwards.
        touched : (n,) bool
            Texels that may move; the others stay, where the smooth surface goes a little beyond the contact.

        Returns
        -------
        position : (v, 3) float, metres
        shade : (v,) float
            Share of a colour that is seen: one where the surface is as at rest or turned to the light, less where it is turned
            away, and at least :data:`.materials.GLOW`. The light comes from between the normal and the tangent.
        """
        inwards = self.mesh.smooth(self._on_vertices(displacement))[self.used]
        way = self.between(self.texel_normal * touched[:, None])
        position = self.position - inwards[:, None] * way
        corners = position[self.quads]
        across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normal = np.column_stack(
            [np.bincount(self.quads.ravel(), np.repeat(across[:, axis], 4), len(position)) for axis in range(3)]
        )
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        lit = np.einsum("ij,ij->i", normal, self.normal + self.tangent)
        return position, np.where(inwards > 0.0, materials.GLOW + (1.0 - materials.GLOW) * np.clip(lit, 0.0, 1.0), 1.0)

    def _on_vertices(self, values: np.ndarray) -> np.ndarray:
        values = np.asarray(values, float)
        table = np.zeros((self.mesh.even.shape[1], *values.shape[1:]))
        table[self.vertex] = values
        return table


_surfaces: dict[int, tuple[weakref.ref, IndentedSurface | None]] = {}
"""By the identity of a sensor's texels, which a run or a bake keeps in memory as long as it is shown."""


def surface_of(scene, obj, texels: Texels) -> IndentedSurface | None:
    """Return the surface of a sensor; None for a sensor without indentation (see :func:`.indentation.show`).

    Parameters
    ----------
    scene : Scene
    obj : Object or None
    texels : Texels
        Made from the object's mesh as it is now.
    """
    known = _surfaces.get(id(texels))
    if known is not None and known[0]() is texels:
        return known[1]
    for key in [key for key, (texels_of, _) in _surfaces.items() if texels_of() is None]:
        del _surfaces[key]
    made = None if obj is None or not _follows(scene, obj, texels) else _surface(obj.data, texels)
    _surfaces[id(texels)] = weakref.ref(texels), made
    return made


def _follows(scene, obj, texels: Texels) -> bool:
    if obj.type != "MESH" or obj.mode == "EDIT" or len(obj.data.vertices) <= texels.vertex.max(initial=-1):
        return False
    # As it is: bringing it up to date while playing would report changes, for which the run is dropped and computed again.
    depsgraph = participants.view_layer_of(scene).depsgraph
    return depsgraph is not None and indentation.may_indent(obj, depsgraph)


def _surface(mesh, texels: Texels) -> IndentedSurface | None:
    levels = indentation.levels_of(len(mesh.vertices))
    if not levels:
        return None
    starts = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    corners = mesh_arrays.corner_vertices(mesh)
    in_region = np.zeros(len(mesh.vertices), dtype=bool)
    in_region[texels.vertex] = True
    felt = np.logical_and.reduceat(in_region[corners], starts) if len(starts) else np.zeros(0, dtype=bool)
    fine = smooth_mesh(starts, corners, len(mesh.vertices), levels)
    used, quads = np.unique(fine.quads[felt[fine.face]], return_inverse=True)
    if not len(used):
        return None
    missing = *(np.zeros((0, 3)),) * 3, np.zeros(0)
    surface = IndentedSurface(fine, quads.reshape(-1, 4), used, *missing, texels.vertex, texels.normal)
    position, normal, tangent = (surface.between(column) for column in (texels.position, texels.normal, texels.tangent))
    corner_positions = np.zeros((len(mesh.vertices), 3))
    corner_positions[texels.vertex] = texels.position
    rise = _rise(corner_positions, starts, corners)[texels.vertex]
    return replace(surface, position=position, normal=normal, tangent=tangent, rise=surface.between(rise))


def _rise(position: np.ndarray, starts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return for each vertex by how much the triangles of its faces may lie above the patch of each face.

    Corners lie at most `out` above or below the mean plane of their face, and so do triangles and patch. Those of a quad are
    farthest apart in its middle, by `out`.

    Parameters
    ----------
    position : (nv, 3) float, metres
    starts : (nf,) int
        First corner of each face.
    corners : (nc,) int
        Vertices of the faces, one face after another.
    """
    counts = np.diff(np.append(starts, len(corners)))
    face = np.repeat(np.arange(len(starts)), counts)
    following = np.arange(1, len(corners) + 1)
    following[starts + counts - 1] = starts
    place = position[corners]
    away = place - (np.add.reduceat(place, starts) / counts[:, None])[face]
    normal = np.add.reduceat(np.cross(away, away[following]), starts)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    out = np.maximum.reduceat(np.abs(np.einsum("ij,ij->i", away, normal[face])), starts)
    rise = np.zeros(len(position))
    np.maximum.at(rise, corners, (out * np.where(counts > 4, 2.0, 1.0))[face])
    return rise
