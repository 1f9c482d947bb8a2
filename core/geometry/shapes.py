# SPDX-License-Identifier: GPL-3.0-or-later
"""Spheres, boxes, capsules and planes: where a line enters them, what is inside, and their normals (kernels).

Each stands about the origin of its frame. A line is given by a point and a unit vector; where it enters is the distance from
that point along the vector, infinite where it misses the shape and negative where it enters before the point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..compiled.kernels import inlined
from ..errors import ParameterError
from .mesh import TriangleMesh

Vector = tuple[float, float, float]

MESH, SPHERE, BOX, CAPSULE, PLANE = range(5)
"""Kinds of targets: a mesh, or one of these shapes."""
NAMES = ("mesh", "sphere", "box", "capsule", "plane")
PARALLEL = 1e-30
"""Square of the sine of an angle that counts as zero: over metres, a line at this angle goes 1e-15 m aside."""


@dataclass(frozen=True)
class Shape:
    """A sphere, box, capsule or plane about the origin of its frame, metres; the functions below make it.

    Attributes
    ----------
    kind : int
        SPHERE, BOX, CAPSULE or PLANE.
    size : (float, float, float), metres
        Of a sphere the radius; of a box half of its edges; of a capsule the radius and half the length of its axis.
    """

    kind: int
    size: Vector = (0.0, 0.0, 0.0)

    def __repr__(self) -> str:
        return f"<Shape {NAMES[self.kind]} {self.size}>"

    @property
    def stand_in(self) -> TriangleMesh:
        """A closed mesh about as large, for what needs triangles; contacts do not use it."""
        extent = max(self.size) + self.size[1] if self.kind == CAPSULE else max(self.size) or 1.0
        corners = extent * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
        faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
                 [1, 5, 7], [1, 7, 3]]  # fmt: skip
        return TriangleMesh(corners, np.array(faces))


def sphere(radius: float) -> Shape:
    """Return a sphere of a radius, m."""
    return _checked(SPHERE, (radius, 0.0, 0.0), (radius,))


def box(edges: tuple[float, float, float]) -> Shape:
    """Return a box with edges of these full lengths (3,), m."""
    return _checked(BOX, (0.5 * edges[0], 0.5 * edges[1], 0.5 * edges[2]), edges)


def capsule(radius: float, length: float) -> Shape:
    """Return a capsule: all within a radius (m) of a piece of the z axis of this length (m)."""
    return _checked(CAPSULE, (radius, 0.5 * length, 0.0), (radius, length))


def plane() -> Shape:
    """Return all below the xy plane, whose normal is the z axis."""
    return Shape(PLANE)


def _checked(kind: int, size: Vector, given: tuple[float, ...]) -> Shape:
    if not all(np.isfinite(value) and value > 0.0 for value in given):
        raise ParameterError(f"The sizes of a {NAMES[kind]} are {given} m: give numbers above zero.")
    return Shape(kind, (float(size[0]), float(size[1]), float(size[2])))


@inlined
def sphere_entry(start: Vector, way: Vector, radius: float) -> float:
    """Return where a line enters a sphere: ``|start + s · way| = radius``, the smaller root."""
    (ox, oy, oz), (nx, ny, nz) = start, way
    along = ox * nx + oy * ny + oz * nz
    outside = ox * ox + oy * oy + oz * oz - radius * radius
    root = along * along - outside
    return -along - math.sqrt(root) if root > 0.0 else math.inf


@inlined
def is_in_sphere(point: Vector, radius: float) -> bool:
    """Return whether a point is inside a sphere."""
    x, y, z = point
    return x * x + y * y + z * z - radius * radius < 0.0


@inlined
def _slab_crossing(start: float, way: float, half: float) -> tuple[float, float]:
    """Where a line comes between a pair of planes and leaves them; along them it is between always, or never."""
    moves, never = way != 0.0, (-math.inf if abs(start) < half else math.inf)
    scale = 1.0 / (way if moves else 1.0)
    middle, far = -start * scale, half * abs(scale)
    return (middle - far if moves else never), (middle + far if moves else -never)


@inlined
def box_entry(start: Vector, way: Vector, half: Vector) -> tuple[float, int]:
    """Return where a line enters a box, between three pairs of planes, and through the faces across which axis."""
    x, x_end = _slab_crossing(start[0], way[0], half[0])
    y, y_end = _slab_crossing(start[1], way[1], half[1])
    z, z_end = _slab_crossing(start[2], way[2], half[2])
    axis = 1 if y > x else 0
    enters = max(x, y)
    axis = 2 if z > enters else axis
    enters = max(enters, z)
    return (enters if enters <= min(x_end, y_end, z_end) else math.inf), axis


@inlined
def is_in_box(point: Vector, half: Vector) -> bool:
    """Return whether a point is inside a box."""
    return abs(point[0]) < half[0] and abs(point[1]) < half[1] and abs(point[2]) < half[2]


@inlined
def capsule_entry(start: Vector, way: Vector, radius: float, half: float) -> float:
    """Return where a line enters a capsule: its cylinder, or the sphere at the end past which it enters the cylinder."""
    (ox, oy, oz), (nx, ny, nz) = start, way
    square = nx * nx + ny * ny
    along = ox * nx + oy * ny
    outside = ox * ox + oy * oy - radius * radius
    root = along * along - square * outside
    parallel = square < PARALLEL
    enters = (-along - math.sqrt(max(root, 0.0))) / (1.0 if parallel else square)
    z = -math.inf * nz if parallel else oz + enters * nz
    end = half if z > half else -half
    at_end = sphere_entry((ox, oy, oz - end), way, radius)
    meets = outside < 0.0 if parallel else root > 0.0
    return (enters if abs(z) <= half else at_end) if meets else math.inf


@inlined
def beyond_axis(z: float, half: float) -> float:
    """Return how far a height is from the heights -half to half, with its sign."""
    return z - max(min(z, half), -half)


@inlined
def is_in_capsule(point: Vector, radius: float, half: float) -> bool:
    """Return whether a point is inside a capsule."""
    return is_in_sphere((point[0], point[1], beyond_axis(point[2], half)), radius)


@inlined
def plane_entry(start: Vector, way: Vector) -> float:
    """Return where a line goes below the xy plane."""
    return start[2] / -way[2] if way[2] < 0.0 else math.inf


@inlined
def shape_entry(kind: int, size: Vector, start: Vector, way: Vector) -> tuple[float, int]:
    """Return where a line enters a shape, and the axis across the face of a box, else zero."""
    if kind == SPHERE:
        return sphere_entry(start, way, size[0]), 0
    if kind == BOX:
        return box_entry(start, way, size)
    if kind == CAPSULE:
        return capsule_entry(start, way, size[0], size[1]), 0
    return plane_entry(start, way), 0


@inlined
def is_in_shape(kind: int, size: Vector, point: Vector) -> bool:
    """Return whether a point is inside a shape."""
    if kind == SPHERE:
        return is_in_sphere(point, size[0])
    if kind == BOX:
        return is_in_box(point, size)
    if kind == CAPSULE:
        return is_in_capsule(point, size[0], size[1])
    return point[2] < 0.0


@inlined
def shape_normal(kind: int, size: Vector, axis: int, point: Vector) -> Vector:
    """Return the outward unit normal at a point of the surface; of a box, on the faces across an axis."""
    x, y, z = point
    if kind == BOX:
        nx = (1.0 if x > 0.0 else -1.0) if axis < 1 else 0.0
        nz = (1.0 if z > 0.0 else -1.0) if axis > 1 else 0.0
        return nx, (1.0 if y > 0.0 else -1.0) * (1.0 - abs(nx)) * (1.0 - abs(nz)), nz
    if kind == PLANE:
        return 0.0, 0.0, 1.0
    scale = 1.0 / size[0]
    return scale * x, scale * y, scale * beyond_axis(z, size[1])


@inlined
def shape_distance(kind: int, size: Vector, point: Vector) -> float:
    """Return a lower bound of a point's distance from a shape, m; negative inside of spheres, capsules and planes."""
    x, y, z = point
    if kind == BOX:
        x, y, z = max(abs(x) - size[0], 0.0), max(abs(y) - size[1], 0.0), max(abs(z) - size[2], 0.0)
        return math.sqrt(x * x + y * y + z * z)
    if kind == PLANE:
        return z
    z = beyond_axis(z, size[1])
    return math.sqrt(x * x + y * y + z * z) - size[0]
