# SPDX-License-Identifier: GPL-3.0-or-later
"""The arrays of a simulation, which a later one takes over where only paths of bodies and parameters of sensors differ.

A short run takes less time than making these arrays does, and than telling compiled code where they are.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

from ..compiled.thread_team import make_queue
from ..effects.engine.compiled_program import EffectProgram, TexelContacts, compile_program
from ..effects.engine.registry import mounted_texels
from ..geometry.bvh import Tree, build_tree
from ..geometry.contact_points import ContactPoints, contact_points
from ..geometry.mesh import TriangleMesh, is_closed
from ..geometry.rotations import rotation_matrices, write_backward_step_motion
from ..laws.contact_law import ContactLaw, contact_law, coupling
from ..model.body import Body
from ..model.scenario import Scenario, Target
from ..model.sensor import Sensor
from ..model.shared_results import SharedResults
from .detection.deformation import DeformingSurfaces, bounding_sphere, point_rows
from .detection.detection_data import LANES, ROW, DetectionData, SurfaceMotion, TargetShapes
from .detection.neighbour_lists import MAX_RADIUS_SHARE, neighbour_lists_for
from .dynamics.actuators import drive_table
from .dynamics.modes import number_unknowns, pairs_with_account
from .parallel_loops import prepare_pair_loops
from .solver_model import NO_TRIANGLE, Bodies, Drives, Pairs, Points, Sensors, SolverModel, State
from .workspace import SUMS, BodyWork, ContactWork, DriveWork, EffectWork, EnergyWork, LinearSystem, PairWork, Workspace

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
    return compile_program([sensor.effects for sensor in sensors], [dt, 0.0])  # FULL_STEP and NO_TIME of effect_kernels


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
        max_list_radius=np.array(
            [  # a tenth of the target's median edge at the most, so that lists are short
                0.1 * min(shared.of(_median_edge, targets[j].mesh), sensors[i].parameters.max_penetration)
                for i, j, _, _ in parts
            ]
        ),
    )


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


def workspace_for(model: SolverModel, state: State, surfaces: SurfaceMotion, queue: np.ndarray) -> Workspace:
    """Allocate the working memory of a run."""
    b, q, n = len(state.position), len(model.pairs.sensor), max(6, model.bodies.unknowns)
    slots = np.diff(model.pairs.first_slot, append=len(state.triangle))
    blocks = np.cumsum([0, *(-(-slots // LANES))])
    deforming = surfaces.sensor_deforms[model.pairs.sensor] | surfaces.target_deforms[model.pairs.target]
    effect_blocks, effect_points = (0, 0) if model.effects.is_empty else (blocks[-1], len(model.points.frame))
    return Workspace(
        bodies=_body_work(state),
        contacts=ContactWork(
            rows=np.zeros((blocks[-1], ROW)),
            slots=np.zeros((blocks[-1], LANES), np.int64),
            surface_velocity=np.zeros((blocks[-1] if deforming.any() else 0, 3 * LANES)),
            deforming=deforming,
            first_block=blocks[:-1],
            number=np.zeros(q, np.int64),
            too_deep=np.zeros(q, np.int64),
            most_too_deep=np.zeros(q, np.int64),
        ),
        pairs=PairWork(
            sums=np.zeros((q, SUMS * LANES)),
            pose=np.zeros((q, 12)),
            rotations=np.zeros((q, 3, 3, 3)),
            motion=np.zeros((q, 12)),
            known_motion=np.zeros((q, 12)),
        ),
        system=_linear_system(n),
        drives=DriveWork(np.zeros((b, 3)), np.zeros(len(model.drives.gains)), np.zeros(len(model.drives.gains))),
        effects=EffectWork(
            contacts=TexelContacts.zeros(effect_blocks, LANES),
            points=TexelContacts.zeros(1, effect_points),
            point_numbers=np.arange(len(model.points.frame)),
        ),
        energy=_energy_work(model, deforming),
        step=np.zeros(1),
        queue=queue,
        pair_loops=np.zeros(6, np.int64),
    )


def _body_work(state: State) -> BodyWork:
    b = len(state.position)
    step_motion = np.zeros((b, 12))
    for body in range(b):
        write_backward_step_motion(state.velocity[body], 1e-9, step_motion[body])
    return BodyWork(
        rotation=np.zeros((b, 3, 3)),
        inertia=np.zeros((b, 3, 3)),
        step_motion=step_motion,
        known_step_motion=np.zeros((b, 12)),
        spin_correction=np.zeros((b, 3)),
        end_quaternion=np.zeros((b, 4)),
        end_rotation=np.zeros((b, 3, 3)),
        end_spin=np.zeros((b, 3)),
        unbooked_energy=np.zeros(b),
        contact_force=np.zeros(b),
        velocity_before=np.zeros((b, 6)),
        carrier_velocity=np.zeros((b, 6)),
    )


def _linear_system(n: int) -> LinearSystem:
    return LinearSystem(
        matrix=np.zeros((n, n)),
        vector=np.zeros(n),
        momentum=np.zeros(n),
        guess=np.zeros(n),
        free_solution=np.zeros(n),
        previous=np.zeros((2, n)),
        block=np.zeros((6, 6)),
        wrench=np.zeros(6),
        map_a=np.zeros((6, 6)),
        map_b=np.zeros((6, 6)),
    )


def _energy_work(model: SolverModel, deforming: np.ndarray) -> EnergyWork:
    pairs, q = model.pairs, len(model.pairs.sensor)
    effects = model.effects
    pulls = effects.first_unclipped[pairs.sensor] < effects.first_law[pairs.sensor + 1]  # as compiled_program.may_pull
    return EnergyWork(
        tracked=pairs_with_account(model.bodies.mode, pairs) & ~deforming & ~pulls,
        force=np.zeros((q, 6)),
        new_force=np.zeros((q, 6)),
        previous_force=np.zeros((q, 6)),
        work=np.zeros(q),
        available=np.zeros(q),
        scale=np.ones(q),
        scale_low=np.zeros(q),
        scale_high=np.ones(q),
    )


_BODY_FIELDS = tuple(item.name for item in fields(Body) if item.name != "motion")
_TARGET_FIELDS = tuple(item.name for item in fields(Target))
_SENSOR_FIELDS = tuple(item.name for item in fields(Sensor) if item.name != "parameters")

_ALIGNED = 64
"""Bytes of a line of a processor's cache."""


