# SPDX-License-Identifier: GPL-3.0-or-later
"""Common part of the sensors of all engines: an engine that is imported on demand, its shapes, and sensors on Warp."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import ParameterError
from ..core.geometry.mesh import TriangleMesh
from ..core.geometry.shapes import Shape, box, capsule, plane, sphere
from ..core.simulators.environment_parameters import Columns
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from ..core.simulators.warp.engine import require_warp
from ..core.simulators.warp.warp_sensors import WarpSensors

SHAPES: dict[str, Callable[[Any], Shape]] = {
    "sphere": lambda size: sphere(size[0]),
    "box": lambda size: box(tuple(2.0 * size[:3])),
    "capsule": lambda size: capsule(size[0], 2.0 * size[1]),
    "plane": lambda _: plane(),
}
"""Simple shapes by the names that MuJoCo and Newton give them, from half sizes (3,), metres."""


class TouchData(NamedTuple):
    """Forces and readings of a sensor with n texels in E environments, as tensors of torch that share the sensor's memory.

    Attributes
    ----------
    texels : (E, n, 3) torch.Tensor, N
        Normal force, and shear along the texel's x and y axis.
    readings : (E, n) torch.Tensor
    contact : (E, n) torch.Tensor of bool
    wrench : (E, T, 6) torch.Tensor, N and N·m
        On each target in the world, about the origin of its frame.
    """

    texels: Any
    readings: Any
    contact: Any
    wrench: Any


class EngineSensors:
    """A sensor in the environments of an engine.

    Parameters
    ----------
    name : str
        For messages.
    sensor : SensorOnMesh
    targets : sequence of TriangleMesh or Shape
    step : float, seconds
        Of the engine.
    environments : int
    device : str
        As torch or Warp names it.
    single : bool
        Compute in float32.
    parameters : mapping of str to (E,) float, optional
        In which the sensors of environments differ.

    Attributes
    ----------
    sensors : WarpSensors
    """

    def __init__(
        self,
        name: str,
        sensor: SensorOnMesh,
        targets: Sequence[TriangleMesh | Shape],
        step: float,
        environments: int,
        device: Any,
        single: bool = False,
        parameters: Columns | None = None,
    ):
        self._warp, self._name, self._step = require_warp(), name, step
        device = str(self._warp.get_device(str(device)))
        self.sensors = WarpSensors(sensor, targets, step, environments, device, single, parameters)

    def data(self) -> TouchData:
        """Return the results as tensors, which each step changes."""
        arrays = self.sensors.texels, self.sensors.readings, self.sensors.contact, self.sensors.wrench
        return TouchData(*map(self.tensor, arrays))

    def tensor(self, array: Any) -> Any:
        """Return an array of Warp as a tensor of torch that shares its memory."""
        return self._warp.to_torch(array)

    def reset(self, env_ids: Any = None) -> None:
        """Let environments begin again with their next step: by index, or all."""
        if env_ids is None:
            self.sensors.reset()
            return
        mask = self.tensor(self.sensors.valid).new_zeros(len(self.sensors))
        mask[env_ids] = True
        self.sensors.reset(self._warp.from_torch(mask, dtype=self._warp.bool))

    def check_step(self, dt: float) -> None:
        """Raise :class:`.ParameterError` where the engine's step is another."""
        if abs(dt - self._step) > 1e-6 * self._step:
            raise ParameterError(
                f"'{self._name}' is updated after {dt:g} s, and the model's timestep is {self._step:g} s: "
                "update the scene after each step."
            )

    def launch(self, kernel: Any, threads: int | tuple[int, ...], *inputs: Any) -> None:
        """Run a kernel of :mod:`.engine_kernels` on the sensors' device."""
        self._warp.launch(kernel, dim=threads, inputs=list(inputs), device=self.sensors.device)

    def indices(self, rows: Sequence[Any]) -> Any:
        """Return integers on the sensors' device."""
        return self._warp.array(rows, dtype=int, device=self.sensors.device)


def sensor_of(name: str, sensor: SensorOnMesh | None) -> SensorOnMesh:
    """Return the sensor of a configuration; raise :class:`.ParameterError` where there is none."""
    if sensor is None:
        raise ParameterError(f"The sensor '{name}' has no texels: give `sensor`, as palpate.read_sensor returns it.")
    return sensor


def target_of(
    name: str, kind: str, size: np.ndarray, mesh: Callable[[], tuple[np.ndarray, np.ndarray]]
) -> TriangleMesh | Shape:
    """Return a shape of an engine as a target; raise :class:`.ParameterError` where its kind has none.

    Parameters
    ----------
    name : str
        For messages.
    kind : str
        In lower case, as the engine has it.
    size : (3,) float, metres
        Half sizes.
    mesh : callable
        Returns vertices and triangles of a mesh.
    """
    if kind.endswith("mesh"):
        vertices, triangles = mesh()
        return TriangleMesh(np.array(vertices, float), np.array(triangles, np.int64).reshape(-1, 3))
    if kind not in SHAPES:
        raise ParameterError(f"{name} is a {kind}: take infinite planes, spheres, capsules, boxes and meshes.")
    return SHAPES[kind](size)
