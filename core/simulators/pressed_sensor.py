# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor inside the loop of another simulator: poses in, forces of texels out, and the wrench that goes back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..compiled.thread_team import helper_threads
from ..errors import ParameterError
from ..geometry.mesh import TriangleMesh
from ..model.recording import SENSOR_FIELDS, SensorFrame
from ..response.readings import ReadoutChain
from ..solver.parallel_loops import help_with_loops
from ..solver.pressing import Environment, PressedTexels, StepMemory, begin_at, press
from .pressed_model import PressedModel
from .sensor_on_mesh import SensorOnMesh

Pose = tuple[ArrayLike, ArrayLike]
"""Position (3,) in metres and quaternion (4,), (w, x, y, z), of a frame in the world."""


@dataclass(frozen=True)
class Contact:
    """What a sensor measures at one step, and the reaction.

    Attributes
    ----------
    texels : SensorFrame
        Force, shear, depth, slip and reading of each texel, on the sensor, in the frame of the sensor.
    force_on_target, torque_on_target : (3,) float, N and N·m
        In the world; the torque is about the origin of the target's frame. On the sensor's body acts the opposite. With
        several targets (T, 3).
    """

    texels: SensorFrame
    force_on_target: np.ndarray
    torque_on_target: np.ndarray


class PressedSensor:
    """A sensor and what presses on it, all moved by another program.

    Parameters
    ----------
    item : SensorOnMesh
        As :func:`.read_probe_list` or :func:`.sensors_on_meshes` returns it.
    target : TriangleMesh or sequence of TriangleMesh
        Each in the frame of what presses, metres.
    dt : float, seconds
        Step of the other program.
    sensor_pose : Pose
    target_pose : Pose or sequence of Pose
        At the start; a sequence if `target` is one.
    threads : int, optional
        How many to compute with; by default one, and more for thousands of texels.

    Raises
    ------
    PalpateError
        The sensor, the mesh or the step makes no run, or a pose is none.

    Attributes
    ----------
    too_deep : int
        How many contact points are pressed past their maximum penetration at the last step, and measure nothing.

    Notes
    -----
    The forces at the end of a step follow from where both are then and how they came there. The other program integrates them
    explicitly, so its step has to be below m / c and 2 √(m / K), for a mass m on all texels it covers together, of stiffness K
    and damping c.
    """

    def __init__(
        self,
        item: SensorOnMesh,
        target: TriangleMesh | Sequence[TriangleMesh],
        dt: float,
        sensor_pose: Pose,
        target_pose: Pose | Sequence[Pose],
        threads: int | None = None,
    ):
        self._one_target = isinstance(target, TriangleMesh)
        targets = [target] if isinstance(target, TriangleMesh) else list(target)
        model = self._model = PressedModel(item, targets, dt, threads)
        self._out, self._memory = PressedTexels.zero(1, model.texels, len(targets)), StepMemory.zero(model.texels, len(targets))
        self._environments: list[Environment] = model.environments(1)
        self._pressing = model.pressing(self._memory, self._out, self._environments)
        self._start = self._out.poses.copy()
        self.reset(sensor_pose, target_pose)

    @property
    def too_deep(self) -> int:
        """How many contact points are pressed past their maximum penetration at the last step."""
        return int(self._out.too_deep[0])

    def reset(self, sensor_pose: Pose, target_pose: Pose | Sequence[Pose]) -> None:
        """Begin anew at these poses, at rest, without bristles and memory of effects.

        Raises
        ------
        ParameterError
            A pose is not finite, or a quaternion is zero.
        """
        self._read_poses(sensor_pose, target_pose)
        self._chain: ReadoutChain | None = self._model.readout_chain()
        self._steps = 0
        begin_at(self._out.poses[0], self._environments[0])
        self._out.begins[0] = False

    def step(self, sensor_pose: Pose, target_pose: Pose | Sequence[Pose], out: Contact | None = None) -> Contact:
        """Go on by one step, to these poses, and return the forces there.

        Parameters
        ----------
        sensor_pose : Pose
        target_pose : Pose or sequence of Pose
            A sequence if there are several targets.
        out : Contact, optional
            Returned by an earlier step, to write into instead of new arrays.

        Raises
        ------
        ParameterError
            A pose is not finite, or a quaternion is zero. The sensor stays at the step before.
        """
        self._read_poses(sensor_pose, target_pose)
        self._press()
        self._steps += 1
        memory, wrench = self._memory, self._out.wrench[0]
        moment = memory.moment[0]
        if self._chain is not None:
            self._out.readings[0] = self._chain.step(self._steps / self._model.rate, memory.force)
        centre = moment[:3] / moment[3] if moment[3] > 0.0 else np.zeros(3)
        values = (
            memory.force, memory.shear, memory.friction, memory.depth, memory.slip, memory.contact, self._out.readings[0],
            memory.whole_net[:3], memory.whole_net[3:], centre,
        )  # fmt: skip
        if self._one_target:
            wrench = wrench[0]
        force, torque = wrench[..., :3], wrench[..., 3:]
        if out is None:
            return Contact(SensorFrame(*[value.copy() for value in values]), force.copy(), torque.copy())
        for name, value in zip(SENSOR_FIELDS, values, strict=True):
            getattr(out.texels, name)[...] = value
        out.force_on_target[...], out.torque_on_target[...] = force, torque
        return out

    def _press(self) -> None:
        """Let the solver take one step."""
        model = self._model
        if not model.helpers:
            press(0, 1, self._pressing, self._environments)
            return
        (environment,) = self._environments
        arrays = self._pressing.model, environment.detection, environment.state, self._pressing.workspace
        with helper_threads(self._pressing.workspace.queue, model.helpers, help_with_loops, *arrays):
            press(0, 1, self._pressing, self._environments)

    def _read_poses(self, sensor_pose: Pose, target_pose: Pose | Sequence[Pose]) -> None:
        """Write the poses down for the solver, if all of them are some."""
        rows = self._start[0]
        poses = [sensor_pose, target_pose] if self._one_target else [sensor_pose, *target_pose]
        if len(poses) != len(rows):
            raise ParameterError(f"There are {len(poses) - 1} poses of targets for {len(rows) - 1} targets: give one for each.")
        for number, (pose, row) in enumerate(zip(poses, rows, strict=True)):
            try:
                position, quaternion = pose
                fits = np.shape(position) == (3,) and np.shape(quaternion) == (4,)
                if fits:
                    row[:3], row[3:] = position, quaternion
            except (TypeError, ValueError):
                fits = False
            square = float(row[3:] @ row[3:])
            if not (fits and np.isfinite(row).all() and 0.0 < square < np.inf):
                whose = "sensor" if number == 0 else "target" if self._one_target else f"target {number}"
                raise ParameterError(
                    f"The pose of the {whose} is no position and quaternion of finite numbers: check its simulation."
                )
        self._out.poses[0] = rows
