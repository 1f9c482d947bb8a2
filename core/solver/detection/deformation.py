# SPDX-License-Identifier: GPL-3.0-or-later
"""Deforming surfaces: targets and sensors whose vertices move in their body's frame, linearly between samples (kernels).

Once a frame the boxes of a target's tree are refitted around all that its triangles sweep over; the tree itself stays. Within
the frame a triangle is brought to the moment of a step only when a segment may meet it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import kernel
from ...effects.engine.registry import mounted_texels
from ...geometry.bvh import Tree
from ...geometry.contact_points import ContactPoints
from ...geometry.mesh import TriangleMesh, vertex_normals
from ...geometry.texels import Texels
from ...model.scenario import Scenario
from ...model.sensor import Deformation
from ..solver_model import SolverModel
from .detection_data import MOMENTS, OTHER, PRESENT, NeighbourLists, SampleTrack, SurfaceMotion

FLAT = 1e-13
"""A triangle whose doubled area is below this share of its longest edge squared has no normal and is never met."""


class SampleWindow(NamedTuple):
    """Samples that a span of time needs, and where its moments lie among them.

    Attributes
    ----------
    samples : (w, n, c) float
    left : (steps + 1,) int
        Sample before each moment.
    share : (steps + 1,) float
        How far each moment is on the way to the next sample.
    spans : (w - 1,) float, seconds
    """

    samples: np.ndarray
    left: np.ndarray
    share: np.ndarray
    spans: np.ndarray


def window(times: np.ndarray, samples: np.ndarray, moments: np.ndarray) -> SampleWindow:
    """Return the part of a series of samples that the given moments lie in; the first and the last sample are held.

    Parameters
    ----------
    times : (s,) float, seconds, increasing
    samples : (s, n, c) float
    moments : (steps + 1,) float, seconds, increasing
    """
    if len(times) == 1:
        return SampleWindow(samples, np.zeros(len(moments), np.int64), np.zeros(len(moments)), np.zeros(0))
    moments = np.clip(moments, times[0], times[-1])
    right = np.clip(np.searchsorted(times, moments, side="left"), 1, len(times) - 1)
    share = (moments - times[right - 1]) / (times[right] - times[right - 1])
    first, last = right[0] - 1, right[-1]
    return SampleWindow(samples[first : last + 1], right - 1 - first, share, np.diff(times[first : last + 1]))


def stack_windows(windows: Sequence[SampleWindow | None], columns: int, moments: int) -> SampleTrack:
    """Lay the windows of several surfaces behind one another; None is for a surface that has no values."""
    values, at = [np.zeros((0, columns))], 0
    stride = np.zeros(len(windows), np.int64)
    row, share = np.zeros((moments, len(windows)), np.int64), np.zeros((moments, len(windows)))
    for i, found in enumerate(windows):
        if found is None:
            continue
        samples, size, _ = found.samples.shape
        values.append(found.samples.reshape(-1, columns))
        stride[i] = size if samples > 1 else 0
        row[:, i], share[:, i] = at + found.left * size, found.share
        at += samples * size
    return SampleTrack(np.ascontiguousarray(np.concatenate(values), dtype=float), stride, row, share)


def speed_bound(found: SampleWindow | None, reach: float) -> float:
    """Bound on the speed of both ends of the segments of a window's contact points, m/s; vertices have a reach of zero.

    A unit vector that goes straight to another and is stretched to its length turns fastest half-way.
    """
    if found is None or len(found.spans) == 0:
        return 0.0
    turn = np.linalg.norm(np.diff(found.samples[:, :, 3:6], axis=0), axis=2)
    turn = turn / np.sqrt(np.maximum(1.0 - 0.25 * turn**2, 1e-3))
    step = np.linalg.norm(np.diff(found.samples[:, :, :3], axis=0), axis=2) + reach * turn
    return float((step.max(axis=1, initial=0.0) / found.spans).max())


@kernel
def at_moment(found: SampleTrack, moment: int, surface: int, i: int, column: int) -> float:
    """One value of a track at a moment; exact at the samples, and where two samples are the same."""
    row, share = found.row[moment, surface] + i, found.share[moment, surface]
    before = found.values[row, column]
    if share == 0.0:
        return before
    after = found.values[row + found.stride[surface], column]
    if share == 1.0:
        return after
    return before + share * (after - before)


@kernel
def vector_at_moment(found: SampleTrack, moment: int, surface: int, i: int, column: int) -> tuple[float, float, float]:
    """Do as :func:`at_moment` for the vector that begins with a column."""
    return (
        at_moment(found, moment, surface, i, column),
        at_moment(found, moment, surface, i, column + 1),
        at_moment(found, moment, surface, i, column + 2),
    )


@kernel
def refit_boxes(surfaces: SurfaceMotion, tree: Tree) -> None:
    """Fit the boxes of deforming targets around all places of their triangles in this frame."""
    bounds, found = tree.bounds, surfaces.targets
    for target in range(len(surfaces.target_deforms)):
        if not surfaces.target_deforms[target]:
            continue
        moments = len(found.row)
        begin, step = found.row[0, target], found.stride[target]
        samples = 1
        if step > 0:
            samples = (found.row[moments - 1, target] - begin) // step + 2
        for node in range(tree.roots[target + 1] - 1, tree.roots[target] - 1, -1):
            if tree.number[node] > 0:
                for axis in range(3):
                    low, high = np.inf, -np.inf
                    for i in range(tree.first[node], tree.first[node] + tree.number[node]):
                        for corner in range(3):
                            for sample in range(samples):
                                x = found.values[begin + sample * step + surfaces.corner[i, corner], axis]
                                low, high = min(low, x), max(high, x)
                    bounds[node, axis], bounds[node, 3 + axis] = low, high
            else:  # its children come behind it
                left, right = node + 1, tree.skip[node + 1]
                for axis in range(3):
                    bounds[node, axis] = min(bounds[left, axis], bounds[right, axis])
                    bounds[node, 3 + axis] = max(bounds[left, 3 + axis], bounds[right, 3 + axis])


@kernel
def place_triangle(i: int, target: int, surfaces: SurfaceMotion, tree: Tree) -> None:
    """Bring a triangle of a deforming target to the present moment: corners and normal."""
    if surfaces.triangle_moment[i] == surfaces.clock[MOMENTS]:
        return
    surfaces.triangle_moment[i] = surfaces.clock[MOMENTS]
    faces, moment = tree.faces, surfaces.clock[PRESENT]
    for corner in range(3):
        for axis in range(3):
            faces[i, 3 * corner + axis] = at_moment(surfaces.targets, moment, target, surfaces.corner[i, corner], axis)
    ux, uy, uz = faces[i, 3] - faces[i, 0], faces[i, 4] - faces[i, 1], faces[i, 5] - faces[i, 2]
    vx, vy, vz = faces[i, 6] - faces[i, 0], faces[i, 7] - faces[i, 1], faces[i, 8] - faces[i, 2]
    wx, wy, wz = vx - ux, vy - uy, vz - uz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
    if length > FLAT * longest:
        faces[i, 9], faces[i, 10], faces[i, 11] = nx / length, ny / length, nz / length
    else:
        faces[i, 9], faces[i, 10], faces[i, 11] = 0.0, 0.0, 0.0


@kernel
def place_all_triangles(target: int, surfaces: SurfaceMotion, tree: Tree) -> None:
    """Bring all triangles of a target to the present moment."""
    if surfaces.target_deforms[target]:
        for i in range(surfaces.triangle_start[target], surfaces.triangle_start[target + 1]):
            place_triangle(i, target, surfaces, tree)


@kernel
def place_listed_triangles(
    target: int, first: int, stop: int, lists: NeighbourLists, surfaces: SurfaceMotion, tree: Tree
) -> None:
    """Bring the triangles that contact points can meet to the present moment: the lists of slots `first` to `stop`."""
    if not surfaces.target_deforms[target]:
        return
    for slot in range(first, stop):
        if lists.length[slot] < 0:
            place_all_triangles(target, surfaces, tree)
            return
        for j in range(lists.length[slot]):
            place_triangle(lists.triangles[slot, j], target, surfaces, tree)


def corners_of(meshes: Sequence, tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of each triangle in the tree's order, (nt, 3) int, and where each mesh's triangles start, (T + 1,) int."""
    start = np.cumsum([0] + [len(mesh.triangles) for mesh in meshes])
    corner = [mesh.triangles[tree.source[a:b]] for mesh, a, b in zip(meshes, start[:-1], start[1:], strict=True)]
    return np.ascontiguousarray(np.concatenate(corner), dtype=np.int64), start


