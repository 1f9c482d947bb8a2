# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of texels in rows and columns: flat, bent to a radius, or wrapped onto any surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import SensorError
from .mesh import TriangleMesh, face_normals, triangle_areas

# Straightest geodesics on a triangulated surface (Polthier and Schmies 1998).
#
# A line crosses an edge as if both triangles lay in one plane.

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

    def turned(self, pose: SurfacePose, angle: float) -> SurfacePose:
        """Return the same point with the heading turned anticlockwise, seen from outside."""
        across = np.cross(self.normals[pose.triangle], pose.heading)
        return SurfacePose(pose.triangle, pose.point, np.cos(angle) * pose.heading + np.sin(angle) * across)

    def along(self, pose: SurfacePose, length: float) -> SurfacePose | None:
        """Do as :meth:`trace`, backwards for a negative length. The heading at the end points forwards in both cases."""
        if length >= 0:
            return self.trace(pose, length)
        end = self.trace(self.turned(pose, math.pi), -length)
        return None if end is None else self.turned(end, math.pi)

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


CROWDED = 0.5
"""Where the surface brings rows together, texels closer than this share of the spacing to another one are left out."""


@dataclass(frozen=True)
class TexelMesh:
    """Texels on a surface and the faces between them, as vertices and faces of a mesh.

    Attributes
    ----------
    vertices : (n, 3) float, metres
    faces : list of tuples of int
        Anticlockwise seen from outside; four-sided where the texels form a grid.
    """

    vertices: np.ndarray
    faces: list[tuple[int, ...]]


def pad_array(rows: int, columns: int, pitch: tuple[float, float], radius: float = 0.0) -> TexelMesh:
    """Return a flat pad in z = 0, or one bent about an axis along its rows' direction +y.

    Parameters
    ----------
    rows, columns : int
        Rows run along +y, columns along +x.
    pitch : (float, float), metres
        Between columns (x) and between rows (y), along the surface.
    radius : float, metres
        Of the bend: above zero the middle is the highest line, as on a finger; below zero it is the lowest; zero is flat.

    Raises
    ------
    SensorError
        The pad would be no grid, or would meet itself around its bend.
    """
    _check_size(rows, columns, pitch)
    width = (columns - 1) * pitch[0]
    if radius and width >= 2 * math.pi * abs(radius):
        raise SensorError(
            f"A pad {width * 1e3:g} mm wide goes more than once around a radius of {abs(radius) * 1e3:g} mm: "
            "use a larger radius."
        )
    y, along = np.mgrid[0:rows, 0:columns].astype(float)
    along, y = (along - (columns - 1) / 2) * pitch[0], (y - (rows - 1) / 2) * pitch[1]
    x, z = along, np.zeros_like(along)
    if radius:
        x, z = radius * np.sin(along / radius), radius * (np.cos(along / radius) - 1.0)
    return _whole_grid(np.stack([x, y, z], axis=-1).reshape(-1, 3), rows, columns)


def _check_size(rows: int, columns: int, pitch: tuple[float, float]) -> None:
    if rows < 2 or columns < 2 or not min(pitch) > 0:
        raise SensorError(
            f"An array of {rows} × {columns} texels has no face: use two rows and columns or more, and a pitch above zero."
        )


def wrapped_array(
    mesh: TriangleMesh,
    rows: int,
    columns: int,
    pitch: tuple[float, float],
    middle: SurfacePose | None = None,
    angle: float = 0.0,
) -> TexelMesh:
    """Lay a whole array onto a surface.

    A line through the middle carries one point per row; a line across it from each point carries the columns.

    Along these lines, neighbours are one pitch apart, measured on the surface. On a surface that can be unrolled the array
    keeps its shape.

    Parameters
    ----------
    mesh : TriangleMesh
        The region, metres.
    rows, columns : int
    pitch : (float, float), metres
        Along a row, and from row to row.
    middle : SurfacePose, optional
        Where the middle is, heading along the rows' direction (from one row to the next); by default :func:`region_middle`.
    angle : float, radians
        The array is turned by this, anticlockwise seen from outside.

    Raises
    ------
    SensorError
        The array reaches beyond the region.
    """
    _check_size(rows, columns, pitch)
    tracer = GeodesicTracer(mesh)
    centre = tracer.turned(middle or region_middle(mesh), angle)
    points: list[np.ndarray] = []
    offsets_y = (np.arange(rows) - (rows - 1) / 2) * pitch[1]
    offsets_x = (np.arange(columns) - (columns - 1) / 2) * pitch[0]
    for row, y in enumerate(offsets_y):
        start = tracer.along(centre, y)
        for column, x in enumerate(offsets_x):
            found = None if start is None else tracer.along(tracer.turned(start, -math.pi / 2), x)
            if found is None:
                raise SensorError(
                    f"Texel ({row}, {column}) of the {rows} × {columns} array lies beyond the region: "
                    "use fewer texels, a smaller pitch or a larger region, or turn the array."
                )
            points.append(found.point)
    return _whole_grid(np.array(points), rows, columns)


