# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenario → Recording: the substep loop.

Each substep: find the contacts where the bodies are, solve for the free bodies' velocities at the step's end (implicit in every
contact's stiffness and damping), bring the bristles forward, move the bodies. Each frame: find the contacts once more and
write down what the sensors feel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ..compiled.thread_team import helper_threads, make_queue
from ..effects.engine.compiled_program import compile_program
from ..effects.engine.sensor_effects import check_scenario, mounted_texels
from ..geometry.bvh import Tree, build_tree
from ..geometry.contact_points import ContactPoints, contact_points
from ..geometry.mesh import is_closed
from ..geometry.rotations import DRIVEN, FREE, KEYFRAMED, quaternion_product, rotation_matrices, rotation_vectors
from ..jobs.job_runner import run_job
from ..jobs.progress import Job, Progress
from ..laws.contact import SolverModel, State, parameter_row
from ..laws.series_compliance import coupling
from ..model.pose_interpolation import poses_at
from ..model.recording import Frame, Recording, SensorFrame
from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..model.target import Target
from ..response.readings import ReadoutChain
from .detection.deformation import SurfaceMotion
from .detection.deforming_surfaces import DeformingSurfaces, bounding_sphere, point_rows
from .detection.narrow_phase import count_too_deep
from .detection.neighbour_lists import MAX_RADIUS_SHARE, NeighbourLists, neighbour_lists_for
from .dynamics.actuators import drive_table
from .dynamics.drive_commands import DriveCommands
from .dynamics.passivity import credit_initial_contacts
from .parallel_loops import find_all_contacts, help_with_loops
from .substep import advance_steps
from .texel_readout import read_texels
from .time_step_adviser import plan
from .workspace import Workspace, contacts_of, workspace_for

MAX_PAIR_POINTS = 512
"""Most contact points of a pair: what a thread takes at a time."""


class Simulation:
    """A scenario on its way through time.

    Parameters
    ----------
    scenario : Scenario
    threads : int, optional
        How many to compute with (see :func:`.thread_team.make_queue`); the numbers are the same, bit by bit.

    Raises
    ------
    PalpateError
        The scenario does not make a run (see :func:`.check_scenario`).

    Attributes
    ----------
    frame : int
        Where the state stands.
    dt : float, seconds
        Substep in use: a whole number of them makes a frame.
    step_reason : str
        What the step is and why, for the user.
    warnings : list of str
        One sentence each; grows while the simulation runs.
    """

    def __init__(self, scenario: Scenario, threads: int | None = None):
        check_scenario(scenario)
        self.scenario = scenario
        self.frame = scenario.frame_start
        self.warnings: list[str] = []
        chosen = plan(scenario)
        self.dt, self.substeps, self.step_reason = chosen.dt, chosen.substeps, chosen.reason
        self._motions = [body.motion for body in scenario.bodies]
        # Bodies that forces move are followed at their centre of mass, keyframed ones at their origin.
        self._center = np.array([body.center_of_mass if body.moved_by_forces else np.zeros(3) for body in scenario.bodies])
        meshes = [replace(t.mesh, vertices=t.mesh.vertices - self._center[t.body]) for t in scenario.targets]
        self._tree = build_tree(meshes)
        self._closed = [is_closed(mesh.triangles) for mesh in meshes]
        self._most_too_deep = 0  # most texels at once that the substeps of the last frame found past their reach
        points = [contact_points(s.texels, s.parameters.points_per_texel) for s in scenario.sensors]
        self._model = _model(scenario, self._center, points, self.dt)
        self._deforming_surfaces = DeformingSurfaces(scenario, self._center, points, self._tree, self._model)
        self._surface_motion = self._deforming_surfaces.at(np.zeros(1))
        self._state = _initial_state(scenario, self._model, self._center)
        self._neighbour_lists = neighbour_lists_for(len(self._state.hint), len(self._model.pairs))
        queue, self._helpers = make_queue(len(self._state.hint), threads)
        self._workspace = workspace_for(self._model, self._state, self._surface_motion, queue)
        self._readers = [ReadoutChain.of(sensor) for sensor in scenario.sensors]
        self._drive_commands = DriveCommands(scenario)
        self._texel_start = _texel_start(scenario)

    @property
    def arrays(self) -> tuple[SolverModel, Tree, NeighbourLists, SurfaceMotion, State, Workspace]:
        """What the kernels work on."""
        return self._model, self._tree, self._neighbour_lists, self._surface_motion, self._state, self._workspace

    @property
    def time(self) -> float:
        """Seconds since the first frame."""
        return (self.frame - self.scenario.frame_start) / self.scenario.fps

    def extend(
        self,
        poses: Mapping[int, tuple[np.ndarray, np.ndarray]],
        targets: Mapping[int, float] | None = None,
        vertices: Mapping[int, np.ndarray] | None = None,
        texels: Mapping[int, np.ndarray] | None = None,
        share: float = 1.0,
    ) -> None:
        """Append where keyframed bodies, and driven ones without their drives, will be next, and deforming surfaces.

        Parameters
        ----------
        poses : mapping of body index to (position (3,) m, quaternion (4,))
        targets : mapping of body index to float, optional
            Of their drives.
        vertices : mapping of target index to (nv, 3) float, metres, in the body's frame, optional
        texels : mapping of sensor index to (n, 9) float, optional
            See :attr:`.Texels.frames`.
        share : float
            Of the way to the next frame, for what is known in between: these come first, in order.
        """
        time = self._time_of(self.frame + share)
        self._deforming_surfaces.extend(time, vertices or {}, texels or {})
        for body, (position, quaternion) in poses.items():
            motion = self._motions[body]
            if motion.times[-1] < time - 1e-9:
                self._motions[body] = motion.extended(time, position, quaternion)
        self._drive_commands.extend(time, targets or {})

    def advance(self) -> Frame:
        """Bring the state one frame on and return what the sensors feel there."""
        times = self._time_of(self.frame) + np.arange(self.substeps + 1) * self.dt
        times[-1] = self._time_of(self.frame + 1)
        path = [poses_at(motion, times, self.scenario.interpolation) for motion in self._motions]
        quaternions = np.ascontiguousarray(np.stack([quaternion for _, quaternion in path], axis=1))
        positions = np.ascontiguousarray(np.stack([position for position, _ in path], axis=1))
        for body in np.flatnonzero(self._model.kind == DRIVEN):
            positions[:, body] += rotation_matrices(quaternions[:, body]) @ self._center[body]
        conjugate = quaternions[:-1] * np.array([1.0, -1.0, -1.0, -1.0])
        turns = rotation_vectors(quaternion_product(quaternions[1:], conjugate))
        velocities = np.concatenate([np.diff(positions, axis=0), turns], axis=2) / self.dt
        if self._deforming_surfaces.moves:
            self._surface_motion = self._deforming_surfaces.at(times)
        if self.frame == self.scenario.frame_start:
            find_all_contacts(-self.dt, *self.arrays)
            credit_initial_contacts(self._model, self._state, self._workspace)
        self._most_too_deep = 0
        for first, last, commands in self._drive_commands.control_intervals(times, self.dt, self._tactile):
            with helper_threads(self._workspace.queue, self._helpers, help_with_loops, *self.arrays):
                too_deep = advance_steps(self.dt, first, last, positions, quaternions, velocities, commands, *self.arrays)
            self._most_too_deep = max(self._most_too_deep, too_deep)
        self.frame += 1
        return self.observe()

    def contacts_along(
        self, body: int, positions: np.ndarray, quaternions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """Look where the first sensor meets the targets while one body goes through given poses; no time passes.

        Parameters
        ----------
        body : int
            A keyframed one; it is left at the last pose.
        positions, quaternions : (T, 3) float, metres, and (T, 4) float

        Returns
        -------
        depth : (T, n) float, metres
            Zero where nothing touches.
        normal : (T, n, 3) float
            The target's outward normal, in the frame of the sensor's body; minus the texel's where nothing touches.
        point : (T, n, 3) float, metres
            Where the contact is, in the same frame.
        sunk : int
            Most texels at once that are pressed past their maximum penetration.
        """
        sensor = self.scenario.sensors[0]
        shape, texels = (len(positions), len(sensor.texels)), mounted_texels(sensor)
        depth, normal = np.zeros(shape), np.tile(-texels.normal, (shape[0], 1, 1))
        point, most = np.tile(texels.position, (shape[0], 1, 1)), 0
        own = [pair for pair, (index, _) in enumerate(self._model.pairs) if index == 0]
        for t in range(shape[0]):
            self._state.position[body], self._state.quaternion[body] = positions[t], quaternions[t]
            too_deep = find_all_contacts(-self.dt, *self.arrays)
            most = max(most, int(too_deep))
            for pair in own:
                most = max(most, self._count_too_deep(pair))
                slots, normals, points, depths = contacts_of(pair, self._workspace)
                texel = self._model.texel[self._model.point_first[pair] + slots - self._model.slot_start[pair]]
                deeper = np.argsort(depths, kind="stable")  # of several points of a texel the deepest comes last
                deeper = deeper[depths[deeper] > depth[t, texel[deeper]]]
                texel = texel[deeper]
                depth[t, texel] = depths[deeper]
                normal[t, texel] = normals[deeper]
                point[t, texel] = points[deeper] + self._center[sensor.body]
        return depth, normal, point, most

    def _time_of(self, frame: float) -> float:
        return (frame - self.scenario.frame_start) / self.scenario.fps

    def _warn_of_too_deep(self) -> None:
        """Say once, at the first frame where it happens, that texels are pressed too deep to act."""
        if any("maximum penetration" in warning for warning in self.warnings):
            return
        sensors, targets, total, names = self.scenario.sensors, self.scenario.targets, 0, []
        for pair, (sensor, target) in enumerate(self._model.pairs):
            too_deep = self._count_too_deep(pair)
            if too_deep:
                name = f"'{targets[target].name}' into '{sensors[sensor].name}'"
                if name not in names:  # a large sensor has several pairs with one target
                    names.append(name)
                total += too_deep
        total = max(total, self._most_too_deep)
        if total:
            what = "texels" if all(sensor.parameters.points_per_texel == 1 for sensor in sensors) else "contact points"
            self.warnings.append(
                f"Frame {self.frame}: {total} {what} are pressed past their maximum penetration by "
                f"{', '.join(names) or 'an object'} and do not act; press less deep, or raise k or the maximum penetration."
            )

    def _count_too_deep(self, pair: int) -> int:
        """Contact points of a pair that are sunk or buried in its target."""
        closed = self._closed[self._model.pairs[pair, 1]]
        return int(count_too_deep(pair, closed, self._model, self._tree, self._surface_motion, self._state, self._workspace))

    def _tactile(self, sensor: int) -> np.ndarray:
        """(n,) normal forces of a sensor in the present state, for its controllers."""
        find_all_contacts(-self.dt, *self.arrays)
        force = self._read_texels()[0]
        return force[self._texel_start[sensor] : self._texel_start[sensor + 1]]

    def _read_texels(self) -> tuple[np.ndarray, ...]:
        """What :func:`read_texels` writes, from rows gathered: per texel up to the contact, then per sensor."""
        n, m = self._texel_start[-1], len(self.scenario.sensors)
        force, friction, depth, slip, contact = *np.zeros((4, n)), np.zeros(n, dtype=np.bool_)
        shear, net, moment = np.zeros((n, 2)), np.zeros((m, 6)), np.zeros((m, 4))
        read_texels(self._model, self._state, self._workspace, force, shear, friction, depth, slip, contact, net, moment)
        return force, shear, friction, depth, slip, contact, net, moment

    def observe(self) -> Frame:
        """What the sensors feel in the present state."""
        find_all_contacts(-self.dt, *self.arrays)
        self._warn_of_too_deep()
        force, shear, friction, depth, slip, contact, net, moment = self._read_texels()
        sensors = {}
        for i, sensor in enumerate(self.scenario.sensors):
            if not sensor.readout:
                continue
            own = slice(self._texel_start[i], self._texel_start[i + 1])
            center = self._center[sensor.body]
            pressed = moment[i, 3] > 0.0
            sensors[sensor.name] = SensorFrame(
                normal_force=force[own].copy(),
                shear=shear[own].copy(),
                friction=friction[own].copy(),
                depth=depth[own].copy(),
                slip=slip[own].copy(),
                contact=contact[own].copy(),
                reading=self._readers[i].step(self.time, force[own]),
                net_force=net[i, :3].copy(),
                net_torque=net[i, 3:] + np.cross(center, net[i, :3]),
                centre_of_pressure=moment[i, :3] / moment[i, 3] + center if pressed else np.zeros(3),
            )
        origin = self._state.position - np.einsum("bij,bj->bi", self._workspace.rotation, self._center)
        return Frame(
            frame=self.frame,
            time=self.time,
            sensors=sensors,
            poses=np.hstack([origin, self._state.quaternion]),
            velocities=self._state.velocity.copy(),
        )


def _model(scenario: Scenario, center: np.ndarray, points: list[ContactPoints], dt: float) -> SolverModel:
    """Flatten a scenario into the kernels' arrays; `center` (b, 3) is the reference point of each body in its frame."""
    bodies, sensors, targets = scenario.bodies, scenario.sensors, scenario.targets
    blocks = [point_rows(mounted_texels(s), p, center[s.body]) for s, p in zip(sensors, points, strict=True)]
    texel_start = _texel_start(scenario)
    kind = np.array([FREE if body.free else DRIVEN if body.drive is not None else KEYFRAMED for body in bodies])
    drive_of, drives = drive_table(scenario)
    at, drive_at, unknowns = _unknowns(kind, drive_of)
    point_start = np.cumsum([0] + [len(block) for block in blocks])
    parts = [  # sensor, target, first point, and the one after the last
        (i, j, first, min(first + MAX_PAIR_POINTS, point_start[i + 1]))
        for i, s in enumerate(sensors)
        for j, t in enumerate(targets)
        if s.body != t.body
        for first in range(point_start[i], point_start[i + 1], MAX_PAIR_POINTS)
    ]
    pairs = [(i, j) for i, j, _, _ in parts]
    couplings = [coupling(scenario, i, j) for i, j in pairs]
    sizes = [stop - first for _, _, first, stop in parts]
    extents = [bounding_sphere(block, sensor.parameters.max_penetration) for block, sensor in zip(blocks, sensors, strict=True)]
    return SolverModel(
        points=np.ascontiguousarray(np.vstack(blocks)),
        point_start=point_start,
        texel=np.concatenate([p.texel + start for p, start in zip(points, texel_start, strict=False)]),
        parameters=np.array(
            [
                parameter_row(p := sensors[i].parameters, weight / p.points_per_texel, part)
                for (i, _), (part, weight) in zip(pairs, couplings, strict=True)
            ]
        ),
        weight=np.array([weight for _, weight in couplings]),
        painted=_painted_multipliers(sensors, points),
        reach=np.array([s.parameters.max_penetration for s in sensors], dtype=float),
        pairs=np.array(pairs),
        point_first=np.array([first for _, _, first, _ in parts]),
        point_stop=np.array([stop for _, _, _, stop in parts]),
        sensor_body=np.array([s.body for s in sensors]),
        target_body=np.array([t.body for t in targets]),
        slot_start=np.cumsum([0, *sizes])[:-1],
        center=np.array([middle for middle, _ in extents]),
        radius=np.array([radius for _, radius in extents]),
        skin=np.array([MAX_RADIUS_SHARE * sensors[i].parameters.max_penetration for i, _ in pairs]),
        listed=np.array([_list_radius(sensors[i], targets[j]) for i, j in pairs]),
        kind=kind,
        at=at,
        unknowns=unknowns,
        mass=np.array([body.mass for body in bodies], dtype=float),
        inertia=np.ascontiguousarray([body.inertia for body in bodies], dtype=float),
        inverse_inertia=np.array([np.linalg.inv(body.inertia) if body.free else np.zeros((3, 3)) for body in bodies]),
        gravity=np.array(scenario.gravity, dtype=float),
        thrown=np.array([body.velocity if body.free else np.zeros(3) for body in bodies], dtype=float),
        axis=np.array([np.zeros(3) if body.drive is None else body.drive.axis for body in bodies], dtype=float),
        axis_in_world=np.array([body.drive is not None and body.drive.axis_in_world for body in bodies]),
        drive_of=drive_of,
        drive_at=drive_at,
        drives=drives,
        program=compile_program([sensor.effects for sensor in sensors], [dt, 0.0]),  # STEP and NOW of core/pads.py
        share=np.array(
            [weight / sensors[i].parameters.points_per_texel for (i, _), (_, weight) in zip(pairs, couplings, strict=True)]
        ),
        part=np.array([part for part, _ in couplings]),
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


def _texel_start(scenario: Scenario) -> np.ndarray:
    """(m + 1,) int: where the texels of each sensor begin among those of all."""
    return np.cumsum([0] + [len(sensor.texels) for sensor in scenario.sensors])


def _unknowns(kind: np.ndarray, drive_of: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Lay out the unknowns of a step: six for each free body, then one for each drive.

    Returns
    -------
    at : (b,) int
        Where those of each body begin, -1 for keyframed bodies.
    drive_at : (d,) int
    unknowns : int
    """
    free = kind == FREE
    drives = int(drive_of.max(initial=-1)) + 1
    drive_at = 6 * np.count_nonzero(free) + np.arange(drives)
    at = np.where(free, 6 * (np.cumsum(free) - 1), -1)
    at[kind == DRIVEN] = drive_at[drive_of[kind == DRIVEN]]
    return at, drive_at, int(6 * np.count_nonzero(free) + drives)


def _list_radius(sensor: Sensor, target: Target) -> float:
    """How far around a texel triangles are listed at the most: a tenth of the target's usual edge, so that they are few."""
    a, b, _ = target.mesh.triangles.T
    edge = np.median(np.linalg.norm(target.mesh.vertices[b] - target.mesh.vertices[a], axis=1))
    return float(min(0.1 * edge, 0.1 * sensor.parameters.max_penetration))


def _initial_state(scenario: Scenario, model: SolverModel, center: np.ndarray) -> State:
    """Everything where it is at the first frame; keyframed bodies count as at rest until they move."""
    quaternion = np.array([body.motion.quaternions[0] for body in scenario.bodies], dtype=float)
    origin = np.array([body.motion.positions[0] for body in scenario.bodies], dtype=float)
    velocity = [
        np.concatenate([body.velocity, body.angular_velocity]) if body.free else np.zeros(6) for body in scenario.bodies
    ]
    slots = int((model.point_stop - model.point_first).sum())
    return State(
        position=origin + np.einsum("bij,bj->bi", rotation_matrices(quaternion), center),
        quaternion=quaternion,
        velocity=np.array(velocity, dtype=float),
        hint=np.full(slots, -1),
        bristles=np.zeros((slots, 4)),
        drives=np.zeros((len(model.drives), 3)),
        memory=model.program.memory(len(model.points)),
        tank=np.zeros(len(model.pairs)),
    )


def solve(scenario: Scenario, simulation: Simulation | None = None, frames: list[Frame] | None = None) -> Job[Recording]:
    """Run a scenario frame by frame.

    Closing the generator stops the run; nothing outside is touched.

    Parameters
    ----------
    scenario : Scenario
    simulation : Simulation, optional
        Of this scenario, to go on with. Default: a new one.
    frames : list of Frame, optional
        Those that it has been through, the present one too; those to come are added to it.

    Yields
    ------
    Progress
        After each frame; what the frame holds is then the last item of `frames`.

    Returns
    -------
    Recording
    """
    simulation = simulation or Simulation(scenario)
    total = len(scenario.frames)
    frames = [] if frames is None else frames
    if not frames:
        frames.append(simulation.observe())
    yield Progress("Computing forces", len(frames), total, simulation.frame)
    while simulation.frame < scenario.frame_end:
        frames.append(simulation.advance())
        yield Progress("Computing forces", len(frames), total, simulation.frame)
    names = [body.name for body in scenario.bodies]
    return Recording.stack(frames, names, simulation.dt, scenario.digest(), simulation.warnings, simulation.step_reason)


def run(scenario: Scenario, progress: Callable[[Progress], None] | None = None) -> Recording:
    """Run a scenario to its end and return the recording; `progress` is called after each frame."""
    return run_job(solve(scenario), progress)
