# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenario → Recording: the substep loop.

Each substep finds the contacts where the bodies are, solves for the free bodies' velocities at the step's end (implicit in the
stiffness and damping of every contact), brings the bristles forward and moves the bodies. Each frame finds the contacts once
more and writes down what the sensors measure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..compiled.thread_team import helper_threads
from ..effects.engine.readout_chain import ReadoutChain
from ..effects.engine.registry import check_scenario, mounted_texels
from ..geometry.rotations import quaternion_product, quaternions_from_vectors, rotation_matrices, rotation_vectors
from ..jobs import Job, Progress, run_job
from ..model.body import Mode, Motion
from ..model.recording import BLOCK_BYTES, Frame, Recording, SensorRecording
from ..model.scenario import Scenario
from ..model.shared_results import SharedResults
from ..skins.channel_readouts import with_clipping_warnings
from .detection.deformation import refit_boxes, set_moment
from .detection.detection_data import DetectionData
from .detection.narrow_phase import count_too_deep
from .dynamics.actuators import DriveCommands
from .dynamics.linear_system import contacts_of, credit_initial_contacts
from .fast_crossings import FastCrossings, path_of_moved_bodies
from .parallel_loops import find_all_contacts, help_with_loops, prepare_pair_loops
from .solver_model import SolverModel, State
from .structures import structures_for, texel_starts
from .substep import FRAME, NOTHING, TEXELS, FramePath, ObservedFrames, advance_frames
from .time_step_adviser import plan
from .workspace import Workspace

TEXEL_BYTES = 8 * 8
"""Bytes of a frame of a texel: forces, friction, depth, slip, contact and reading."""
PATH_ROWS = 4096
"""Poses of bodies in steps that are computed at once: few enough to stay in a processor's cache."""
NO_PATH = 0, (np.zeros((0, 0, 0, 3)), np.zeros((0, 0, 0, 4)), np.zeros((0, 0, 0, 6)))
"""The first frame whose path is known, and the paths of it and of those that follow."""