class Structures:
    """Arrays of one simulation for the kernels, at its beginning.

    Parameters
    ----------
    scenario : Scenario
    center : (b, 3) float, metres
        Point of each body, in its frame, that is followed.
    dt : float, seconds
        Length of a step.
    threads : int, optional
        See :func:`.thread_team.make_queue`.
    shared : SharedResults

    Attributes
    ----------
    deforming_surfaces : DeformingSurfaces
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace
    helpers : int
        Threads that help with the steps.
    """

    def __init__(self, scenario: Scenario, center: np.ndarray, dt: float, threads: int | None, shared: SharedResults):
        tree = _tree_of_targets(scenario, center, shared)
        closed = [shared.of(is_closed, target.mesh.triangles) for target in scenario.targets]
        points = [shared.of(contact_points, s.texels, s.parameters.points_per_texel) for s in scenario.sensors]
        self.model = build_model(scenario, center, points, dt, shared)
        self.deforming_surfaces = DeformingSurfaces(scenario, center, points, tree, self.model)
        surface_motion = self.deforming_surfaces.at(np.zeros(1))
        self.state = initial_state(scenario, self.model, center)
        lists = neighbour_lists_for(len(self.state.triangle), len(self.model.pairs.sensor))
        self.detection = DetectionData(tree, lists, surface_motion, TargetShapes.of([None] * len(closed), closed))
        queue, self.helpers = make_queue(len(self.state.triangle), threads)
        self.workspace = workspace_for(self.model, self.state, surface_motion, queue)
        self._center, self._sensors = center, scenario.sensors
        self._memory = self._beginning = np.zeros(0, np.uint8)

    def keep_beginning(self) -> None:
        """Put all that a run changes into one piece of memory, and remember it for :meth:`begin_again`."""
        prepare_pair_loops(self.model, self.detection, self.state, self.workspace)
        detection = self.detection
        parts = (detection.neighbours, detection.surfaces, self.state, self.workspace)
        self._memory = np.zeros(_in_one_piece(parts, None)[1], np.uint8)
        (neighbours, surfaces, self.state, self.workspace), _ = _in_one_piece(parts, self._memory)
        self.detection = detection._replace(neighbours=neighbours, surfaces=surfaces)
        self._beginning = self._memory.copy()

    def begin_again(self, scenario: Scenario, shared: SharedResults) -> None:
        """Bring the numbers of :meth:`keep_beginning` back, with another scenario's poses at first and sensors' parameters."""
        np.copyto(self._memory, self._beginning)
        self.state.position[:], self.state.quaternion[:] = start_poses(scenario, self._center)
        if any(now is not before for now, before in zip(scenario.sensors, self._sensors, strict=True)):
            starts = self.model.sensors.first_point
            sensors = sensors_of(scenario, np.split(self.model.points.frame, starts[1:-1]), starts)
            pairs = pairs_of(scenario, starts, shared)
            for array, now in zip((*self.model.sensors, *self.model.pairs), (*sensors, *pairs), strict=True):
                array[...] = now
            self._sensors = scenario.sensors


