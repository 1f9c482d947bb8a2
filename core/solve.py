# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenario → Recording: the substep loop.

Each substep: find the contacts where the bodies are, solve for the free bodies' velocities at the step's end (implicit in every
contact's stiffness and damping), bring the bristles forward, move the bodies. Each frame: find the contacts once more and write down
what the sensors feel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from .bodies import (
    add_cross_block,
    add_force,
    add_own_block,
    poses_at,
    quaternion_product,
    rotation_matrices,
    rotation_vectors,
    solve_positive,
    turn_quaternion,
    write_rotation,
    write_world_inertia,
)
from .bvh import build_tree
from .contact import (
    ARM_A,
    ARM_B,
    DEPTH,
    GAIN,
    KEEP,
    LIMIT,
    NORMAL_FORCE,
    ROW,
    STIFF_N,
    STIFF_T,
    K,
    bristle_limit,
    bristle_rate,
    friction_bias,
    friction_force,
    gather,
    linearise,
    normal_force,
)
from .jit import kernel
from .recording import Frame, Recording, SensorFrame
from .respond import respond
from .scenario import Scenario
from .timestep import advise

PASSES = 12
"""Most rounds in which contacts are linearised anew within a substep; two or three are usual, one at rest."""


@kernel
def _relative_velocity(row, velocity, a, b):
    """Velocity of the target's point relative to the sensor's, world axes (Eq. 3)."""
    va, vb = velocity[a], velocity[b]
    return (
        vb[0] + vb[4] * row[8] - vb[5] * row[7] - va[0] - va[4] * row[5] + va[5] * row[4],
        vb[1] + vb[5] * row[6] - vb[3] * row[8] - va[1] - va[5] * row[3] + va[3] * row[5],
        vb[2] + vb[3] * row[7] - vb[4] * row[6] - va[2] - va[3] * row[4] + va[4] * row[3],
    )


@kernel
def _gather_all(
    texels, texel_start, parameters, reach, pairs, sensor_body, target_body, slot_start,
    position, rotation, roots, bounds, skip, first, count, corners, normals,
    hint, bristles, rows, slots, pair_stop,
):  # fmt: skip
    """Contacts of all pairs of sensor and target; `pair_stop` gets where each pair's rows end. Returns texels sunk too deep."""
    used, sunk = 0, 0
    for pair in range(len(pairs)):
        sensor, target = pairs[pair, 0], pairs[pair, 1]
        a, b = sensor_body[sensor], target_body[target]
        used, deep = gather(
            texels, texel_start[sensor], texel_start[sensor + 1], reach[sensor], slot_start[pair],
            position[a], rotation[a], position[b], rotation[b], roots[target], roots[target + 1],
            bounds, skip, first, count, corners, normals, hint, bristles, rows, slots, used,
        )  # fmt: skip
        sunk += deep
        pair_stop[pair] = used
    return sunk


@kernel
def _solve_velocities(
    dt, parameters, pairs, sensor_body, target_body, free_at, mass, inertia, gravity,
    rows, pair_stop, velocity, matrix, vector, momentum,
):  # fmt: skip
    """Velocities of the free bodies at the step's end, written into `velocity`.

    Contacts are linearised at the current guess and the linear system solved, until the guess no longer moves; a contact that would
    pull is left out of the next round. With no free body one round only linearises.
    """
    n = 6 * int(free_at.max() + 1)
    for body in range(len(free_at)):
        at = 6 * free_at[body]
        if at >= 0:
            for i in range(3):
                momentum[at + i] = mass[body] * (velocity[body, i] + dt * gravity[i])
                total = 0.0
                for j in range(3):
                    total += inertia[body, i, j] * velocity[body, 3 + j]
                momentum[at + 3 + i] = total
    for turn in range(PASSES):
        for i in range(n):
            vector[i] = momentum[i]
            for j in range(n):
                matrix[i, j] = 0.0
        start = 0
        for pair in range(len(pairs)):
            sensor = pairs[pair, 0]
            a, b = sensor_body[sensor], target_body[pairs[pair, 1]]
            at_a, at_b = 6 * free_at[a], 6 * free_at[b]
            p = parameters[sensor]
            for r in range(start, pair_stop[pair]):
                row = rows[r]
                vx, vy, vz = _relative_velocity(row, velocity, a, b)
                linearise(row, vx, vy, vz, dt, p)
                if row[NORMAL_FORCE] <= 0.0 or (at_a < 0 and at_b < 0):
                    continue
                # What the known part of the motion and the stored springs do to the target; the sensor gets the opposite.
                ux, uy, uz = _known_velocity(row, velocity, a, b, at_a, at_b)
                out = ux * row[0] + uy * row[1] + uz * row[2]
                push = p[K] * row[DEPTH] + (row[STIFF_N] - row[STIFF_T]) * out
                stick = friction_bias(row, dt, p)
                fx = -push * row[0] - stick * row[10] - row[STIFF_T] * ux
                fy = -push * row[1] - stick * row[11] - row[STIFF_T] * uy
                fz = -push * row[2] - stick * row[12] - row[STIFF_T] * uz
                if at_b >= 0:
                    add_force(vector, at_b, fx, fy, fz, row, ARM_B, dt)
                    add_own_block(matrix, at_b, row, ARM_B, dt)
                if at_a >= 0:
                    add_force(vector, at_a, -fx, -fy, -fz, row, ARM_A, dt)
                    add_own_block(matrix, at_a, row, ARM_A, dt)
                if at_a >= 0 and at_b >= 0:
                    if at_a < at_b:
                        add_cross_block(matrix, at_a, at_b, row, ARM_A, ARM_B, dt)
                    else:
                        add_cross_block(matrix, at_b, at_a, row, ARM_B, ARM_A, dt)
            start = pair_stop[pair]
        if n == 0:
            return
        for body in range(len(free_at)):
            at = 6 * free_at[body]
            if at >= 0:
                for i in range(3):
                    matrix[at + i, at + i] += mass[body]
                    for j in range(i + 1):
                        matrix[at + 3 + i, at + 3 + j] += inertia[body, i, j]
        solve_positive(matrix, vector, n)
        change, speed = 0.0, 0.0
        for body in range(len(free_at)):
            at = 6 * free_at[body]
            if at >= 0:
                for i in range(6):
                    change = max(change, abs(vector[at + i] - velocity[body, i]))
                    speed = max(speed, abs(vector[at + i]))
                    velocity[body, i] = vector[at + i]
        if change <= 1e-3 * speed or change < 1e-9:
            return


@kernel
def _known_velocity(row, velocity, a, b, at_a, at_b):
    """Relative velocity of the contact point from the keyframed bodies alone."""
    ux, uy, uz = 0.0, 0.0, 0.0
    if at_b < 0:
        v = velocity[b]
        ux += v[0] + v[4] * row[8] - v[5] * row[7]
        uy += v[1] + v[5] * row[6] - v[3] * row[8]
        uz += v[2] + v[3] * row[7] - v[4] * row[6]
    if at_a < 0:
        v = velocity[a]
        ux -= v[0] + v[4] * row[5] - v[5] * row[4]
        uy -= v[1] + v[5] * row[3] - v[3] * row[5]
        uz -= v[2] + v[3] * row[4] - v[4] * row[3]
    return ux, uy, uz


@kernel
def _store_bristles(pairs, sensor_body, target_body, rotation, velocity, rows, slots, pair_stop, bristles):
    """Bristle deflections at the step's end, back in the frame of the sensor's body."""
    start = 0
    for pair in range(len(pairs)):
        a, b = sensor_body[pairs[pair, 0]], target_body[pairs[pair, 1]]
        turn = rotation[a]
        for r in range(start, pair_stop[pair]):
            row = rows[r]
            vx, vy, vz = _relative_velocity(row, velocity, a, b)
            out = vx * row[0] + vy * row[1] + vz * row[2]
            zx = row[KEEP] * row[10] + row[GAIN] * (vx - out * row[0])
            zy = row[KEEP] * row[11] + row[GAIN] * (vy - out * row[1])
            zz = row[KEEP] * row[12] + row[GAIN] * (vz - out * row[2])
            length = math.sqrt(zx * zx + zy * zy + zz * zz)
            scale = row[LIMIT] / length if length > row[LIMIT] else 1.0
            zx, zy, zz = scale * zx, scale * zy, scale * zz
            slot = slots[r]
            for i in range(3):
                bristles[slot, i] = turn[0, i] * zx + turn[1, i] * zy + turn[2, i] * zz
        start = pair_stop[pair]


@kernel
def _substeps(
    dt, path_position, path_quaternion, path_velocity,
    texels, texel_start, parameters, reach, pairs, sensor_body, target_body, slot_start,
    roots, bounds, skip, first, count, corners, normals,
    free_at, mass, body_inertia, gravity,
    position, quaternion, velocity, hint, bristles,
    rotation, inertia, rows, slots, pair_stop, matrix, vector, momentum,
):  # fmt: skip
    """Run the substeps of one frame; bodies, hints and bristles are brought forward in place. Returns most texels sunk at once."""
    worst = 0
    for step in range(len(path_velocity)):
        for body in range(len(free_at)):
            if free_at[body] < 0:
                for i in range(3):
                    position[body, i] = path_position[step, body, i]
                for i in range(4):
                    quaternion[body, i] = path_quaternion[step, body, i]
                for i in range(6):
                    velocity[body, i] = path_velocity[step, body, i]
            write_rotation(quaternion[body], rotation[body])
            if free_at[body] >= 0:
                write_world_inertia(rotation[body], body_inertia[body], inertia[body])
        sunk = _gather_all(
            texels, texel_start, parameters, reach, pairs, sensor_body, target_body, slot_start,
            position, rotation, roots, bounds, skip, first, count, corners, normals,
            hint, bristles, rows, slots, pair_stop,
        )  # fmt: skip
        worst = max(worst, sunk)
        _solve_velocities(
            dt, parameters, pairs, sensor_body, target_body, free_at, mass, inertia, gravity,
            rows, pair_stop, velocity, matrix, vector, momentum,
        )  # fmt: skip
        _store_bristles(pairs, sensor_body, target_body, rotation, velocity, rows, slots, pair_stop, bristles)
        for body in range(len(free_at)):
            if free_at[body] < 0:
                continue
            v = velocity[body]
            for i in range(3):
                position[body, i] += dt * v[i]
            turn_quaternion(quaternion[body], dt * v[3], dt * v[4], dt * v[5])
            _carry_spin(inertia[body], body_inertia[body], quaternion[body], rotation[body], v, matrix, vector)
    last = len(path_velocity)
    for body in range(len(free_at)):
        if free_at[body] < 0:
            for i in range(3):
                position[body, i] = path_position[last, body, i]
            for i in range(4):
                quaternion[body, i] = path_quaternion[last, body, i]
        write_rotation(quaternion[body], rotation[body])
    return worst


@kernel
def _carry_spin(inertia, body_inertia, quaternion, rotation, velocity, matrix, vector):
    """Angular velocity after the turn, from the angular momentum before it: what nothing touches keeps it exactly."""
    for i in range(3):
        vector[i] = inertia[i, 0] * velocity[3] + inertia[i, 1] * velocity[4] + inertia[i, 2] * velocity[5]
    write_rotation(quaternion, rotation)
    write_world_inertia(rotation, body_inertia, inertia)
    for i in range(3):
        for j in range(i + 1):
            matrix[i, j] = inertia[i, j]
    solve_positive(matrix, vector, 3)
    for i in range(3):
        velocity[3 + i] = vector[i]


@kernel
def _observe(
    texels, texel_start, parameters, pairs, sensor_body, target_body, slot_start,
    position, rotation, velocity, rows, slots, pair_stop,
    force, shear, depth, slip, contact, net, moment,
):  # fmt: skip
    """What every texel feels right now, from rows freshly gathered (Eq. 8, 9, 13); forces on the sensor, in its body's frame.

    `net` gets force and torque about the body's reference point, `moment` the sum of fn · point and of fn.
    """
    start = 0
    for pair in range(len(pairs)):
        sensor = pairs[pair, 0]
        a, b = sensor_body[sensor], target_body[pairs[pair, 1]]
        p, turn = parameters[sensor], rotation[a]
        for r in range(start, pair_stop[pair]):
            row = rows[r]
            texel = texel_start[sensor] + slots[r] - slot_start[pair]
            vx, vy, vz = _relative_velocity(row, velocity, a, b)
            rate = vx * row[0] + vy * row[1] + vz * row[2]
            tx, ty, tz = vx - rate * row[0], vy - rate * row[1], vz - rate * row[2]
            square = tx * tx + ty * ty + tz * tz
            fn = normal_force(row[DEPTH], rate, p)
            length = math.sqrt(row[10] * row[10] + row[11] * row[11] + row[12] * row[12])
            limit = bristle_limit(fn, p)
            held = limit / length if length > limit else 1.0
            zx, zy, zz = held * row[10], held * row[11], held * row[12]
            fx, fy, fz = 0.0, 0.0, 0.0
            if fn > 0.0:
                fx = friction_force(zx, bristle_rate(zx, tx, square, fn, p), tx, p)
                fy = friction_force(zy, bristle_rate(zy, ty, square, fn, p), ty, p)
                fz = friction_force(zz, bristle_rate(zz, tz, square, fn, p), tz, p)
            # Friction drags the sensor along with the target; the target's surface normal points into the sensor.
            lx = turn[0, 0] * fx + turn[1, 0] * fy + turn[2, 0] * fz
            ly = turn[0, 1] * fx + turn[1, 1] * fy + turn[2, 1] * fz
            lz = turn[0, 2] * fx + turn[1, 2] * fy + turn[2, 2] * fz
            shape = texels[texel]
            shear[texel, 0] += lx * shape[6] + ly * shape[7] + lz * shape[8]
            shear[texel, 1] += lx * shape[9] + ly * shape[10] + lz * shape[11]
            lx += fn * (turn[0, 0] * row[0] + turn[1, 0] * row[1] + turn[2, 0] * row[2])
            ly += fn * (turn[0, 1] * row[0] + turn[1, 1] * row[1] + turn[2, 1] * row[2])
            lz += fn * (turn[0, 2] * row[0] + turn[1, 2] * row[1] + turn[2, 2] * row[2])
            px = turn[0, 0] * row[3] + turn[1, 0] * row[4] + turn[2, 0] * row[5]
            py = turn[0, 1] * row[3] + turn[1, 1] * row[4] + turn[2, 1] * row[5]
            pz = turn[0, 2] * row[3] + turn[1, 2] * row[4] + turn[2, 2] * row[5]
            if not contact[texel] or fn > force[texel]:
                slip[texel] = math.sqrt(square)
            contact[texel] = True
            force[texel] += fn
            depth[texel] = max(depth[texel], row[DEPTH])
            net[sensor, 0] += lx
            net[sensor, 1] += ly
            net[sensor, 2] += lz
            net[sensor, 3] += py * lz - pz * ly
            net[sensor, 4] += pz * lx - px * lz
            net[sensor, 5] += px * ly - py * lx
            moment[sensor, 0] += fn * px
            moment[sensor, 1] += fn * py
            moment[sensor, 2] += fn * pz
            moment[sensor, 3] += fn
        start = pair_stop[pair]


@dataclass(frozen=True)
class Progress:
    """One frame is done: `done` of `total`, and what it holds."""

    frame: int
    done: int
    total: int
    result: Frame


class Simulation:
    """A scenario on its way through time.

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    PalpateError
        The scenario does not make a run (see :meth:`.Scenario.check`).

    Attributes
    ----------
    frame : int
        Where the state stands.
    dt : float, seconds
        Substep in use: a whole number of them makes a frame.
    warnings : list of str
        One sentence each; grows while the simulation runs.
    """

    def __init__(self, scenario: Scenario):
        scenario.check()
        self.scenario = scenario
        self.frame = scenario.frame_start
        self.warnings: list[str] = []
        longest = advise(scenario).dt if scenario.dt is None else scenario.dt
        self.substeps = max(1, math.ceil(1.0 / (scenario.fps * longest) - 1e-9))
        self.dt = 1.0 / (scenario.fps * self.substeps)
        self._motions = [body.motion for body in scenario.bodies]
        self._set_up_bodies()
        self._set_up_contacts()

    def _set_up_bodies(self) -> None:
        bodies = self.scenario.bodies
        free = np.array([body.free for body in bodies])
        self._free_at = np.where(free, np.cumsum(free) - 1, -1)
        self._mass = np.array([body.mass for body in bodies])
        self._body_inertia = np.ascontiguousarray([body.inertia for body in bodies], dtype=float)
        # Free bodies are followed at their centre of mass, keyframed ones at their origin.
        self._center = np.array([body.center_of_mass if body.free else np.zeros(3) for body in bodies])
        self._gravity = np.asarray(self.scenario.gravity, float)
        self._quaternion = np.array([motion.quaternions[0] for motion in self._motions])
        self._rotation = np.ascontiguousarray(rotation_matrices(self._quaternion))
        origin = np.array([motion.positions[0] for motion in self._motions])
        self._position = origin + np.einsum("bij,bj->bi", self._rotation, self._center)
        start = [np.concatenate([body.velocity, body.angular_velocity]) if body.free else np.zeros(6) for body in bodies]
        self._velocity = np.array(start)
        n = 6 * max(1, int(free.sum()))
        self._inertia = self._body_inertia.copy()
        self._matrix, self._vector, self._momentum = np.zeros((n, n)), np.zeros(n), np.zeros(n)

    def _set_up_contacts(self) -> None:
        sensors, targets = self.scenario.sensors, self.scenario.targets
        blocks = [
            np.hstack([s.texels.position - self._center[s.body], s.texels.normal, s.texels.tangent, s.texels.bitangent])
            for s in sensors
        ]
        self._texels = np.ascontiguousarray(np.vstack(blocks))
        self._texel_start = np.cumsum([0] + [len(s.texels) for s in sensors])
        keys = ("k", "cn", "ct", "sigma0", "sigma1", "x0", "mus", "mud")
        self._parameters = np.array([[getattr(s.parameters, key) for key in keys] for s in sensors])
        self._reach = np.array([s.parameters.max_penetration for s in sensors])
        self._sensor_body = np.array([s.body for s in sensors])
        self._target_body = np.array([t.body for t in targets])
        self._pairs = np.array(
            [(i, j) for i, s in enumerate(sensors) for j, t in enumerate(targets) if s.body != t.body]
        )
        sizes = [len(sensors[i].texels) for i, _ in self._pairs]
        self._slot_start = np.cumsum([0, *sizes])[:-1]
        meshes = [replace(t.mesh, vertices=t.mesh.vertices - self._center[t.body]) for t in targets]
        self._tree = build_tree(meshes)
        slots = int(sum(sizes))
        self._hint = np.full(slots, -1)
        self._bristles = np.zeros((slots, 4))
        self._rows = np.zeros((slots, ROW))
        self._slots = np.zeros(slots, np.int64)
        self._pair_stop = np.zeros(len(self._pairs), np.int64)

    @property
    def time(self) -> float:
        """Seconds since the first frame."""
        return (self.frame - self.scenario.frame_start) / self.scenario.fps

    def extend(self, poses: Mapping[int, tuple[np.ndarray, np.ndarray]]) -> None:
        """Append where keyframed bodies will be at the next frame.

        Parameters
        ----------
        poses : mapping of body index to (position (3,) m, quaternion (4,))
        """
        time = self._time_of(self.frame + 1)
        for body, (position, quaternion) in poses.items():
            motion = self._motions[body]
            if motion.times[-1] < time - 1e-9:
                self._motions[body] = motion.extended(time, position, quaternion)

    def advance(self) -> Frame:
        """Bring the state one frame on and return what the sensors feel there."""
        times = self._time_of(self.frame) + np.arange(self.substeps + 1) * self.dt
        times[-1] = self._time_of(self.frame + 1)
        path = [poses_at(motion, times) for motion in self._motions]
        positions = np.ascontiguousarray(np.stack([position for position, _ in path], axis=1))
        quaternions = np.ascontiguousarray(np.stack([quaternion for _, quaternion in path], axis=1))
        conjugate = quaternions[:-1] * np.array([1.0, -1.0, -1.0, -1.0])
        turns = rotation_vectors(quaternion_product(quaternions[1:], conjugate))
        velocities = np.concatenate([np.diff(positions, axis=0), turns], axis=2) / self.dt
        tree = self._tree
        sunk = _substeps(
            self.dt, positions, quaternions, np.ascontiguousarray(velocities),
            self._texels, self._texel_start, self._parameters, self._reach, self._pairs,
            self._sensor_body, self._target_body, self._slot_start,
            tree.roots, tree.bounds, tree.skip, tree.first, tree.count, tree.corners, tree.normals,
            self._free_at, self._mass, self._body_inertia, self._gravity,
            self._position, self._quaternion, self._velocity, self._hint, self._bristles,
            self._rotation, self._inertia, self._rows, self._slots, self._pair_stop,
            self._matrix, self._vector, self._momentum,
        )  # fmt: skip
        self.frame += 1
        if sunk:
            self._warn_once(sunk)
        return self.observe()

    def _time_of(self, frame: int) -> float:
        return (frame - self.scenario.frame_start) / self.scenario.fps

    def _warn_once(self, sunk: int) -> None:
        if not any("maximum penetration" in warning for warning in self.warnings):
            deep = self._hint == -2
            names = sorted(
                {
                    f"'{self.scenario.targets[target].name}' into '{self.scenario.sensors[sensor].name}'"
                    for pair, (sensor, target) in enumerate(self._pairs)
                    if deep[self._slot_start[pair] :][: len(self.scenario.sensors[sensor].texels)].any()
                }
            )
            where = ", ".join(names) or "an object"
            self.warnings.append(
                f"Frame {self.frame}: {sunk} texels are pressed past their maximum penetration by {where} and do not act; "
                "press less deep, or raise k or the maximum penetration."
            )

    def observe(self) -> Frame:
        """What the sensors feel in the present state."""
        tree = self._tree
        _gather_all(
            self._texels, self._texel_start, self._parameters, self._reach, self._pairs,
            self._sensor_body, self._target_body, self._slot_start, self._position, self._rotation,
            tree.roots, tree.bounds, tree.skip, tree.first, tree.count, tree.corners, tree.normals,
            self._hint, self._bristles, self._rows, self._slots, self._pair_stop,
        )  # fmt: skip
        n, m = len(self._texels), len(self.scenario.sensors)
        force, depth, slip, contact = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.bool_)
        shear, net, moment = np.zeros((n, 2)), np.zeros((m, 6)), np.zeros((m, 4))
        _observe(
            self._texels, self._texel_start, self._parameters, self._pairs,
            self._sensor_body, self._target_body, self._slot_start,
            self._position, self._rotation, self._velocity, self._rows, self._slots, self._pair_stop,
            force, shear, depth, slip, contact, net, moment,
        )  # fmt: skip
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
                depth=depth[own].copy(),
                slip=slip[own].copy(),
                contact=contact[own].copy(),
                reading=respond(sensor, force[own]),
                net_force=net[i, :3].copy(),
                net_torque=net[i, 3:] + np.cross(center, net[i, :3]),
                centre_of_pressure=moment[i, :3] / moment[i, 3] + center if pressed else np.zeros(3),
            )
        origin = self._position - np.einsum("bij,bj->bi", self._rotation, self._center)
        return Frame(
            frame=self.frame,
            time=self.time,
            sensors=sensors,
            poses=np.hstack([origin, self._quaternion]),
            velocities=self._velocity.copy(),
        )


def solve(scenario: Scenario) -> Generator[Progress, None, Recording]:
    """Run a scenario frame by frame.

    Closing the generator stops the run; nothing outside is touched.

    Yields
    ------
    Progress
        After each frame.

    Returns
    -------
    Recording
    """
    simulation = Simulation(scenario)
    total = len(scenario.frames)
    frames = [simulation.observe()]
    yield Progress(simulation.frame, 1, total, frames[-1])
    while simulation.frame < scenario.frame_end:
        frames.append(simulation.advance())
        yield Progress(simulation.frame, len(frames), total, frames[-1])
    names = [body.name for body in scenario.bodies]
    return Recording.stack(frames, names, simulation.dt, scenario.digest(), simulation.warnings)


def run(scenario: Scenario, progress: Callable[[Progress], None] | None = None) -> Recording:
    """Run a scenario to its end and return the recording; `progress` is called after each frame."""
    generator = solve(scenario)
    while True:
        try:
            step = next(generator)
        except StopIteration as stop:
            return stop.value
        if progress is not None:
            progress(step)

