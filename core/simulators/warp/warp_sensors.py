# SPDX-License-Identifier: GPL-3.0-or-later
"""One sensor in many environments on Warp: on a processor, and by the same code on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from ...effects.engine.readout_chain import transducers_of
from ...effects.engine.registry import check_scenario, mounted_texels
from ...errors import PalpateError, ParameterError
from ...geometry.bvh import build_tree
from ...geometry.contact_points import ContactPoints, contact_points
from ...geometry.mesh import TriangleMesh
from ...geometry.rotations import rotation_matrices
from ...geometry.shapes import MESH, Shape
from ...laws.contact_law import contact_law
from ...model.sensor import Sensor
from ...solver.detection.deformation import point_rows
from ...solver.pressed_model import pressed_scenario, targets_of
from ..environment_parameters import Columns, sensors_of
from ..load_balance import check_targets, pulling_loads, reason_of_pulls
from ..load_search import LoadSearch
from ..pressed_sensors import available_memory, check_memory, checked_mask, checked_numbers, fault_of
from ..sensor_on_mesh import SensorOnMesh
from . import balance_kernels, press_kernels
from .block import WARP
from .effect_functions import EffectFunctions, functions_of
from .engine import require_device, require_warp
from .press_arrays import Jumps, Results, SensorArrays, Slots, TargetArrays, Worlds, split_leaves
from .translation import Translation

_TRANSLATIONS: dict[Any, Translation] = {}


class WarpSensors:
    """A sensor and the object in contact with it in many environments, computed by Warp.

    In float64 the results are those of :class:`.PressedSensors` within 1e-9; a step asks nothing of the host, so that it may be
    captured as a CUDA graph.

    Parameters
    ----------
    item : SensorOnMesh
    target : TriangleMesh or Shape, or a sequence of these
        Each in the frame of the object, metres; :mod:`.geometry.shapes` makes a box, sphere, capsule or plane.
    dt : float, seconds
        Step of the other program.
    environments : int
    device : str
        As Warp names it: ``cpu``, ``cuda:0``.
    single : bool
        Compute in float32, which is faster on most GPUs. Depths then carry the rounding of the poses, 6e-8 of a coordinate.

    parameters : mapping of str to (E,) float, optional
        In which the sensors of environments differ, as of :class:`.PressedSensors`.

    Raises
    ------
    PalpateError
        The sensor, the targets or the step make no run, an effect has no kernel, memory does not suffice, or Warp or the
        device is missing.

    Attributes
    ----------
    texels : (E, n, 3) warp.array, N
        Normal force, and shear along the texel's x and y axis, on the sensor.
    readings : (E, n) warp.array, the sensor's unit
    contact : (E, n) warp.array of bool
    wrench : (E, T, 6) warp.array, N and N·m
        Force on each target in the world, and torque about the origin of its frame.
    too_deep : (E,) warp.array of int
        How many contact points are pressed past their maximum penetration, and measure nothing. Simple shapes also tell those
        that were as deep when the environment began.
    valid : (E,) warp.array of bool
        False where a pose is not finite or a quaternion is zero: everything is zero there, and the environment begins again
        with its next valid poses.
    jumped : (E,) warp.array of bool
        True where a target went through the sensor within the last step (see :class:`..pressed_sensors.Contacts`).
    poses : (E, 1 + T, 7) warp.array
        Of the sensor and of each target: position (m) and quaternion (w, x, y, z). A program on the device may write them
        itself, and then call :meth:`step` without poses.
    residual : (E, 1), (E, 3) or (E, 6) warp.array, N and N·m
        Part of the loads given to the last step that no contact balances; None where none was given.
    residual_reason : str
        One sentence where some of these loads pull, with the convention of loads; else empty.
    displacement : (E, 6) warp.array, metres and rad
        Of the targets from their poses at the last step, for the loads: in the world, and rotation vector about their origin;
        None before a load was given.
    """

    def __init__(
        self,
        item: SensorOnMesh,
        target: TriangleMesh | Shape | Sequence[TriangleMesh | Shape],
        dt: float,
        environments: int,
        device: str = "cpu",
        single: bool = False,
        parameters: Columns | None = None,
    ):
        warp = require_warp()
        targets = targets_of(target)
        _check(item.sensor, targets, dt, environments)
        self._warp, self.device = warp, require_device(warp, device, single)
        self._on_gpu = bool(warp.get_device(self.device).is_cuda)
        sensor = item.sensor
        points = contact_points(sensor.texels, sensor.parameters.points_per_texel)
        sensors = sensors_of(sensor, parameters, environments) if parameters else [sensor]
        effects = functions_of(sensors, dt)
        e, n, t, p = environments, len(sensor.texels), len(targets), len(points.texel)
        self._size, self._of_slots = (e, n, t), (t, p, n, effects.laws, effects.reading_laws)
        tree = build_tree(_meshes(targets))
        tree = split_leaves(tree) if self._on_gpu else tree
        translation = self._translation = _translation(warp, single, effects, sensor)
        kind = np.array([one.kind if isinstance(one, Shape) else MESH for one in targets])
        sizes = np.array([one.size if isinstance(one, Shape) else (0.0, 0.0, 0.0) for one in targets])
        shared = _sensor_arrays(sensors, points, effects, dt, e), TargetArrays(kind, sizes, np.cumsum(kind == MESH) - 1), tree
        self._sensor, self._targets, self._tree = (translation.value(part, self.device) for part in shared)
        examples = Worlds.zero(1, t), Slots.zero(1, *self._of_slots), Results.zero(1, n, t)
        self.bytes_per_environment = translation.bytes_of(*examples)
        self._worlds, self._slots, out = self._room(*examples)
        self._out = out
        self.texels, self.readings, self.contact = out.texels, out.readings, out.contact
        self.wrench, self.too_deep, self.valid, self.poses = out.wrench, out.too_deep, self._worlds.valid, self._worlds.poses
        jumps = translation.value(Jumps.of(mounted_texels(sensor), targets, e), self.device)
        self._jumps, self.jumped = jumps, jumps.jumped
        self._item, self._kernel_of_load = sensor, None
        self._balance: tuple[Any, ...] = ()
        self.residual: Any = None
        self.displacement: Any = None
        kernels, kernel = press_kernels, translation.kernel
        self._move, self._reset = kernel(kernels.move_world, 2), kernel(kernels.reset_worlds, 1)
        self._press = kernel(kernels.press_texel, 2, registers=PRESS_REGISTERS[translation.real.__name__])
        self._finish = kernel(kernels.finish_world, 2, WARP)

    def __len__(self) -> int:
        """Return the number of environments."""
        return int(self._size[0])

    def __repr__(self) -> str:
        return f"<WarpSensors: {self._size[0]} environments, {self._size[1]} texels, {self._size[2]} targets, on {self.device}>"

    def _room(self, *examples: Any) -> list[Any]:
        """Return the arrays of all environments, given those of one; raise :class:`.ParameterError` where memory is short."""
        device, size = self._warp.get_device(self.device), self._translation.bytes_of(*examples)
        free = float(device.free_memory) if self._on_gpu else available_memory()
        check_memory(len(self), size, free)
        try:
            return [self._translation.room(one, len(self), self.device) for one in examples]
        except RuntimeError as error:
            raise ParameterError(
                f"{self.device} has no {len(self) * size / 2**30:.1f} GiB of memory in one piece for {len(self)} environments: "
                "ask for fewer."
            ) from error

    def step(self, sensor_poses: Any = None, target_poses: Any = None, wrench: Any = None) -> WarpSensors:
        """Go on by one step, to these poses; the results are in the arrays of this object.

        Parameters
        ----------
        sensor_poses : (E, 7) float, optional
            Arrays of NumPy; by default :attr:`poses` holds the poses already.
        target_poses : (E, T, 7) or, of one target, (E, 7) float, optional
        wrench : (E, 6), (E, 3) or (E, 1) float, N and N·m, optional
            Load of each environment, as in :meth:`.PressedSensor.step`; an array of NumPy, or of Warp on the device.

        Raises
        ------
        ParameterError
            Poses or loads have another shape, or loads are given in float32 or for several targets. Those that are not finite
            are no error (see :attr:`valid`).
        """
        if sensor_poses is not None or target_poses is not None:
            self._take(sensor_poses, target_poses)
        (e, n, _), sensor, worlds, slots = self._size, self._sensor, self._worlds, self._slots
        arrays, ends = (sensor, self._targets, self._tree, worlds, slots), (self._jumps, self._out)
        movers, adders = (MOVERS, WARP) if self._on_gpu else (1, 1)
        if wrench is not None:
            degrees = self._take_loads(wrench)
            self._launch(self._kernel_of_load, (e, adders), adders, degrees, *arrays, *ends, *self._balance)
        else:
            self.residual = None
            if self._balance:  # go on without displacement
                self._balance[1].at.zero_()
                self._balance[1].state.zero_()
            self._launch(self._move, (e, movers), movers, sensor, worlds)
            self._launch(self._press, (e, n), *arrays, self._out)
            self._launch(self._finish, (e, adders), adders, sensor, worlds, slots, *ends)
        return self

    def _launch(self, kernel: Any, threads: tuple[int, ...], *inputs: Any) -> None:
        """Run a kernel; :class:`.PalpateError` where the device is lost."""
        try:
            block = kernel.module.options["block_dim"]  # of a GPU
            self._warp.launch(kernel, dim=threads, inputs=list(inputs), device=self.device, block_dim=block)
        except RuntimeError as error:
            raise PalpateError(
                f"{self.device} did not take the step and its arrays are lost, so make the sensors again: {error}"
            ) from error

    @property
    def residual_reason(self) -> str:
        """Reasons as :attr:`.PressedSensors.residual_reason` gives them; the loads and poses come to the host for it."""
        if self.residual is None:
            return ""
        search, degrees = self._balance[1], self.residual.shape[1]
        quaternion = self.poses.numpy()[:, 0, 3:].astype(float)
        length = np.linalg.norm(quaternion, axis=1, keepdims=True)
        rotation = rotation_matrices(np.divide(quaternion, length, out=np.eye(4)[[0] * len(self)], where=length > 0.0))
        given, direction = search.given.numpy()[:, :degrees], search.direction.numpy()
        return reason_of_pulls(pulling_loads(given, direction, rotation, self._item.texels.normal))

    def fault(self) -> str:
        """Return :meth:`.Contacts.fault`; the arrays come to the host for it."""
        return fault_of(self.valid.numpy(), self.jumped.numpy())

    def reset(self, mask: Any = None) -> None:
        """Let environments begin again with their next step: at rest, without bristles and memory of effects.

        Parameters
        ----------
        mask : (E,) bool, optional
            Which, as an array of NumPy or of Warp on the device; by default all.
        """
        warp = self._warp
        if mask is None:
            self._worlds.begins.fill_(True)
            return
        chosen = mask
        if not isinstance(mask, warp.array):
            chosen = warp.array(checked_mask(mask, len(self)), dtype=warp.bool, device=self.device)
        elif mask.dtype is not warp.bool or mask.shape != (len(self),) or str(mask.device) != str(self.device):
            raise ParameterError(
                f"The mask of environments to reset is {mask.dtype.__name__} of shape {mask.shape} on {mask.device}: "
                f"give ({len(self)},) bool on {self.device}."
            )
        self._launch(self._reset, (len(self),), chosen, self._worlds)

    def _take(self, sensor_poses: Any, target_poses: Any) -> None:
        """Copy poses of NumPy to the device."""
        e, _, t = self._size
        shapes = [(e, t, 7)] if t > 1 else [(e, t, 7), (e, 7)]
        sensor = checked_numbers("The poses of the sensor", sensor_poses, [(e, 7)], f"{(e, 7)}")
        target = checked_numbers("The poses of the target", target_poses, shapes, f"{shapes[-1]}")
        poses = np.concatenate([sensor[:, None], target.reshape(e, t, 7)], axis=1)
        self._warp.copy(self.poses, self._warp.array(poses, dtype=self.poses.dtype, device=self.device))

    def _take_loads(self, wrench: Any) -> int:
        """Copy loads to the device, and return how many components they have."""
        warp, (e, _, t) = self._warp, self._size
        on_device = isinstance(wrench, warp.array)
        load: Any = wrench if on_device else np.asarray(wrench)
        numbers = str(load.device) == self.device if on_device else load.dtype.kind in "fiu"
        if load.shape not in ((e, 1), (e, 3), (e, 6)) or not numbers:
            raise ParameterError(
                f"The loads are of shape {load.shape}: give numbers of shape ({e}, 6), ({e}, 3) or ({e}, 1), "
                f"as an array of NumPy or on {self.device}."
            )
        check_targets(t)
        if self._translation.real is not warp.float64:
            raise ParameterError("In float32 a load cannot be found to a millionth: make the sensors with single=False.")
        degrees, sensor = int(load.shape[1]), self._item
        if not self._balance:
            found = self._translation.value(LoadSearch.of(sensor.texels, sensor.parameters.max_penetration, e), self.device)
            self._balance = *self._room(Slots.zero(1, *self._of_slots)), found
            self._kernel_of_load = self._translation.kernel(balance_kernels.balance_world, 2, WARP)
        search = self._balance[1]
        if not on_device:
            load = warp.array(load, dtype=warp.float64, device=self.device)
        warp.copy(search.given[:, :degrees], load)
        self.residual, self.displacement = search.residual[:, :degrees], search.at
        return degrees


_NO_MESH = TriangleMesh(np.eye(3), np.array([[0, 1, 2]]))
"""Stands for the tree where all targets are simple shapes."""


PRESS_REGISTERS = {"float64": 168, "float32": 128}
"""Most registers of a thread that presses a texel. On an H100, 4,096 × 84 texels under a box take 97, 85 and 91 µs in float64
with 128, 168 and 255 of them, and 275, 272 and 344 µs under a ball's mesh: in float32 174 and 201 µs with 128 and 168.
"""
MOVERS = 4
"""Threads that move an environment on a GPU: of two bodies, each has the beginning or the end of the step."""


def _check(sensor: Sensor, targets: Sequence[TriangleMesh | Shape], dt: float, environments: int) -> None:
    """Raise :class:`.PalpateError` for what makes no run."""
    if environments < 1:
        raise ParameterError(f"There are {environments} environments: ask for one at least.")
    if not targets:
        raise ParameterError(f"Nothing presses on '{sensor.name}': give a target's mesh or shape, or several.")
    for number, target in enumerate(targets, start=1):
        if not isinstance(target, TriangleMesh | Shape):
            raise ParameterError(f"Target {number} is a {type(target).__name__}: give a TriangleMesh or a Shape.")
    check_scenario(pressed_scenario(sensor, _meshes(targets), dt))


def _meshes(targets: Sequence[TriangleMesh | Shape]) -> list[TriangleMesh]:
    return [one for one in targets if isinstance(one, TriangleMesh)] or [_NO_MESH]


def _translation(warp: ModuleType, single: bool, effects: EffectFunctions, sensor: Sensor) -> Translation:
    """Return the functions of Warp for a sensor with these effects; sensors with the same laws share them."""
    laws = "_".join(f"{item.name}_{item.form or 'usual'}" for item in sensor.effects).replace("-", "_") or "plain"
    key = single, laws
    if key not in _TRANSLATIONS:
        _TRANSLATIONS[key] = Translation(warp, warp.float32 if single else warp.float64, laws, effects.instead)
    return _TRANSLATIONS[key]


def _of_each(values: np.ndarray, environments: int) -> np.ndarray:
    """Return values of all environments (E, …), given those of each or of one."""
    return np.broadcast_to(values, (environments, *values.shape[1:]))


def _sensor_arrays(
    sensors: Sequence[Sensor], points: ContactPoints, effects: EffectFunctions, dt: float, environments: int
) -> SensorArrays:
    sensor, parameters = sensors[0], sensors[0].parameters
    share, n = 1.0 / parameters.points_per_texel, len(sensor.texels)
    painted = [np.ones(n) if values is None else values for values in (sensor.painted.k, sensor.painted.friction)]
    return SensorArrays(
        dt=dt,
        reach=float(parameters.max_penetration),
        share=share,
        pulls=int(effects.pulls),
        frame=np.ascontiguousarray(point_rows(mounted_texels(sensor), points, np.zeros(3)).T),
        first_point=np.searchsorted(points.texel, np.arange(n + 1)),
        multipliers=np.column_stack([values[points.texel] for values in painted]),
        law=np.array([contact_law(one.parameters, share) for one in sensors], float),
        conversion=np.concatenate(
            [
                np.column_stack([np.full(n, float(one.zero)), np.broadcast_to(one.gain * one.painted, n)])
                for one in map(transducers_of, sensors)
            ]
        ),
        force_constants=_of_each(effects.force_constants, environments),
        friction_constants=_of_each(effects.friction_constants, environments),
        reading_constants=_of_each(effects.reading_constants, environments),
    )
