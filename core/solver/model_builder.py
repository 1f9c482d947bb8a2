# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenario → the kernels' arrays: :class:`.SolverModel` and the first :class:`.State`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effects.engine.compiled_program import EffectProgram, compile_program
from ..effects.engine.registry import mounted_texels
from ..geometry.contact_points import ContactPoints
from ..geometry.mesh import TriangleMesh
from ..geometry.rotations import rotation_matrices
from ..laws.contact_law import ContactLaw, contact_law, coupling
from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..model.shared_results import SharedResults
from .detection.deformation import bounding_sphere, point_rows
from .detection.neighbour_lists import MAX_RADIUS_SHARE
from .dynamics.actuators import drive_table
from .dynamics.modes import number_unknowns
from .solver_model import NO_TRIANGLE, Bodies, Drives, Pairs, Points, Sensors, SolverModel, State

MAX_PAIR_POINTS = 512
"""Most contact points of a pair, which is what a thread takes at a time."""


def build_model(
    scenario: Scenario, center: np.ndarray, points: list[ContactPoints], dt: float, shared: SharedResults
) -> SolverModel:
    """Flatten a scenario into the kernels' arrays.

    Parameters
    ----------
    scenario : Scenario
    center : (b, 3) float, metres
        Reference point of each body in its frame.
    points : list of ContactPoints
        Of each sensor.
    dt : float, seconds
        Length of a step.
    shared : SharedResults
    """
    rows = [point_rows(mounted_texels(s), p, center[s.body]) for s, p in zip(scenario.sensors, points, strict=True)]
    first_point = np.cumsum([0] + [len(block) for block in rows])
    drive_of, gains = drive_table(scenario)
    mode = np.array([int(body.mode) for body in scenario.bodies])
    first_unknown, drive_unknown, unknowns = number_unknowns(mode, drive_of)
    return SolverModel(
        bodies=_bodies(scenario, mode, first_unknown, unknowns),
        sensors=sensors_of(scenario, rows, first_point),
        points=_points(scenario, rows, points),
        pairs=pairs_of(scenario, first_point, shared),
        drives=_drives(scenario, drive_of, drive_unknown, gains),
        effects=step_program(scenario.sensors, dt),
    )


def step_program(sensors: Sequence[Sensor], dt: float) -> EffectProgram:
    """Return the laws that act on the forces of sensors, for steps of `dt` seconds."""
    return compile_program([sensor.effects for sensor in sensors], [dt, 0.0])  # STEP and NOW of effect_kernels


def texel_starts(scenario: Scenario) -> np.ndarray:
    """(m + 1,) int: where the texels of each sensor begin among those of all."""
    return np.cumsum([0] + [len(sensor.texels) for sensor in scenario.sensors])


