# SPDX-License-Identifier: GPL-3.0-or-later
"""Warns of targets that are too fast for the time step: that go through a good part of a sensor's skin within one step.

Contacts are looked for at the end of each step. A plate that moves by more than the skin's depth in a step is before it at one
look and behind it at the next, and no contact is found. The numbers are left as they are; a sentence names frame and object.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..compiled.kernels import kernel
from ..geometry.rotations import rotation_matrices
from ..model.scenario import Scenario, Target
from ..model.sensor import Sensor
from ..model.shared_results import SharedResults

LARGEST_SHARE = 0.5
"""Share of the maximum penetration that a target may go into a sensor in one step: so it is found in two steps at least."""
GOOD_SHARE = 0.1
"""The same share for the step that a warning advises."""
MOST_TEXELS = 256
"""Texels of a sensor that are followed, evenly chosen."""
_MOST_TESTS = 1 << 18
"""Pairs of a segment and a triangle that are tested at once."""


class CrossingLimits(NamedTuple):
    """How far the bodies of p pairs may move in a step.

    Attributes
    ----------
    pairs : (p, 2) int
        Bodies of the sensor and of the target.
    limits : (p,) float, metres
    moved : (b,) bool
        Bodies that forces move.
    radius : (b,) float, metres
        Distance of a body's farthest point from its centre.
    """

    pairs: np.ndarray
    limits: np.ndarray
    moved: np.ndarray
    radius: np.ndarray


class FastCrossings:
    """Looks for targets that cross the surface of a sensor too fast, frame by frame.

    Parameters
    ----------
    scenario : Scenario
    center : (b, 3) float, metres
        Point of each body, in its frame, whose path is given.
    shared : SharedResults, optional
        Of simulations.
    """

    def __init__(self, scenario: Scenario, center: np.ndarray, shared: SharedResults | None = None):
        shared = shared or SharedResults()
        self._scenario, self._center = scenario, center
        radius = np.zeros(len(scenario.bodies))
        for body, points in [(t.body, t.mesh.vertices) for t in scenario.targets] + [
            (s.body, s.texels.position) for s in scenario.sensors
        ]:
            radius[body] = max(radius[body], shared.of(_reach, points, center[body].tobytes()))
        self._pairs = [(s, t) for s in scenario.sensors for t in scenario.targets if s.body != t.body]
        self._warned = np.zeros(len(self._pairs), np.bool_)
        self.limits = CrossingLimits(
            pairs=np.array([(s.body, t.body) for s, t in self._pairs], np.int64).reshape(-1, 2),
            limits=np.array([LARGEST_SHARE * s.parameters.max_penetration for s, _ in self._pairs], float),
            moved=np.array([body.moved_by_forces for body in scenario.bodies], np.bool_),
            radius=radius,
        )

    def warnings(self, frame: int, positions: np.ndarray, quaternions: np.ndarray, dt: float) -> list[str]:
        """Return a sentence for each pair of a sensor and a target that is too fast in this frame and was not before.

        Parameters
        ----------
        frame : int
            At the end of the path.
        positions, quaternions : (steps + 1, b, 3) float, metres, and (steps + 1, b, 4) float
            Paths of the bodies, step by step.
        dt : float, seconds
        """
        travel = np.linalg.norm(np.diff(positions, axis=0), axis=2).max(axis=0)
        cosines = np.abs(np.einsum("sbi,sbi->sb", quaternions[1:], quaternions[:-1])).min(axis=0)
        travel = travel + 2.0 * np.arccos(np.minimum(cosines, 1.0)) * self.limits.radius
        found = []
        for i, (sensor, target) in enumerate(self._pairs):
            if self._warned[i] or travel[sensor.body] + travel[target.body] < self.limits.limits[i]:
                continue
            deepest = self._deepest_entry(sensor, target, positions, quaternions, self.limits.limits[i])
            if deepest > 0.0:
                self._warned[i] = True
                advised = dt * GOOD_SHARE * sensor.parameters.max_penetration / deepest
                found.append(
                    f"Frame {frame}: '{target.name}' goes {deepest * 1e3:.3g} mm into '{sensor.name}' within one time step of "
                    f"{dt * 1e3:.3g} ms and may pass through its {sensor.parameters.max_penetration * 1e3:.3g} mm "
                    "without contact: "
                    f"set a time step of {advised * 1e3:.2g} ms or less, or move slower."
                )
        return found

    def _deepest_entry(
        self, sensor: Sensor, target: Target, positions: np.ndarray, quaternions: np.ndarray, limit: float
    ) -> float:
        """Return how far along a texel's normal the target goes in the fastest step in which it enters, metres; or zero."""
        texels = sensor.texels
        chosen = np.unique(np.linspace(0, len(texels) - 1, min(len(texels), MOST_TEXELS)).astype(int))
        to_world = rotation_matrices(quaternions[:, sensor.body])
        to_target = np.swapaxes(rotation_matrices(quaternions[:, target.body]), 1, 2)
        turn = to_target @ to_world
        offset = np.einsum("sij,sj->si", to_target, positions[:, sensor.body] - positions[:, target.body])
        points = np.einsum("sij,nj->sni", turn, texels.position[chosen] - self._center[sensor.body]) + offset[:, None]
        normals = np.einsum("sij,nj->sni", turn[:-1], texels.normal[chosen])
        moves = np.diff(points, axis=0)
        along = np.einsum("sni,sni->sn", moves, normals)
        fast = along >= limit
        if not fast.any():
            return 0.0
        vertices = target.mesh.vertices - self._center[target.body]
        start, move, along = points[:-1][fast], moves[fast], along[fast]
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        near = ((np.minimum(start, start + move) <= high) & (np.maximum(start, start + move) >= low)).all(axis=1)
        start, move, along = start[near], move[near], along[near]
        enters = _entering(start, move, vertices[target.mesh.triangles])
        return float(along[enters].max(initial=0.0))


