# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets that go through a sensor within one step of another program, and so exert no force (kernels).

A target stands for the largest sphere about its centre that is inside it. It went through where this centre crosses the plane
of a texel, closer to the texel than the radius, and nothing is in contact afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ..compiled.kernels import addressed_kernel, inlined, kernel
from ..compiled.struct_reference import by_reference, call_of_range
from ..geometry.mesh import TriangleMesh, face_normals, is_closed
from ..geometry.rotations import rotate
from ..geometry.shapes import BOX, PLANE, Shape, Vector
from ..geometry.texel_arrays import nearest_point
from ..geometry.texels import Texels
from .pressing import PressedTexels


@by_reference
class JumpSearch(NamedTuple):
    """Arrays for finding jumps in E environments.

    Attributes
    ----------
    frame : (n, 6) float
        Position (m) and normal of each texel, in the sensor's frame.
    bound : (4,) float, metres
        Sphere around the texels: centre and radius.
    sphere : (T, 4) float, metres
        Sphere inside each target, in its frame: centre and radius; zero for a target of which none is known.
    centre : (E, T, 3) float, metres
        Of these spheres in the sensor's frame, at the last step; NaN where an environment begins.
    jumped : (E,) bool
    unit : (4,) float
        Working memory.
    pressed : PressedTexels
    """

    frame: np.ndarray
    bound: np.ndarray
    sphere: np.ndarray
    centre: np.ndarray
    jumped: np.ndarray
    unit: np.ndarray
    pressed: PressedTexels


class JumpFinder:
    """Finds jumps after each step of some environments.

    Parameters
    ----------
    texels : Texels
    targets : sequence of TriangleMesh or Shape
    pressed : PressedTexels
        Their poses and results.

    Attributes
    ----------
    jumped : (E,) bool
        In which environments a target went through the sensor with the last step.
    """

    def __init__(self, texels: Texels, targets: Sequence[TriangleMesh | Shape], pressed: PressedTexels):
        e = len(pressed.valid)
        frame, bound, spheres = jump_arrays(texels, targets)
        centre = np.full((e, len(targets), 3), np.nan)
        self._search = JumpSearch(frame, bound, spheres, centre, np.zeros(e, np.bool_), np.zeros(4), pressed)
        self.jumped = self._search.jumped
        self._can_jump, self._environments = bool(spheres[:, 3].any()), e
        self._find = call_of_range(find_jumps, self._search, partial(find_jumps, search=self._search))

    def forget(self, which: np.ndarray | slice) -> None:
        """Let environments begin with their next step."""
        self._search.centre[which] = np.nan

    def find(self) -> None:
        """Look at the step that was taken."""
        if self._can_jump:
            self._find(0, self._environments)


