# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that change their shape: targets and sensors whose vertices move in their body's frame, linearly between samples.

Once a frame the boxes of a target's tree are refitted around all that its triangles sweep over; the tree itself stays. Within
the frame a triangle is brought to the moment of the step only when a segment may meet it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import kernel
from ...compiled.struct_reference import by_reference
from ...geometry.bvh import Tree

FLAT = 1e-13
"""Twice the area over the square of the longest edge below which a triangle has no normal, and so never answers."""


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
    """Cut out of a series of samples what the given moments lie between; the first and the last sample are held.

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


@by_reference
class SampleTrack(NamedTuple):
    """The windows of several things behind one another, for the kernels. A *moment* is the beginning of a step or the last end.

    Attributes
    ----------
    values : (V, c) float
    stride : (T,) int
        From a row in one sample to the same row in the next; zero where there is only one.
    row : (steps + 1, T) int
        Where the sample before each moment begins.
    share : (steps + 1, T) float
    """

    values: np.ndarray
    stride: np.ndarray
    row: np.ndarray
    share: np.ndarray


def stack_windows(windows: Sequence[SampleWindow | None], columns: int, moments: int) -> SampleTrack:
    """Lay windows behind one another; None is for a thing that has no values."""
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


@by_reference
class SurfaceMotion(NamedTuple):
    """What surfaces look like at the steps of one frame: T targets, m sensors.

    Attributes
    ----------
    moves : (1,) bool
        Whether anything deforms at all.
    deforms, smooth : (T,) bool
        Targets whose vertices move, and those whose contact normals are interpolated between their vertices.
    bends : (m,) bool
        Sensors whose contact points move in their body's frame.
    targets : SampleTrack
        Vertices (m, relative to the body's reference point) and vertex normals of targets that deform or are smooth.
    sensors : SampleTrack
        Rows of :attr:`.SolverModel.points` of sensors that bend.
    corner : (nt, 3) int
        Vertices of each triangle of the tree, counted within its target; without rows when nothing needs them.
    triangle_start : (T + 1,) int
    pace, point_pace : (T,), (m,) float, m/s
        Bound on how fast any vertex, or any end of a segment, moves.
    travelled, point_travelled : (T,), (m,) float, metres
        Bound on how far they have moved in the whole run.
    stamp : (nt,) int
        Number of the moment to which each triangle was brought last.
    clock : (3,) int
        Number of the present moment in the whole run; its index, and that of the one velocities are taken from or to.
    """

    moves: np.ndarray
    deforms: np.ndarray
    smooth: np.ndarray
    bends: np.ndarray
    targets: SampleTrack
    sensors: SampleTrack
    corner: np.ndarray
    triangle_start: np.ndarray
    pace: np.ndarray
    point_pace: np.ndarray
    travelled: np.ndarray
    point_travelled: np.ndarray
    stamp: np.ndarray
    clock: np.ndarray


def vertex_speed_bound(found: SampleWindow | None) -> float:
    """Bound on the speed of the vertices of a window, m/s."""
    if found is None or len(found.spans) == 0:
        return 0.0
    step = np.linalg.norm(np.diff(found.samples[:, :, :3], axis=0), axis=2)
    return float((step.max(axis=1, initial=0.0) / found.spans).max())


def point_speed_bound(found: SampleWindow | None, reach: float) -> float:
    """Bound on the speed of both ends of the segments of a window's contact points, m/s.

    A unit vector that goes straight to another and is stretched to its length turns fastest half-way.
    """
    if found is None or len(found.spans) == 0:
        return 0.0
    turn = np.linalg.norm(np.diff(found.samples[:, :, 3:6], axis=0), axis=2)
    turn = turn / np.sqrt(np.maximum(1.0 - 0.25 * turn**2, 1e-3))
    step = np.linalg.norm(np.diff(found.samples[:, :, :3], axis=0), axis=2) + reach * turn
    return float((step.max(axis=1, initial=0.0) / found.spans).max())


@kernel
def at_moment(found, moment, thing, i, column):
    """One value of a track at a moment; exact at the samples, and where two samples are the same."""
    row, share = found.row[moment, thing] + i, found.share[moment, thing]
    before = found.values[row, column]
    if share == 0.0:
        return before
    after = found.values[row + found.stride[thing], column]
    if share == 1.0:
        return after
    return before + share * (after - before)


@kernel
def refit_boxes(surfaces, tree):
    """Fit the boxes of deforming targets around all places of their triangles in this frame."""
    bounds, found = tree.bounds, surfaces.targets
    for target in range(len(surfaces.deforms)):
        if not surfaces.deforms[target]:
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
def place_triangle(i, target, surfaces, tree):
    """Bring a triangle of a deforming target to the present moment: corners and normal."""
    if surfaces.stamp[i] == surfaces.clock[0]:
        return
    surfaces.stamp[i] = surfaces.clock[0]
    faces, moment = tree.faces, surfaces.clock[1]
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
def place_all_triangles(target, surfaces, tree):
    """Bring all triangles of a target to the present moment."""
    if surfaces.deforms[target]:
        for i in range(surfaces.triangle_start[target], surfaces.triangle_start[target + 1]):
            place_triangle(i, target, surfaces, tree)


@kernel
def place_listed_triangles(target, first, stop, near, number, surfaces, tree):
    """Bring the triangles that contact points can meet to the present moment: the lists from slot `first` to `stop`."""
    if not surfaces.deforms[target]:
        return
    for slot in range(first, stop):
        if number[slot] < 0:
            place_all_triangles(target, surfaces, tree)
            return
        for j in range(number[slot]):
            place_triangle(near[slot, j], target, surfaces, tree)


def corners_of(meshes: Sequence, tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of each triangle in the tree's order, (nt, 3) int, and where each mesh's triangles start, (T + 1,) int."""
    start = np.cumsum([0] + [len(mesh.triangles) for mesh in meshes])
    corner = [mesh.triangles[tree.source[a:b]] for mesh, a, b in zip(meshes, start[:-1], start[1:], strict=True)]
    return np.ascontiguousarray(np.concatenate(corner), dtype=np.int64), start


@kernel
def point_at(surfaces, moment, sensor, i):
    """Position and unit normal of a contact point of a bending sensor."""
    found = surfaces.sensors
    x, y, z = (
        at_moment(found, moment, sensor, i, 0),
        at_moment(found, moment, sensor, i, 1),
        at_moment(found, moment, sensor, i, 2),
    )
    nx, ny, nz = (
        at_moment(found, moment, sensor, i, 3),
        at_moment(found, moment, sensor, i, 4),
        at_moment(found, moment, sensor, i, 5),
    )
    scale = 1.0 / max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
    return x, y, z, scale * nx, scale * ny, scale * nz


@kernel
def frame_at(surfaces, moment, sensor, i):
    """Position of a contact point of a bending sensor, and normal, x axis and y axis of its texel there: twelve numbers."""
    found = surfaces.sensors
    x, y, z, nx, ny, nz = point_at(surfaces, moment, sensor, i)
    tx, ty, tz = (
        at_moment(found, moment, sensor, i, 6),
        at_moment(found, moment, sensor, i, 7),
        at_moment(found, moment, sensor, i, 8),
    )
    out = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - out * nx, ty - out * ny, tz - out * nz
    scale = 1.0 / max(math.sqrt(tx * tx + ty * ty + tz * tz), 1e-300)
    tx, ty, tz = scale * tx, scale * ty, scale * tz
    return x, y, z, nx, ny, nz, tx, ty, tz, ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx


@kernel
def set_moment(now, other, dt, model, surfaces):
    """Go on to another moment; the contact points of bending sensors move there.

    Parameters
    ----------
    now, other : int
        The moment, and the next or the last one, by which velocities are told.
    dt : float, seconds
        Since the moment before, at the most.
    """
    surfaces.clock[0] += 1
    surfaces.clock[1], surfaces.clock[2] = now, other
    for target in range(len(surfaces.deforms)):
        surfaces.travelled[target] += dt * surfaces.pace[target]
    for sensor in range(len(surfaces.bends)):
        if surfaces.bends[sensor]:
            surfaces.point_travelled[sensor] += dt * surfaces.point_pace[sensor]
            start = model.point_start[sensor]
            for i in range(model.point_start[sensor + 1] - start):
                frame = frame_at(surfaces, now, sensor, i)
                for column in range(12):
                    model.points[start + i, column] = frame[column]