def _reach(points: np.ndarray, center: bytes) -> float:
    """Return the distance, m, of the farthest of (m, 3) points from a point, (3,) float as bytes."""
    return float(np.linalg.norm(points - np.frombuffer(center), axis=1).max())


@kernel
def may_cross(
    limits: CrossingLimits,
    dt: float,
    velocities: np.ndarray,
    before: tuple[np.ndarray, np.ndarray],
    after: tuple[np.ndarray, np.ndarray],
) -> bool:
    """Return whether the bodies of any pair together move by its limit in a step of a frame: compiled, as each frame asks.

    Parameters
    ----------
    limits : CrossingLimits
    dt : float, seconds
    velocities : (steps, b, 6) float, m/s and rad/s
        Of the steps; they count for the bodies that no force moves.
    before, after : ((b, 3) float, (b, 4) float)
        Positions and quaternions at the beginning and the end of the frame.
    """
    for pair in range(len(limits.pairs)):
        travel = _travel(limits.pairs[pair, 0], limits, dt, velocities, before, after)
        if travel + _travel(limits.pairs[pair, 1], limits, dt, velocities, before, after) >= limits.limits[pair]:
            return True
    return False


@kernel
def _travel(
    body: int,
    limits: CrossingLimits,
    dt: float,
    velocities: np.ndarray,
    before: tuple[np.ndarray, np.ndarray],
    after: tuple[np.ndarray, np.ndarray],
) -> float:
    """Return an upper bound of the distance that a point of a body goes in one step, metres; arguments of :func:`may_cross`."""
    steps, radius = len(velocities), limits.radius[body]
    if limits.moved[body]:
        square, cosine = 0.0, 0.0
        for axis in range(3):
            square += (after[0][body, axis] - before[0][body, axis]) ** 2
        for axis in range(4):
            cosine += after[1][body, axis] * before[1][body, axis]
        # `path_of_moved_bodies` does not turn evenly: up to half a turn its fastest step turns by less than twice the mean.
        angle = 4.0 * math.acos(min(abs(cosine), 1.0))
        return (math.sqrt(square) + angle * radius) / steps
    farthest = 0.0
    for step in range(steps):
        velocity = velocities[step, body]
        speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
        spin = math.sqrt(velocity[3] ** 2 + velocity[4] ** 2 + velocity[5] ** 2)
        farthest = max(farthest, dt * (speed + spin * radius))
    return farthest


def _entering(start: np.ndarray, move: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return which segments go into a surface from outside, (m,) bool (Möller and Trumbore, J. Graphics Tools 2, 1997).

    Parameters
    ----------
    start, move : (m, 3) float, metres
        Beginning of each segment and the vector to its end.
    corners : (t, 3, 3) float, metres
        Corners of the triangles.
    """
    result = np.zeros(len(start), bool)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    block = max(1, _MOST_TESTS // max(1, len(corners)))
    for begin in range(0, len(start), block):
        own = slice(begin, begin + block)
        way, away = move[own, None], start[own, None] - corners[:, 0]
        facing = -(way * normal).sum(axis=2)
        scale = np.where(facing > 0, facing, 1.0)
        moment = np.cross(away, way)
        u, v = (second * moment).sum(axis=2) / scale, -(first * moment).sum(axis=2) / scale
        share = (away * normal).sum(axis=2) / scale
        hit = (facing > 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (share >= 0) & (share <= 1)
        result[own] = hit.any(axis=1)
    return result


def path_of_moved_bodies(
    before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray], steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return straight paths between two states of bodies: positions (steps + 1, b, 3) and unit quaternions (steps + 1, b, 4).

    Parameters
    ----------
    before, after : ((b, 3) float, (b, 4) float)
        Positions and quaternions at the beginning and the end of a frame.
    steps : int
    """
    share = np.linspace(0.0, 1.0, steps + 1)[:, None, None]
    sign = np.where((before[1] * after[1]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    quaternions = before[1] + share * (sign * after[1] - before[1])
    return before[0] + share * (after[0] - before[0]), quaternions / np.linalg.norm(quaternions, axis=2, keepdims=True)