def jump_arrays(texels: Texels, targets: Sequence[TriangleMesh | Shape]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `frame`, `bound` and `sphere` of a :class:`JumpSearch`."""
    middle = 0.5 * (texels.position.min(axis=0) + texels.position.max(axis=0))
    radius = np.linalg.norm(texels.position - middle, axis=1).max()
    frame = np.column_stack([texels.position, texels.normal]).astype(float)
    return frame, np.array([*middle, radius]), np.array([_inner_sphere(target) for target in targets], float).reshape(-1, 4)


def _inner_sphere(target: TriangleMesh | Shape) -> tuple[float, float, float, float]:
    """Return centre and radius of a sphere inside a target; no radius for a plane, and for a mesh that may not contain one."""
    if isinstance(target, Shape):
        radius = {PLANE: 0.0, BOX: min(target.size)}.get(target.kind, target.size[0])
        return (0.0, 0.0, 0.0, radius)
    x, y, z = 0.5 * (target.vertices.min(axis=0) + target.vertices.max(axis=0))
    if not is_closed(target.triangles):
        return (x, y, z, 0.0)
    nearest, triangle = nearest_point(target, np.array([x, y, z]))
    outward = nearest - np.array([x, y, z])
    is_inside = outward @ face_normals(target)[triangle] > 0.0
    return (x, y, z, float(np.linalg.norm(outward)) if is_inside else 0.0)


@addressed_kernel
def find_jumps(first: int, last: int, search: JumpSearch) -> None:
    """Write down in which environments a target went through the sensor, and where targets are now."""
    out = search.pressed
    for number in range(first, last):
        crossed, silent, spheres = False, out.valid[number] and not _measures(number, out), search.sphere
        for target in range(search.sphere.shape[0]):
            x, y, z = _centre_in_sensor(out.poses[number, 0], out.poses[number, 1 + target], spheres[target], search.unit)
            old = search.centre[number, target]
            if silent:
                crossed |= goes_through((old[0], old[1], old[2]), (x, y, z), spheres[target, 3], search.bound, search.frame)
            old[0], old[1], old[2] = x, y, z
        search.jumped[number] = crossed


@kernel
def _measures(number: int, out: PressedTexels) -> bool:
    """Whether anything touches the sensor of an environment."""
    if out.too_deep[number] > 0:
        return True
    found = False
    for texel in range(out.contact.shape[1]):
        found |= out.contact[number, texel]
    return found


@kernel
def _centre_in_sensor(sensor: np.ndarray, target: np.ndarray, sphere: np.ndarray, unit: np.ndarray) -> Vector:
    """Return where a point of a target is in the sensor's frame; their poses are (7,)."""
    _write_unit(target, 1.0, unit)
    x, y, z = rotate(unit, sphere[0], sphere[1], sphere[2])
    _write_unit(sensor, -1.0, unit)
    return rotate(unit, x + target[0] - sensor[0], y + target[1] - sensor[1], z + target[2] - sensor[2])


@kernel
def _write_unit(pose: np.ndarray, sign: float, unit: np.ndarray) -> None:
    """Write the unit quaternion of a pose (7,), or of its inverse."""
    length = math.sqrt(pose[3] * pose[3] + pose[4] * pose[4] + pose[5] * pose[5] + pose[6] * pose[6])
    scale = 1.0 / length if length > 0.0 else 0.0
    unit[0], unit[1], unit[2], unit[3] = scale * pose[3], sign * scale * pose[4], sign * scale * pose[5], sign * scale * pose[6]


@kernel
def goes_through(start: Vector, end: Vector, radius: float, bound: np.ndarray, frame: np.ndarray) -> bool:
    """Whether a sphere whose centre moves along a line crosses a texel; NaN crosses nothing."""
    if not meets_sphere(start, end, radius + bound[3], (bound[0], bound[1], bound[2])):
        return False
    for texel in range(frame.shape[0]):
        point = (frame[texel, 0], frame[texel, 1], frame[texel, 2])
        if crosses_texel(start, end, radius, point, (frame[texel, 3], frame[texel, 4], frame[texel, 5])):
            return True
    return False


@inlined
def meets_sphere(start: Vector, end: Vector, radius: float, centre: Vector) -> bool:
    """Whether a line from point to point comes closer to a centre than a radius; False for a line that is none."""
    (sx, sy, sz), (ex, ey, ez), (x, y, z) = start, end, centre
    dx, dy, dz = ex - sx, ey - sy, ez - sz
    square = dx * dx + dy * dy + dz * dz
    along = (x - sx) * dx + (y - sy) * dy + (z - sz) * dz
    t = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    ax, ay, az = sx + t * dx - x, sy + t * dy - y, sz + t * dz - z
    return square > 0.0 and ax * ax + ay * ay + az * az < radius * radius


@inlined
def crosses_texel(start: Vector, end: Vector, radius: float, point: Vector, normal: Vector) -> bool:
    """Whether a line from point to point crosses the plane of a texel closer to it than a radius."""
    (sx, sy, sz), (ex, ey, ez), (x, y, z), (nx, ny, nz) = start, end, point, normal
    above = (sx - x) * nx + (sy - y) * ny + (sz - z) * nz
    below = (ex - x) * nx + (ey - y) * ny + (ez - z) * nz
    crosses = (above > 0.0 and below < 0.0) or (above < 0.0 and below > 0.0)
    t = above / (above - below) if crosses else 0.0
    ax, ay, az = sx + t * (ex - sx) - x, sy + t * (ey - sy) - y, sz + t * (ez - sz) - z
    return crosses and ax * ax + ay * ay + az * az < radius * radius