def filled_region(mesh: TriangleMesh, spacing: float, angle: float = 0.0) -> TexelMesh:
    """Cover a whole region with rows and columns; the rim of the array follows that of the region in steps.

    Parameters
    ----------
    mesh : TriangleMesh
        The region, metres.
    spacing : float, metres
        Between rows and between columns, on the surface.
    angle : float, radians
        The rows are turned by this, anticlockwise seen from outside.

    Raises
    ------
    SensorError
        Not even one face fits.
    """
    if not spacing > 0:
        raise SensorError(f"The spacing of texels is {spacing * 1e3:g} mm: give a length above zero.")
    size = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.triangles].reshape(-1, 3), axis=0)))
    tracer, most = GeodesicTracer(mesh), 2 + math.ceil(4.0 * size / spacing)
    middle_line = _both_ways(tracer, tracer.turned(region_middle(mesh), angle), spacing, most)
    row_lines = [_both_ways(tracer, tracer.turned(pose, -math.pi / 2), spacing, most) for _, pose in middle_line]
    low = min(number for row_line in row_lines for number, _ in row_line)
    high = max(number for row_line in row_lines for number, _ in row_line)
    index = np.full((len(row_lines), high - low + 1), -1)
    points: list[np.ndarray] = []
    for row, row_line in enumerate(row_lines):
        for column, pose in row_line:
            below = index[row - 1] if row else []
            near = [points[i] for i in below if i >= 0]
            if near and np.linalg.norm(np.array(near) - pose.point, axis=1).min() < CROWDED * spacing:
                continue
            index[row, column - low] = len(points)
            points.append(pose.point)
    faces = _quads(index)
    if not len(faces):
        raise SensorError(f"No face of {spacing * 1e3:g} × {spacing * 1e3:g} mm fits into the region: use a smaller spacing.")
    return mesh_of_faces(np.array(points), faces)


def region_middle(mesh: TriangleMesh) -> SurfacePose:
    """Return the point of a region nearest to its centre of area, heading along its longest extent.

    Of the two ways along, the one nearer to +y (then +x, then +z) is taken.
    """
    corners, area = mesh.vertices[mesh.triangles], triangle_areas(mesh)
    middles = corners.mean(axis=1)
    centre = (area[:, None] * middles).sum(axis=0) / area.sum()
    normal = (area[:, None] * face_normals(mesh)).sum(axis=0)
    arms = corners - centre
    spread = np.einsum("i,ivj,ivk->jk", area / 12, arms, arms) + np.einsum(
        "i,ij,ik->jk", area / 12, arms.sum(axis=1), arms.sum(axis=1)
    )  # the integral of x xᵀ over each triangle
    if np.linalg.norm(normal) > 1e-3 * area.sum():  # within the mean plane: the height of a dome is no direction on it
        flat = np.eye(3) - np.outer(normal, normal) / (normal @ normal)
        spread = flat @ spread @ flat
        height = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
        centre = centre + height * normal / np.linalg.norm(normal)
    values, vectors = np.linalg.eigh(spread)
    heading = vectors[:, 2]
    if values[2] - values[1] < 1e-3 * values[2]:  # round: as far along +y as it goes
        heading = vectors[:, 1:] @ (vectors[:, 1:].T @ np.array([1e-6, 1.0, 1e-9]))
        heading /= np.linalg.norm(heading)
    if heading @ np.array([1e-3, 1.0, 1e-6]) < 0:
        heading = -heading
    return GeodesicTracer(mesh).nearest_pose(centre, heading)


def shifted_pose(mesh: TriangleMesh, pose: SurfacePose, shift: tuple[float, float]) -> SurfacePose:
    """Return the pose that lies `shift` (across and along the heading, metres, on the surface) from another.

    Raises
    ------
    SensorError
        It lies beyond the region.
    """
    tracer = GeodesicTracer(mesh)
    found = tracer.along(pose, shift[1])
    if found is not None and shift[0]:
        side = tracer.along(tracer.turned(found, -math.pi / 2), shift[0])
        found = None if side is None else tracer.turned(side, math.pi / 2)
    if found is None:
        raise SensorError(
            f"Shifted by {shift[0] * 1e3:g} and {shift[1] * 1e3:g} mm the array's middle lies beyond the region: shift it less."
        )
    return found


def _both_ways(tracer: GeodesicTracer, middle: SurfacePose, spacing: float, most: int) -> list[tuple[int, SurfacePose]]:
    """Return numbered poses at all multiples of the spacing in front of and behind the middle, up to the surface's rim."""
    found = [(0, middle)]
    for sign in (-1, 1):
        here: SurfacePose | None = middle
        for number in range(1, most):
            here = tracer.along(here, sign * spacing) if here is not None else None
            if here is None or np.linalg.norm(here.point - middle.point) < CROWDED * spacing:  # off it, or once around it
                break
            found.append((sign * number, here))
            behind = [pose.point for number, pose in found if number < 0] if sign > 0 else []
            if any(np.linalg.norm(point - here.point) < CROWDED * spacing for point in behind):  # around a closed surface
                found.pop()
                break
    return sorted(found, key=lambda item: item[0])


def _quads(index: np.ndarray) -> np.ndarray:
    """(m, 4) int: faces between neighbours in a table of vertex numbers; −1 marks an empty place."""
    corners = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    return corners[(corners >= 0).all(axis=1)]


def _whole_grid(points: np.ndarray, rows: int, columns: int) -> TexelMesh:
    return mesh_of_faces(points, _quads(np.arange(rows * columns).reshape(rows, columns)))


def mesh_of_faces(points: np.ndarray, faces: np.ndarray) -> TexelMesh:
    """Return the points (n, 3) that are corners of faces (m, 3 or 4) int, and these faces."""
    used, number = np.unique(faces, return_inverse=True)
    return TexelMesh(points[used], [tuple(face) for face in number.reshape(faces.shape).tolist()])