def start_poses(scenario: Scenario, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (b, 3) positions, m, of the points of bodies that are followed, and (b, 4) quaternions, at the first frame."""
    quaternion = np.array([body.motion.quaternions[0] for body in scenario.bodies], dtype=float)
    origin = np.array([body.motion.positions[0] for body in scenario.bodies], dtype=float)
    return origin + np.einsum("bij,bj->bi", rotation_matrices(quaternion), center), quaternion


def initial_state(scenario: Scenario, model: SolverModel, center: np.ndarray) -> State:
    """Return the state at the first frame; keyframed bodies count as at rest until they move."""
    position, quaternion = start_poses(scenario, center)
    velocity = [
        np.concatenate([body.velocity, body.angular_velocity]) if body.free else np.zeros(6) for body in scenario.bodies
    ]
    slots = int((model.pairs.stop_point - model.pairs.first_point).sum())
    return State(
        position=position,
        quaternion=quaternion,
        velocity=np.array(velocity, dtype=float),
        triangle=np.full(slots, NO_TRIANGLE),
        bristle=np.zeros((slots, 3)),
        pressed_share=np.zeros(slots),
        drives=np.zeros((len(model.drives.gains), 3)),
        effect_memory=model.effects.memory(len(model.points.frame)),
        stored_energy=np.zeros(len(model.pairs.sensor)),
    )


def _bodies(scenario: Scenario, mode: np.ndarray, first_unknown: np.ndarray, unknowns: int) -> Bodies:
    bodies = scenario.bodies
    return Bodies(
        mode=mode,
        first_unknown=first_unknown,
        unknowns=unknowns,
        mass=np.array([body.mass for body in bodies], dtype=float),
        inertia=np.ascontiguousarray([body.inertia for body in bodies], dtype=float),
        inverse_inertia=np.array([np.linalg.inv(body.inertia) if body.free else np.zeros((3, 3)) for body in bodies]),
        gravity=np.array(scenario.gravity, dtype=float),
        initial_velocity=np.array([body.velocity if body.free else np.zeros(3) for body in bodies], dtype=float),
    )


def sensors_of(scenario: Scenario, rows: list[np.ndarray], first_point: np.ndarray) -> Sensors:
    """Return the model's sensors, whose contact points have these rows of :attr:`.Points.frame`."""
    reach = [sensor.parameters.max_penetration for sensor in scenario.sensors]
    spheres = [bounding_sphere(block, length) for block, length in zip(rows, reach, strict=True)]
    return Sensors(
        first_point=first_point,
        max_penetration=np.array(reach, dtype=float),
        center=np.array([center for center, _ in spheres]),
        radius=np.array([radius for _, radius in spheres]),
    )


def _points(scenario: Scenario, rows: list[np.ndarray], points: list[ContactPoints]) -> Points:
    starts = texel_starts(scenario)
    return Points(
        frame=np.ascontiguousarray(np.vstack(rows)),
        texel=np.concatenate([p.texel + start for p, start in zip(points, starts, strict=False)]),
        multipliers=_painted_multipliers(scenario.sensors, points),
    )


def _painted_multipliers(sensors: tuple[Sensor, ...], points: list[ContactPoints]) -> np.ndarray:
    """(N, 2) multipliers of stiffness and friction of all contact points; no rows when no sensor is painted."""
    if all(s.painted.k is None and s.painted.friction is None for s in sensors):
        return np.zeros((0, 2))
    columns = [
        np.concatenate(
            [np.ones(len(p.texel)) if values is None else values[p.texel] for p, values in zip(points, chosen, strict=True)]
        )
        for chosen in ([s.painted.k for s in sensors], [s.painted.friction for s in sensors])
    ]
    return np.ascontiguousarray(np.column_stack(columns), dtype=float)


def pairs_of(scenario: Scenario, first_point: np.ndarray, shared: SharedResults) -> Pairs:
    """Return the model's pairs; `first_point` is that of :class:`.Sensors`."""
    sensors, targets = scenario.sensors, scenario.targets
    parts = [  # sensor, target, first point, and the one after the last
        (i, j, first, min(first + MAX_PAIR_POINTS, first_point[i + 1]))
        for i, s in enumerate(sensors)
        for j, t in enumerate(targets)
        if s.body != t.body
        for first in range(first_point[i], first_point[i + 1], MAX_PAIR_POINTS)
    ]
    couplings = [coupling(scenario, i, j) for i, j, _, _ in parts]
    overlap, weight = [share for share, _ in couplings], [weight for _, weight in couplings]
    share = [w / sensors[i].parameters.points_per_texel for (i, _, _, _), w in zip(parts, weight, strict=True)]
    laws = [contact_law(sensors[part[0]].parameters, f, o) for part, f, o in zip(parts, share, overlap, strict=True)]
    return Pairs(
        sensor=np.array([i for i, _, _, _ in parts], np.int64),
        target=np.array([j for _, j, _, _ in parts], np.int64),
        sensor_body=np.array([sensors[i].body for i, _, _, _ in parts], np.int64),
        target_body=np.array([targets[j].body for _, j, _, _ in parts], np.int64),
        first_point=np.array([first for _, _, first, _ in parts], np.int64),
        stop_point=np.array([stop for _, _, _, stop in parts], np.int64),
        first_slot=np.cumsum([0, *(stop - first for _, _, first, stop in parts)])[:-1],
        law=np.array(laws, dtype=float).reshape(-1, len(ContactLaw._fields)),
        force_weight=np.array(weight, dtype=float),
        force_share=np.array(share, dtype=float),
        overlap_share=np.array(overlap, dtype=float),
        max_tube_radius=np.array([MAX_RADIUS_SHARE * sensors[i].parameters.max_penetration for i, _, _, _ in parts]),
        max_list_radius=np.array([_list_radius(sensors[i], shared.of(_median_edge, targets[j].mesh)) for i, j, _, _ in parts]),
    )


def _list_radius(sensor: Sensor, edge: float) -> float:
    """How far around a texel triangles are listed at the most: a tenth of the target's median edge, so that they are few."""
    return min(0.1 * edge, 0.1 * sensor.parameters.max_penetration)


def _median_edge(mesh: TriangleMesh) -> float:
    a, b, _ = mesh.triangles.T
    return float(np.median(np.linalg.norm(mesh.vertices[b] - mesh.vertices[a], axis=1)))


def _drives(scenario: Scenario, drive_of: np.ndarray, unknown: np.ndarray, gains: np.ndarray) -> Drives:
    bodies = scenario.bodies
    return Drives(
        of_body=drive_of,
        axis=np.array([np.zeros(3) if body.drive is None else body.drive.axis for body in bodies], dtype=float),
        axis_in_world=np.array([body.drive is not None and body.drive.axis_in_world for body in bodies]),
        unknown=unknown,
        gains=gains,
    )
