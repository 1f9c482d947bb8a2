# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor inside the loop of another simulator: poses in, forces of texels out, and the wrench that goes back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..effects.engine.registry import mounted_texels
from ..errors import ParameterError
from ..geometry.mesh import TriangleMesh
from ..geometry.shapes import Shape
from ..model.recording import SENSOR_FIELDS, SensorFrame
from ..solver.jumps import JumpFinder
from ..solver.pressed_model import PressedModel, targets_of
from ..solver.pressing import PressedTexels, StepMemory, begin_at
from .load_balance import PULL, LoadBalance
from .pressed_sensors import REMEDY
from .sensor_on_mesh import SensorOnMesh

Pose = tuple[ArrayLike, ArrayLike] | np.ndarray
"""Position (3,) in metres and quaternion (4,), (w, x, y, z), of a frame in the world: a pair, or one array (7,)."""
LARGEST_SPEED = 20.0
"""Metres per second of the first step after a reset. Robots and hands move below 10."""


@dataclass(frozen=True)
class Contact:
    """Forces and readings of a sensor at one step, and the reaction.

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
    """A sensor and the object in contact with it, both moved by another program.

    Parameters
    ----------
    item : SensorOnMesh
        As :func:`.read_probe_list` or :func:`.sensors_on_meshes` returns it.
    target : TriangleMesh or Shape, or a sequence of them
        Each in the frame of the object, metres. Contacts with a shape (sphere, box, capsule, plane) are in closed form.
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
    residual : (1,), (3,) or (6,) float, N and N·m
        Part of the load given to the last step that no contact balances.
    residual_reason : str
        One sentence where this load pulls, with the convention of loads; else empty.
    displacement : (6,) float, metres and rad
        Of the target from its pose at the last step, for the load: in the world, and rotation vector about its origin.

    Notes
    -----
    The forces at the end of a step follow from where both are then and how they came there. The other program integrates them
    explicitly, so its step has to be below m / c and 2 √(m / K), for a mass m on all texels it covers together, of stiffness K
    and damping c.
    """

    def __init__(
        self,
        item: SensorOnMesh,
        target: TriangleMesh | Shape | Sequence[TriangleMesh | Shape],
        dt: float,
        sensor_pose: Pose | None = None,
        target_pose: Pose | Sequence[Pose] | None = None,
        threads: int | None = None,
    ):
        self._one_target = isinstance(target, TriangleMesh | Shape)
        targets = targets_of(target)
        self._unit = item.sensor.parameters.unit
        model = self._model = PressedModel(item.sensor, targets, dt, threads)
        out = self._out = PressedTexels.zero(1, model.texels, len(targets))
        memory = self._memory = StepMemory.zero(model.texels, len(targets))
        self._environments, self._workspace = model.environments(1), model.workspace()
        self._press_environments = model.presser(memory, out, self._environments, self._workspace)
        self._rows = [(row[:3], row[3:]) for row in out.poses[0]]
        arrays = (
            memory.force, memory.shear, memory.friction, memory.depth, memory.slip, memory.contact, out.readings[0],
            memory.whole_net[:3], memory.whole_net[3:], memory.centre,
        )  # fmt: skip
        self._texels = dict(zip(SENSOR_FIELDS, arrays, strict=True))
        wrench = out.wrench[0, 0] if self._one_target else out.wrench[0]
        self._force, self._torque = wrench[..., :3], wrench[..., 3:]
        self._balance: LoadBalance | None = None
        self._jumps = JumpFinder(mounted_texels(item.sensor), targets, out)
        self.residual = np.zeros(0)
        self._steps = 0
        self._chain = model.readout_chain()
        if target_pose is not None and sensor_pose is not None:
            self.reset(sensor_pose, target_pose)

    def __repr__(self) -> str:
        targets = self._out.poses.shape[1] - 1
        count = f"{targets} target{'s' if targets > 1 else ''}"
        return f"<PressedSensor: {self._model.texels} texels, {count}, step {1e3 / self._model.rate:.4g} ms>"

    @property
    def displacement(self) -> np.ndarray:
        """(6,) float, metres and rad: of the target from its pose at the last step, for the load.

        In the world, and rotation vector about its origin.
        """
        return np.zeros(6) if self._balance is None else self._balance.displacement[0].copy()

    @property
    def residual_reason(self) -> str:
        """One sentence where the load given to the last step pulls, with the convention of loads; else empty."""
        is_pull = len(self.residual) and self._balance is not None and self._balance.pulls[0]
        return f"The load {PULL}" if is_pull else ""

    @property
    def too_deep(self) -> int:
        """How many contact points are pressed past their maximum penetration at the last step, and measure nothing."""
        return int(self._out.too_deep[0])

    def reset(self, sensor_pose: Pose, target_pose: Pose | Sequence[Pose]) -> None:
        """Reset to these poses, at rest, without bristles and memory of effects.

        Raises
        ------
        ParameterError
            A pose is not finite, or a quaternion is zero.
        """
        self._read_poses(sensor_pose, target_pose)
        self._check_poses()
        self._chain = self._model.readout_chain()
        self._steps = 0
        begin_at(self._out.poses[0], self._environments[0])
        self._out.begins[0] = False
        self._forget_load()
        self._jumps.find()

    def step(
        self,
        sensor_pose: Pose,
        target_pose: Pose | Sequence[Pose],
        out: Contact | None = None,
        wrench: ArrayLike | None = None,
    ) -> Contact:
        """Go on by one step, to these poses, and return the forces there.

        Parameters
        ----------
        sensor_pose : Pose
        target_pose : Pose or sequence of Pose
            A sequence if there are several targets.
        out : Contact, optional
            Returned by an earlier step, to write into instead of new arrays.
        wrench : (6,), (3,) or (1,) float, N and N·m, optional
            What the contact exerts on the target, in the world: force and torque about its origin, force alone, or force along
            the mean normal of the texels. For 1 kg at rest on a sensor that faces up it is ``(0, 0, 9.81)``, against the weight
            of ``(0, 0, -9.81)``, and ``(9.81,)`` along the normal. The target is displaced until the contact exerts it (see
            :mod:`.load_balance`), along and about all axes, along all axes, or along the normal.

        Raises
        ------
        ParameterError
            A pose is not finite, or a quaternion is zero; or the load is none. The sensor stays at the step before. Or a target
            went through the sensor within this step; the sensor is behind it now, and goes on.
        """
        before = self._out.poses[0, :, :3].copy() if self._steps == 0 and not self._out.begins[0] else None
        self._read_poses(sensor_pose, target_pose)
        if before is not None:
            self._require_plausible_speed(before)
        if wrench is None:
            self._forget_load()
            self._press()
        else:
            self._check_poses()
            self._press_under(wrench)
        if not self._out.valid[0]:
            self._out.begins[0] = False
            self._check_poses()
        self._steps += 1
        if self._chain is not None:
            self._out.readings[0] = self._chain.step(self._steps / self._model.rate, self._memory.force)
        self._jumps.find()
        if self._jumps.jumped[0]:
            raise ParameterError(f"A target went through the sensor within one step: {REMEDY}")
        if out is None:
            copies = {name: values.copy() for name, values in self._texels.items()}
            texels = SensorFrame(**copies, channels=None, unit=self._unit)
            return Contact(texels, self._force.copy(), self._torque.copy())
        for name, values in self._texels.items():
            np.copyto(getattr(out.texels, name), values)
        np.copyto(out.force_on_target, self._force)
        np.copyto(out.torque_on_target, self._torque)
        return out

    def _require_plausible_speed(self, before: np.ndarray) -> None:
        """Raise :class:`.ParameterError` if the first step begins where no body could have come from."""
        way = np.linalg.norm(self._out.poses[0, :, :3] - before, axis=1)
        speed = float(way.max()) * self._model.rate
        if speed > LARGEST_SPEED and np.isfinite(speed):
            self._out.poses[0, :, :3] = before
            raise ParameterError(
                f"The first step goes {float(way.max()):.3g} m in {1.0 / self._model.rate:.3g} s, {speed:.3g} m/s: "
                "give the poses at the start, or none to begin at the first step."
            )

    def _press(self) -> None:
        """Run one step to the poses."""
        if self._model.helpers:
            with self._model.helping(self._environments[0], self._workspace):
                self._press_environments(0, 1)
        else:
            self._press_environments(0, 1)

    def _press_under(self, wrench: ArrayLike) -> None:
        """Run one step under a load."""
        try:
            load = np.asarray(wrench, float)
        except (TypeError, ValueError):
            load = np.zeros(0)
        if load.shape not in ((1,), (3,), (6,)) or not np.isfinite(load).all():
            raise ParameterError(
                "The wrench is not 1, 3 or 6 finite numbers: give a normal force, a force, or force and torque."
            )
        if self._balance is None:
            self._balance = LoadBalance(self._model, self._out, self._environments, self._press)
        self.residual = self._balance.step(load[None])[0]

    def _forget_load(self) -> None:
        """Go on without displacement."""
        self.residual = np.zeros(0)
        if self._balance is not None:
            self._balance.forget(np.ones(1, bool))

    def _read_poses(self, sensor_pose: Pose, target_pose: Pose | Sequence[Pose]) -> None:
        """Write the poses down for the solver, which looks whether they are finite."""
        poses: Sequence[Any] = (sensor_pose, target_pose) if self._one_target else (sensor_pose, *target_pose)
        if len(poses) != len(self._rows):
            raise ParameterError(
                f"There are {len(poses) - 1} poses of targets for {len(self._rows) - 1} targets: give one for each."
            )
        for number, (pose, rows) in enumerate(zip(poses, self._rows, strict=True)):
            try:
                position, quaternion = (pose[:3], pose[3:]) if len(pose) == 7 else pose
                fits = len(position) == 3 and len(quaternion) == 4
                rows[0][:], rows[1][:] = position, quaternion
            except (TypeError, ValueError):
                fits = False
            if not fits:
                raise self._no_pose(number)

    def _check_poses(self) -> None:
        """Raise :class:`.ParameterError` for a pose that is none."""
        for number, row in enumerate(self._out.poses[0]):
            if not (np.isfinite(row).all() and 0.0 < row[3:] @ row[3:] < np.inf):
                raise self._no_pose(number)

    def _no_pose(self, number: int) -> ParameterError:
        """Return the error for a body whose pose is none."""
        whose = "sensor" if number == 0 else "target" if self._one_target else f"target {number}"
        return ParameterError(
            f"The pose of the {whose} is not a position and quaternion of finite numbers: check its simulation."
        )