class Simulation:
    """A scenario that is simulated frame by frame.

    Parameters
    ----------
    scenario : Scenario
    threads : int, optional
        How many to compute with (see :func:`.thread_team.make_queue`); the numbers are the same, bit by bit.
    shared : SharedResults, optional
        Of simulations whose scenarios have meshes and texels in common; these are then prepared once.

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
    helpers : int
        Threads that help with the steps.
    """

    def __init__(self, scenario: Scenario, threads: int | None = None, shared: SharedResults | None = None):
        shared = shared or SharedResults()
        shared.of(check_scenario, scenario)  # which a study has done
        self.scenario = scenario
        self.frame = scenario.frame_start
        chosen = plan(scenario)
        self.dt, self.substeps, self.step_reason = chosen.dt, chosen.substeps, chosen.reason
        self.warnings = [chosen.warning] if chosen.warning else []
        self._motions = [body.motion for body in scenario.bodies]
        self._known_path = NO_PATH
        # Bodies that forces move are followed at their centre of mass, keyframed ones at their origin.
        self._center = np.array([body.center_of_mass if body.moved_by_forces else np.zeros(3) for body in scenario.bodies])
        found = structures_for(self, scenario, self._center, self.dt, threads, shared)
        self._model, self._deforming_surfaces, self.helpers = found.model, found.deforming_surfaces, found.helpers
        self._detection, self._state, self._workspace = found.detection, found.state, found.workspace
        # How many contact points of each pair were pressed too deep in the worst step of the last frame.
        self._most_too_deep = np.zeros(len(self._model.pairs.sensor), np.int64)
        self._readers = [ReadoutChain.of(sensor) for sensor in scenario.sensors]
        self._drive_commands = DriveCommands(scenario)
        self._texel_start = texel_starts(scenario)
        self._fast_crossings = FastCrossings(scenario, self._center, shared)

    @property
    def arrays(self) -> tuple[SolverModel, DetectionData, State, Workspace]:
        """The structures that the kernels work on."""
        arrays = self._model, self._detection, self._state, self._workspace
        prepare_pair_loops(*arrays)
        return arrays

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
            See :attr:`.Texels.local_frames`.
        share : float
            Of the way to the next frame, for what is known in between: these come first, in order.
        """
        time = self._time_of(self.frame + share)
        self._known_path = NO_PATH
        self._deforming_surfaces.extend(time, vertices or {}, texels or {})
        for body, (position, quaternion) in poses.items():
            motion = self._motions[body]
            if motion.times[-1] < time - 1e-9:
                self._motions[body] = motion.extended(time, position, quaternion)
        self._drive_commands.extend(time, targets or {})

    def observe(self) -> Frame:
        """Return the forces and readings of the sensors in the present state."""
        seen = self._seen(1)
        self._observe_first(seen)
        return self._recorded(np.array([self.frame]), seen).at(self.frame)

    def advance(self) -> Frame:
        """Bring the state one frame on and return the frame: poses, forces and readings."""
        seen = self._seen(1)
        self._advance(seen)
        return self._recorded(np.array([self.frame]), seen).at(self.frame)

    def frames(self) -> Iterator[Frame]:
        """Yield the remaining frames, the present one first; none stays in memory."""
        yield self.observe()
        while self.frame < self.scenario.frame_end:
            yield self.advance()

    def advance_all(self, with_digest: bool = True) -> Recording:
        """Go through all frames that are left, and return the recording with the present frame as its first one.

        The numbers are those of :meth:`advance`, bit by bit. Where Python has nothing to do in between, many frames are
        computed in one call. The digest of the scenario is left out on request, because it takes a tenth of a short run.
        """
        first = self.frame
        seen = self._seen(max(1, self.scenario.frame_end - first + 1))
        count, at = len(seen.may_cross), 1
        self._observe_first(seen.part(slice(0, 1)))
        while at < count:
            stop = min(at + self._frames_at_once(), count)
            self._advance(seen.part(slice(at, stop)))
            at = stop
        found = self._recorded(first + np.arange(count), seen)
        digest = self.scenario.digest() if with_digest else ""
        found = replace(found, digest=digest, warnings=tuple(self.warnings), step_reason=self.step_reason)
        return with_clipping_warnings(found)

    def _frames_at_once(self) -> int:
        """Return how many of the next frames one call of the kernels may compute."""
        if self._deforming_surfaces.any_deforms or self._drive_commands.reads_sensors or self.helpers:
            return 1
        most = max(1, BLOCK_BYTES // (int(self._texel_start[-1]) * TEXEL_BYTES))
        return min(most, self._path_frames(self.frame))

    def _advance(self, seen: ObservedFrames) -> None:
        """Bring the state as many frames on as `seen` has room for, and write what is observed at them there."""
        first, count = self.frame, len(seen.may_cross)
        seen.position[0], seen.quaternion[0] = self._state.position, self._state.quaternion
        positions, quaternions, velocities = self._prescribed_motion(first, count)
        times = self._step_times(first + np.arange(count))
        self._place_deforming(times[0])
        if first == self.scenario.frame_start:
            find_all_contacts(-self.dt, *self.arrays)
            credit_initial_contacts(self._model, self._state, self._workspace)
        before = seen.position[0].copy(), seen.quaternion[0].copy()
        for steps, commands in self._intervals(times):
            path = FramePath(positions, quaternions, velocities, commands)
            with helper_threads(self._workspace.queue, self.helpers, help_with_loops, *self.arrays):
                self._run(steps, FRAME if steps[1] == self.substeps else NOTHING, path, seen)
        too_deep = seen.too_deep.any(axis=1) | seen.too_deep_between.any(axis=1)
        for i in np.flatnonzero(seen.may_cross | too_deep).tolist():
            self.frame = first + i + 1
            if seen.may_cross[i]:
                earlier = (seen.position[i - 1], seen.quaternion[i - 1]) if i else before
                after = seen.position[i], seen.quaternion[i]
                self._warn_of_fast_crossings(positions[i], quaternions[i], earlier, after)
            if too_deep[i]:
                self._warn_of_too_deep(seen.too_deep[i], seen.too_deep_between[i])
        self.frame = first + count
        self._most_too_deep = seen.too_deep_between[-1].copy()

    def _observe_first(self, seen: ObservedFrames) -> None:
        """Write what is observed at the present frame where there is room for one."""
        self._observe(FRAME, seen)
        self._warn_of_too_deep(seen.too_deep[0], self._most_too_deep)

    def _observe(self, what: int, seen: ObservedFrames) -> None:
        """Observe the present state: TEXELS, without a change of it, or FRAME."""
        b, d = len(self._motions), len(self._model.drives.gains)
        nowhere = FramePath(np.zeros((1, 1, b, 3)), np.zeros((1, 1, b, 4)), np.zeros((1, 0, b, 6)), np.zeros((1, 0, d, 4)))
        self._run((0, 0), what, nowhere, seen)

    def _seen(self, frames: int) -> ObservedFrames:
        """Return room for what is observed at some frames."""
        sensors, bodies, pairs = len(self.scenario.sensors), len(self._motions), len(self._model.pairs.sensor)
        return ObservedFrames.zero(frames, int(self._texel_start[-1]), sensors, bodies, pairs)

    def _run(self, steps: tuple[int, int], observed: int, path: FramePath, seen: ObservedFrames) -> None:
        """Call :func:`.advance_frames`."""
        advance_frames(self.dt, steps, observed, path, self._fast_crossings.limits, *self.arrays, seen)

    def _place_deforming(self, times: np.ndarray) -> None:
        """Bring surfaces that deform to the frame whose steps are at these times, (steps + 1,) s."""
        if self._deforming_surfaces.any_deforms:
            surfaces = self._deforming_surfaces.at(times)
            self._detection = self._detection._replace(surfaces=surfaces)
            if self._drive_commands.reads_sensors:  # controllers read before the first step
                refit_boxes(surfaces, self._detection.tree)
                set_moment(0, 1, 0.0, self._model, surfaces)

    def _intervals(self, times: np.ndarray) -> Iterator[tuple[tuple[int, int], np.ndarray]]:
        """Yield the steps of frames in intervals during which no controller is updated, with (F, steps, d, 4) commands.

        `times` (F, steps + 1), s, are those of steps.
        """
        if len(self._model.drives.gains) == 0:
            yield (0, self.substeps), np.zeros((len(times), self.substeps, 0, 4))
            return
        frames = [self._drive_commands.control_intervals(own, self.dt, self._normal_forces) for own in times]
        for parts in zip(*frames, strict=True):  # where controllers read sensors there is one frame, else one interval
            first, last, _ = parts[0]
            yield (first, last), np.stack([commands for _, _, commands in parts])

    def _readings(self, i: int, times: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Readings (F, n) of a sensor; frame by frame where effects act on them, whose sums of many frames round otherwise."""
        if not self.scenario.sensors[i].effects:
            return self._readers[i].read(times, force)
        return np.stack([self._readers[i].step(time, own) for time, own in zip(times.tolist(), force, strict=True)])

    def _recorded(self, frames: np.ndarray, seen: ObservedFrames) -> Recording:
        """Return the recording of frames that were observed, without what concerns the whole run."""
        times = (frames - self.scenario.frame_start) / self.scenario.fps
        sensors = {
            sensor.name: self._sensor_rows(i, times, seen) for i, sensor in enumerate(self.scenario.sensors) if sensor.readout
        }
        origin = seen.position
        if self._center.any():
            origin = origin - np.stack([np.einsum("bij,bj->bi", own, self._center) for own in seen.rotation])
        poses = np.concatenate([origin, seen.quaternion], axis=2)
        names = tuple(body.name for body in self.scenario.bodies)
        return Recording(frames, times, sensors, names, poses, seen.velocity, self.dt)

    def _sensor_rows(self, i: int, times: np.ndarray, seen: ObservedFrames) -> SensorRecording:
        """Return the forces and readings of one sensor in frames that were observed."""
        own = slice(self._texel_start[i], self._texel_start[i + 1])
        center, net, moment = self._center[self.scenario.sensors[i].body], seen.texels.net[:, i], seen.texels.moment[:, i]
        centre_of_pressure = np.zeros((len(times), 3))
        pressed = moment[:, 3] > 0.0
        centre_of_pressure[pressed] = moment[pressed, :3] / moment[pressed, 3:] + center
        force = np.ascontiguousarray(seen.texels.force[:, own])
        recorded = SensorRecording(
            normal_force=force,
            shear=np.ascontiguousarray(seen.texels.shear[:, own]),
            friction=np.ascontiguousarray(seen.texels.friction[:, own]),
            depth=np.ascontiguousarray(seen.texels.depth[:, own]),
            slip=np.ascontiguousarray(seen.texels.slip[:, own]),
            contact=np.ascontiguousarray(seen.texels.contact[:, own]),
            reading=self._readings(i, times, force),
            net_force=net[:, :3].copy(),
            net_torque=net[:, 3:] + _cross(center, net[:, :3]),
            centre_of_pressure=centre_of_pressure,
            unit=self.scenario.sensors[i].parameters.unit,
        )
        readout = self.scenario.sensors[i].channels
        if readout is not None:
            recorded.channels = readout.channels(recorded)
        return recorded

    def _step_times(self, frames: int | np.ndarray) -> np.ndarray:
        """(…, substeps + 1) times at which the steps after frames (…) begin, and the last one ends, s."""
        times = self._time_of(np.asarray(frames))[..., None] + np.arange(self.substeps + 1) * self.dt
        times[..., -1] = self._time_of(np.asarray(frames) + 1)
        return times

    def _warn_of_fast_crossings(
        self,
        positions: np.ndarray,
        quaternions: np.ndarray,
        before: tuple[np.ndarray, np.ndarray],
        after: tuple[np.ndarray, np.ndarray],
    ) -> None:
        """Warn of targets that were too fast in the last frame; `before` and `after` are where the bodies were around it."""
        positions, quaternions = positions.copy(), quaternions.copy()
        moved = [index for index, body in enumerate(self.scenario.bodies) if body.moved_by_forces]
        if moved:
            ends = ((before[0][moved], before[1][moved]), (after[0][moved], after[1][moved]))
            path = path_of_moved_bodies(*ends, self.substeps)
            positions[:, moved], quaternions[:, moved] = path
        self.warnings += self._fast_crossings.warnings(self.frame, positions, quaternions, self.dt)

    def _path_frames(self, frame: int) -> int:
        """Return for how many frames after this one the path of the bodies is computed at once."""
        rows = (self.substeps + 1) * len(self._motions)
        return min(max(1, PATH_ROWS // rows), max(1, self.scenario.frame_end - frame))

    def _prescribed_motion(self, frame: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (F, steps + 1, b, 3), quaternions (F, steps + 1, b, 4) and velocities (F, steps, b, 6) of F frames.

        They follow from motions. Those of some frames to come are computed at once, which gives the same numbers in a fraction
        of the time.
        """
        start, path = self._known_path
        if not start <= frame <= frame + count <= start + len(path[0]):
            frames = frame + np.arange(max(count, self._path_frames(frame)))
            start, path = self._known_path = frame, self._path_along(self._step_times(frames))
        own = slice(frame - start, frame - start + count)
        return path[0][own], path[1][own], path[2][own]

    def _path_along(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute :meth:`_prescribed_motion` for F frames; `times` (F, steps + 1), s, are those of steps."""
        path = [poses_at(motion, times.ravel(), self.scenario.interpolation) for motion in self._motions]
        positions, quaternions = np.empty((*times.shape, len(path), 3)), np.empty((*times.shape, len(path), 4))
        for body, (position, quaternion) in enumerate(path):
            positions[:, :, body] = position.reshape(*times.shape, 3)
            quaternions[:, :, body] = quaternion.reshape(*times.shape, 4)
        for body in np.flatnonzero(self._model.bodies.mode == Mode.DRIVEN):
            positions[:, :, body] += rotation_matrices(quaternions[:, :, body]) @ self._center[body]
        before, after = quaternions[:, :-1], quaternions[:, 1:]
        turning = (after != before).any(axis=3)
        turns = np.zeros((*turning.shape, 3))  # not rounding: bodies that animation moves bring energy (:func:`.check_energy`)
        if turning.any():
            turns[turning] = rotation_vectors(quaternion_product(after[turning], _conjugate(before[turning])))
        velocities = np.concatenate([positions[:, 1:] - positions[:, :-1], turns], axis=3) / self.dt
        return positions, quaternions, velocities

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
        too_deep : int
            Largest number of texels that are pressed past their maximum penetration at once.
        """
        sensor = self.scenario.sensors[0]
        shape, texels = (len(positions), len(sensor.texels)), mounted_texels(sensor)
        depth, normal = np.zeros(shape), np.tile(-texels.normal, (shape[0], 1, 1))
        point, most = np.tile(texels.position, (shape[0], 1, 1)), 0
        own = np.flatnonzero(self._model.pairs.sensor == 0)
        for t in range(shape[0]):
            self._state.position[body], self._state.quaternion[body] = positions[t], quaternions[t]
            too_deep = find_all_contacts(-self.dt, *self.arrays)
            most = max(most, int(too_deep))
            for pair in own:
                most = max(most, int(count_too_deep(pair, *self.arrays)))
                found, pairs = contacts_of(pair, self._workspace), self._model.pairs
                texel = self._model.points.texel[pairs.first_point[pair] + found.slots - pairs.first_slot[pair]]
                deeper = np.argsort(found.depth, kind="stable")  # of several points of a texel the deepest comes last
                deeper = deeper[found.depth[deeper] > depth[t, texel[deeper]]]
                texel = texel[deeper]
                depth[t, texel] = found.depth[deeper]
                normal[t, texel] = found.normal[deeper]
                point[t, texel] = found.point[deeper] + self._center[sensor.body]
        return depth, normal, point, most

    def _time_of(self, frame: Any) -> Any:
        return (frame - self.scenario.frame_start) / self.scenario.fps

    def _warn_of_too_deep(self, now: np.ndarray, between: np.ndarray) -> None:
        """Say once, at the first frame where it happens, that texels are pressed too deep to act.

        Parameters
        ----------
        now, between : (q,) int
            How many contact points of each pair are, at the present frame and in the worst step before it.
        """
        if any("maximum penetration" in warning for warning in self.warnings):
            return
        sensors, targets, pairs = self.scenario.sensors, self.scenario.targets, self._model.pairs
        total = max(now.sum(), between.sum())
        if total:
            pressed = [  # between frames as well; a large sensor has several pairs with one target
                f"'{targets[pairs.target[pair]].name}' into '{sensors[pairs.sensor[pair]].name}'"
                for pair in np.flatnonzero(now + between)
            ]
            what = "texels" if all(sensor.parameters.points_per_texel == 1 for sensor in sensors) else "contact points"
            self.warnings.append(
                f"Frame {self.frame}: {total} {what} are pressed past their maximum penetration by "
                f"{', '.join(dict.fromkeys(pressed))} and exert no force; "
                "reduce the depth, or raise k or the maximum penetration."
            )

    def _normal_forces(self, sensor: int) -> np.ndarray:
        """(n,) normal forces of a sensor in the present state, for its controllers."""
        seen = self._seen(1)
        self._observe(TEXELS, seen)
        return seen.texels.force[0, self._texel_start[sensor] : self._texel_start[sensor + 1]]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross products of (3,) and (F, 3) vectors: the bits of np.cross in a fifth of its time."""
    (ax, ay, az), (bx, by, bz) = a, b.T
    return np.column_stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def solve(scenario: Scenario, simulation: Simulation | None = None) -> Job[Recording]:
    """Run a scenario frame by frame, with all frames in memory.

    Closing the generator stops the run; nothing outside is touched.

    Parameters
    ----------
    scenario : Scenario
    simulation : Simulation, optional
        A new one of this scenario, which has not moved yet.

    Yields
    ------
    Progress
        After each frame.

    Returns
    -------
    Recording
    """
    simulation = simulation or Simulation(scenario)
    frames, total = [], len(scenario.frames)
    for frame in simulation.frames():
        frames.append(frame)
        yield Progress("Computing forces", len(frames), total, frame.frame)
    names = [body.name for body in scenario.bodies]
    found = Recording.stack(frames, names, simulation.dt, scenario.digest(), simulation.warnings, simulation.step_reason)
    return with_clipping_warnings(found)


def run(scenario: Scenario, progress: Callable[[Progress], None] | None = None) -> Recording:
    """Run a scenario to its end and return the recording; `progress` is called after each frame."""
    return run_job(solve(scenario), progress)


def poses_at(motion: Motion, times: np.ndarray, interpolation: str = "linear") -> tuple[np.ndarray, np.ndarray]:
    """Interpolate a motion; it is held before its first and after its last sample, and samples are met exactly.

    ``linear``: linear in position, constant angular velocity.

    ``smooth``: a cubic in position and a cumulative cubic Bézier curve of rotations (Kim, Kim and Shin, SIGGRAPH 1995), with
    continuous velocity. The velocity at a sample is that of the parabola through it and the two samples before. No later
    sample is needed, so the timeline, which receives a motion frame by frame, gives the same numbers as a bake.

    Parameters
    ----------
    motion : Motion
    times : (n,) float, seconds
    interpolation : str

    Returns
    -------
    positions : (n, 3) float, metres
    quaternions : (n, 4) float
    """
    if len(motion.times) == 1:
        n = len(times)
        return np.repeat(motion.positions, n, axis=0), np.repeat(motion.quaternions, n, axis=0)
    times = np.clip(times, motion.times[0], motion.times[-1])
    right = np.clip(np.searchsorted(motion.times, times, side="left"), 1, len(motion.times) - 1)
    left = right - 1
    share = ((times - motion.times[left]) / (motion.times[right] - motion.times[left]))[:, None]
    between = _smooth if interpolation == "smooth" else _linear
    positions, turned = between(motion, left, share)
    from_quaternion, to_quaternion = motion.quaternions[left], motion.quaternions[right]
    quaternions = np.where(share == 1.0, to_quaternion, np.where(share == 0.0, from_quaternion, turned))
    return np.where(share == 1.0, motion.positions[right], positions), quaternions


def _linear(motion: Motion, left: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    first = left.min(initial=len(motion.times))  # the times may be many between few samples
    samples = np.arange(first, left.max(initial=-1) + 1)
    turn = _turns(motion, samples)
    start, end = motion.positions[left], motion.positions[left + 1]
    positions = start + share * (end - start)
    if turn.any():
        turned = quaternion_product(quaternions_from_vectors(share * turn[left - first]), motion.quaternions[left])
    else:  # a share of no turn is none
        turned = quaternion_product(quaternions_from_vectors(turn), motion.quaternions[samples])[left - first]
    return positions, turned


def _smooth(motion: Motion, left: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    span, rest = (motion.times[left + 1] - motion.times[left])[:, None], 1.0 - share
    (v0, w0), (v1, w1) = _velocities(motion, left), _velocities(motion, left + 1)
    start, end = motion.positions[left], motion.positions[left + 1]
    # Bernstein polynomials; those of the rotation are their sums from the back.
    b1, b2, b3 = 3 * share * rest**2, 3 * share**2 * rest, share**3
    positions = start + b1 * (v0 * span / 3) + b2 * (end - start - v1 * span / 3) + b3 * (end - start)
    first, last = w0 * span / 3, w1 * span / 3
    from_start = quaternion_product(quaternions_from_vectors(first), motion.quaternions[left])
    to_end = quaternion_product(quaternions_from_vectors(-last), motion.quaternions[left + 1])
    middle = rotation_vectors(quaternion_product(to_end, _conjugate(from_start)))
    turned = motion.quaternions[left]
    for weight, turn in ((b1 + b2 + b3, first), (b2 + b3, middle), (b3, last)):
        turned = quaternion_product(quaternions_from_vectors(weight * turn), turned)
    return positions, turned


def _velocities(motion: Motion, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) velocities and angular velocities at samples: of the parabola through each and the two before.

    At the first sample, and at the second, it is the mean velocity between them.
    """
    last = np.maximum(at - 1, 0)  # intervals by their left ends
    before = np.maximum(at - 2, 0)
    h, g = ((motion.times[i + 1] - motion.times[i])[:, None] for i in (last, before))
    bend = h / (h + g)
    slopes = []
    for change in (lambda i: motion.positions[i + 1] - motion.positions[i], lambda i: _turns(motion, i)):
        slope = change(last) / h
        slopes.append(slope + bend * (slope - change(before) / g))
    return slopes[0], slopes[1]


def _turns(motion: Motion, left: np.ndarray) -> np.ndarray:
    """(n, 3) rotation vectors from samples to those that follow them."""
    return rotation_vectors(quaternion_product(motion.quaternions[left + 1], _conjugate(motion.quaternions[left])))


def _conjugate(quaternions: np.ndarray) -> np.ndarray:
    return quaternions * np.array([1.0, -1.0, -1.0, -1.0])