@kernel
def point_at(surfaces: SurfaceMotion, moment: int, sensor: int, i: int) -> tuple[float, ...]:
    """Position and unit normal of a contact point of a deforming sensor."""
    x, y, z = vector_at_moment(surfaces.sensors, moment, sensor, i, 0)
    nx, ny, nz = vector_at_moment(surfaces.sensors, moment, sensor, i, 3)
    scale = 1.0 / max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
    return x, y, z, scale * nx, scale * ny, scale * nz


@kernel
def frame_at(surfaces: SurfaceMotion, moment: int, sensor: int, i: int) -> tuple[float, ...]:
    """Position of a contact point of a deforming sensor, and normal, x axis and y axis of its texel there: twelve numbers."""
    x, y, z, nx, ny, nz = point_at(surfaces, moment, sensor, i)
    tx, ty, tz = vector_at_moment(surfaces.sensors, moment, sensor, i, 6)
    out = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - out * nx, ty - out * ny, tz - out * nz
    scale = 1.0 / max(math.sqrt(tx * tx + ty * ty + tz * tz), 1e-300)
    tx, ty, tz = scale * tx, scale * ty, scale * tz
    return x, y, z, nx, ny, nz, tx, ty, tz, ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx


@kernel
def set_moment(now: int, other: int, dt: float, model: SolverModel, surfaces: SurfaceMotion) -> None:
    """Go on to another moment, and move the contact points of deforming sensors there.

    Parameters
    ----------
    now, other : int
        The moment, and the next or the previous one, to which velocities are differences.
    dt : float, seconds
        Upper bound on the time since the moment before.
    model : SolverModel
    surfaces : SurfaceMotion
    """
    surfaces.clock[MOMENTS] += 1
    surfaces.clock[PRESENT], surfaces.clock[OTHER] = now, other
    for target in range(len(surfaces.target_deforms)):
        surfaces.target_travel[target] += dt * surfaces.target_speed[target]
    for sensor in range(len(surfaces.sensor_deforms)):
        if surfaces.sensor_deforms[sensor]:
            surfaces.sensor_travel[sensor] += dt * surfaces.sensor_speed[sensor]
            start = model.sensors.first_point[sensor]
            for i in range(model.sensors.first_point[sensor + 1] - start):
                frame = frame_at(surfaces, now, sensor, i)
                for column in range(12):
                    model.points.frame[start + i, column] = frame[column]