class LastStructures:
    """The structures that simulations of similar scenarios have one after the other."""

    def __init__(self, *_: object):
        self._kept: Structures | None = None
        self._user: weakref.ref[Any] | None = None

    def acquire(self, user: object, scenario: Scenario, shared: SharedResults, make: Callable[[], Structures]) -> Structures:
        """Return structures at the beginning of a scenario: new ones, of `make`, while the last user of the kept ones is there.

        Nobody else gets those of `user` as long as it lives.
        """
        if self._user is not None and self._user() is not None:
            return make()
        if self._kept is not None:
            self._kept.begin_again(scenario, shared)
            found = self._kept
        else:
            found = make()
            if self._user is not None:  # not the first time: there may be many more
                found.keep_beginning()
                self._kept = found
        self._user = weakref.ref(user)
        return found


def structures_for(
    user: object, scenario: Scenario, center: np.ndarray, dt: float, threads: int | None, shared: SharedResults
) -> Structures:
    """Return structures for a simulation: those of an earlier one with the same `shared` that is gone, if they fit."""
    make = partial(Structures, scenario, center, dt, threads, shared)
    if any_deforms(scenario):
        return make()
    return shared.of(LastStructures, dt, threads or 0, *_shape_key(scenario)).acquire(user, scenario, shared, make)


def any_deforms(scenario: Scenario) -> bool:
    """Return whether a target or a sensor deforms."""
    deformations = [part.deformation for part in scenario.targets] + [part.deformation for part in scenario.sensors]
    return any(found is not None for found in deformations)


def _shape_key(scenario: Scenario) -> Iterator[Any]:
    """Yield all that structures depend on, apart from what :meth:`Structures.begin_again` sets."""
    yield len(scenario.sensors)
    for sensor in scenario.sensors:
        yield sensor.parameters.points_per_texel
        yield from (getattr(sensor, name) for name in _SENSOR_FIELDS)
    for target in scenario.targets:
        yield from (getattr(target, name) for name in _TARGET_FIELDS)
    yield np.asarray(scenario.gravity, float).tobytes()
    for body in scenario.bodies:
        for name in _BODY_FIELDS:
            value = getattr(body, name)
            yield value.tobytes() if isinstance(value, np.ndarray) else value


def _in_one_piece(part: Any, memory: np.ndarray | None, at: int = 0) -> tuple[Any, int]:
    """Return a tuple of arrays and of such tuples with its arrays in a piece of memory, and the place behind them.

    Without memory, only the place is found.
    """
    if isinstance(part, tuple):
        own = []
        for field in part:
            moved, at = _in_one_piece(field, memory, at)
            own.append(moved)
        return (type(part)(*own) if hasattr(part, "_fields") else tuple(own)), at
    if not isinstance(part, np.ndarray) or part.size == 0:
        return part, at
    stop = at + part.nbytes
    if memory is not None:
        place = memory[at:stop].view(part.dtype).reshape(part.shape)
        place[...] = part
        part = place
    return part, -(-stop // _ALIGNED) * _ALIGNED


def _tree_of_targets(scenario: Scenario, center: np.ndarray, shared: SharedResults) -> Tree:
    """Return the tree of all targets; that of what deforms is the simulation's own."""
    centers = np.array([center[target.body] for target in scenario.targets]).tobytes()
    meshes = [target.mesh for target in scenario.targets]
    return _tree_about(centers, *meshes) if any_deforms(scenario) else shared.of(_tree_about, centers, *meshes)


def _tree_about(centers: bytes, *meshes: TriangleMesh) -> Tree:
    """Return the tree of meshes whose points are seen from others, (m, 3) float as bytes, m."""
    middles = np.frombuffer(centers).reshape(-1, 3)
    return build_tree([replace(mesh, vertices=mesh.vertices - middle) for mesh, middle in zip(meshes, middles, strict=True)])
