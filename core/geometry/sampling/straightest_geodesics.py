# SPDX-License-Identifier: GPL-3.0-or-later
"""Straightest geodesics on a triangulated surface (Polthier and Schmies 1998).

A line crosses an edge as if both triangles lay in one plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh import TriangleMesh, face_normals

NUDGE = 1e-9
"""Share of an edge by which a line that would meet a corner is moved aside."""


@dataclass(frozen=True)
class SurfacePose:
    """A point on a surface and a direction within the surface there.

    Attributes
    ----------
    triangle : int
    point : (3,) float
    heading : (3,) float
        Unit vector in the plane of the triangle.
    """

    triangle: int
    point: np.ndarray
    heading: np.ndarray

    def turned(self, normal: np.ndarray, angle: float) -> SurfacePose:
        """Return the same point with the heading turned anticlockwise, seen from outside."""
        across = np.cross(normal, self.heading)
        return SurfacePose(self.triangle, self.point, np.cos(angle) * self.heading + np.sin(angle) * across)


class GeodesicTracer:
    """Follows straightest geodesics on a surface.

    Parameters
    ----------
    mesh : TriangleMesh
        All triangles have one orientation. Lines end at edges that do not join two triangles.
    """

    def __init__(self, mesh: TriangleMesh):
        self.mesh = mesh
        self.normals = face_normals(mesh)
        corners = mesh.vertices[mesh.triangles]
        edges = np.roll(corners, -1, axis=1) - corners
        self._edge_length = np.linalg.norm(edges, axis=2)
        self._along = edges / np.where(self._edge_length > 0, self._edge_length, 1.0)[..., None]
        self._outward = np.cross(self._along, self.normals[:, None])
        self._rim = np.einsum("tej,tej->te", corners, self._outward)
        self._across: dict[tuple[int, int], list[int]] = {}
        for number, (a, b, c) in enumerate(mesh.triangles.tolist()):
            for edge in ((a, b), (b, c), (c, a)):
                self._across.setdefault((min(edge), max(edge)), []).append(number)

    def nearest_pose(self, point: np.ndarray, heading: np.ndarray) -> SurfacePose:
        """Return the point of the surface that is nearest to `point`, with the nearest direction along it.

        Parameters
        ----------
        point, heading : (3,) float
        """
        nearest, triangle = nearest_point(self.mesh, point)
        normal = self.normals[triangle]
        along = heading - (heading @ normal) * normal
        if np.linalg.norm(along) < 1e-6 * np.linalg.norm(heading):  # it stands on the surface: any direction will do
            along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        return SurfacePose(triangle, nearest, along / np.linalg.norm(along))

    def trace(self, start: SurfacePose, length: float) -> SurfacePose | None:
        """Return the pose at the end of a line of this length (metres); None when the surface ends before."""
        here, left = start, length
        for _ in range(4 * len(self.mesh.triangles) + 16):
            step, edge = self._exit(here)
            if left <= step:
                return SurfacePose(here.triangle, here.point + left * here.heading, here.heading)
            after = self._cross(here, here.point + step * here.heading, edge)
            if after is None:
                return None
            here, left = after, left - step
        return None

    def _exit(self, here: SurfacePose) -> tuple[float, int]:
        """Return the distance to the border of the triangle and the edge that is met there."""
        outward = self._outward[here.triangle]
        speed = outward @ here.heading
        left = self._rim[here.triangle] - outward @ here.point
        distance = np.where(speed > 1e-12, np.maximum(left, 0.0) / np.maximum(speed, 1e-12), np.inf)
        edge = int(np.argmin(distance))
        return float(distance[edge]), edge

    def _cross(self, here: SurfacePose, point: np.ndarray, edge: int) -> SurfacePose | None:
        """Return the pose behind an edge; the heading keeps its angle to the edge. None where no triangle follows."""
        corners = self.mesh.triangles[here.triangle]
        a, b = int(corners[edge]), int(corners[(edge + 1) % 3])
        both = self._across[min(a, b), max(a, b)]
        if len(both) != 2:
            return None
        other = both[0] if both[1] == here.triangle else both[1]
        start, length = self.mesh.vertices[a], self._edge_length[here.triangle, edge]
        along = self._along[here.triangle, edge]
        share = min(max((point - start) @ along / length, NUDGE), 1.0 - NUDGE)
        back = next(i for i in range(3) if self.mesh.triangles[other, (i + 2) % 3] not in (a, b))
        inward = -self._outward[other, back]
        heading = (here.heading @ along) * along + abs(here.heading @ self._outward[here.triangle, edge]) * inward
        return SurfacePose(other, start + share * length * along, heading / np.linalg.norm(heading))


def nearest_point(mesh: TriangleMesh, point: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the point of a surface nearest to another, and the triangle that it lies on.

    Ericson, Real-Time Collision Detection (2005), section 5.1.5, for all triangles at once.

    Parameters
    ----------
    mesh : TriangleMesh
    point : (3,) float
    """
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    candidates = [_on_segment(p, q, point) for p, q in ((a, b), (b, c), (c, a))]
    normal = np.cross(b - a, c - a)
    square = np.einsum("ij,ij->i", normal, normal)
    flat = point - np.einsum("ij,ij->i", point - a, normal)[:, None] * normal / np.where(square > 0, square, 1.0)[:, None]
    inside = square > 0
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ij,ij->i", np.cross(q - p, flat - p), normal) >= 0
    candidates.append(np.where(inside[:, None], flat, np.inf))
    distance = np.array([np.linalg.norm(found - point, axis=1) for found in candidates])
    kind, triangle = np.unravel_index(np.argmin(distance), distance.shape)
    return candidates[kind][triangle], int(triangle)


def _on_segment(p: np.ndarray, q: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(n, 3) points nearest to `point` on the segments from `p` to `q`, both (n, 3)."""
    along = q - p
    square = np.einsum("ij,ij->i", along, along)
    share = np.einsum("ij,ij->i", point - p, along) / np.where(square > 0, square, 1.0)
    return p + np.clip(share, 0.0, 1.0)[:, None] * along