def point_rows(texels: Texels, points: ContactPoints, reference: np.ndarray) -> np.ndarray:
    """Rows of :attr:`.Points.frame`.

    Parameters
    ----------
    texels : Texels
    points : ContactPoints
    reference : (3,) float, metres
        Reference point of the body, in its frame.
    """
    position, normal = points.positions(texels.position) - reference, points.normals(texels.normal)
    return np.hstack([position, normal, texels.tangent[points.texel], texels.bitangent[points.texel]])


class DeformingSurfaces:
    """The shapes of a scenario's targets and sensors, as far as they are known.

    Parameters
    ----------
    scenario : Scenario
    center : (b, 3) float, metres
        Reference point of each body in its frame.
    points : list of ContactPoints
        Of each sensor.
    tree : Tree
    model : SolverModel
        The bounding spheres of sensors that deform are kept up to date in it.
    """

    def __init__(self, scenario: Scenario, center: np.ndarray, points: list[ContactPoints], tree: Tree, model: SolverModel):
        self._targets, self._sensors = scenario.targets, scenario.sensors
        self._vertices = [target.deformation for target in scenario.targets]
        self._texels = [sensor.deformation for sensor in scenario.sensors]
        self._target_center = [center[target.body] for target in scenario.targets]
        self._sensor_center = [center[sensor.body] for sensor in scenario.sensors]
        self._points, self._model = points, model
        meshes = [target.mesh for target in scenario.targets]
        count = len(tree.faces)
        wanted = any(target.smooth or target.deformation is not None for target in scenario.targets)
        corner, self._triangle_start = corners_of(meshes, tree)
        self._corner = corner if wanted else np.zeros((0, 3), np.int64)
        self._triangle_moment = np.full(count if wanted else 0, -1)
        self._clock = np.zeros(3, np.int64)
        self._travel = np.zeros(len(scenario.targets)), np.zeros(len(scenario.sensors))

    @property
    def any_deforms(self) -> bool:
        """Whether anything deforms."""
        return any(found is not None for found in (*self._vertices, *self._texels))

    def extend(self, time: float, vertices: Mapping[int, np.ndarray], texels: Mapping[int, np.ndarray]) -> None:
        """Append the next shapes of some targets and sensors.

        Parameters
        ----------
        time : float, seconds
        vertices : mapping of target index to (nv, 3) float, metres, in the body's frame
        texels : mapping of sensor index to (n, 9) float
            Position (m), normal and tangent of the texels, in the body's frame.
        """
        for known, found in ((self._vertices, vertices), (self._texels, texels)):
            for index, values in found.items():
                before = known[index]
                if before is None:
                    raise ValueError(f"Shape {index} was not declared as deforming.")
                if before.times[-1] < time - 1e-9:
                    known[index] = before.extended(time, values)

    def at(self, moments: np.ndarray) -> SurfaceMotion:
        """Return the shapes between the first and the last of some moments, for the kernels.

        Parameters
        ----------
        moments : (steps + 1,) float, seconds
        """
        vertices = [self._target_window(i, moments) for i in range(len(self._targets))]
        rows = [self._sensor_window(i, moments) for i in range(len(self._sensors))]
        reach = self._model.sensors.max_penetration
        self._fit_spheres(rows)
        return SurfaceMotion(
            any_deforms=np.array([self.any_deforms]),
            target_deforms=np.array([found is not None for found in self._vertices], dtype=np.bool_),
            target_smooth=np.array([target.smooth for target in self._targets], dtype=np.bool_),
            sensor_deforms=np.array([found is not None for found in self._texels], dtype=np.bool_),
            targets=stack_windows(vertices, 6, len(moments)),
            sensors=stack_windows(rows, 12, len(moments)),
            corner=self._corner,
            triangle_start=self._triangle_start,
            target_speed=np.array([speed_bound(found, 0.0) for found in vertices]),
            sensor_speed=np.array([speed_bound(found, reach[i]) for i, found in enumerate(rows)]),
            target_travel=self._travel[0],
            sensor_travel=self._travel[1],
            triangle_moment=self._triangle_moment,
            clock=self._clock,
        )

    def _target_window(self, index: int, moments: np.ndarray) -> SampleWindow | None:
        """Vertices and, where they are asked for, their normals; None for what neither deforms nor is smooth."""
        target, known = self._targets[index], self._vertices[index]
        if known is None:
            if not target.smooth:
                return None
            known = Deformation(np.zeros(1), target.mesh.vertices[None])
        found = window(known.times, known.values, moments)
        normals = np.zeros_like(found.samples)
        if target.smooth:
            for sample, shape in enumerate(found.samples):
                normals[sample] = vertex_normals(TriangleMesh(shape, target.mesh.triangles))
        return found._replace(samples=np.concatenate([found.samples - self._target_center[index], normals], axis=2))

    def _sensor_window(self, index: int, moments: np.ndarray) -> SampleWindow | None:
        known = self._texels[index]
        if known is None:
            return None
        found = window(known.times, known.values, moments)
        sensor, center = self._sensors[index], self._sensor_center[index]
        bent = [mounted_texels(replace(sensor, texels=sensor.texels.with_local_frames(frames))) for frames in found.samples]
        rows = [point_rows(texels, self._points[index], center) for texels in bent]
        return found._replace(samples=np.stack(rows))

    def _fit_spheres(self, rows: list[SampleWindow | None]) -> None:
        """Fit the spheres around deforming sensors; between two samples the end of a turning segment bulges out."""
        for index, found in enumerate(rows):
            if found is not None:
                reach = self._model.sensors.max_penetration[index]
                turn = np.linalg.norm(np.diff(found.samples[:, :, 3:6], axis=0), axis=2).max(initial=0.0)
                bulge = reach * (1.0 - np.sqrt(max(1.0 - 0.25 * turn**2, 0.0)))
                middle, radius = bounding_sphere(found.samples.reshape(-1, 12), reach)
                self._model.sensors.center[index], self._model.sensors.radius[index] = middle, radius + bulge


def bounding_sphere(points: np.ndarray, reach: float) -> tuple[np.ndarray, float]:
    """Centre and radius of a sphere around contact points (rows of :attr:`.Points.frame`) and the segments behind them."""
    ends = np.vstack([points[:, :3], points[:, :3] - reach * points[:, 3:6]])
    middle = 0.5 * (ends.min(axis=0) + ends.max(axis=0))
    return middle, float(np.linalg.norm(ends - middle, axis=1).max())
