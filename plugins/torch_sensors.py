# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors on Warp for engines that train with PyTorch: the results as tensors, and what such plug-ins check alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..core.errors import ParameterError
from ..core.geometry.mesh import TriangleMesh
from ..core.geometry.shapes import Shape
from ..core.simulators.environment_parameters import Columns
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from ..core.simulators.warp.engine import require_warp
from ..core.simulators.warp.warp_sensors import WarpSensors

wp: Any = require_warp()


class TouchData(NamedTuple):
    """What a sensor with n texels measures in E environments, as tensors of torch that share the sensor's memory.

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


class TorchSensors:
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
    data : TouchData
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
        self._name, self._step = name, step
        self.sensors = WarpSensors(sensor, targets, step, environments, str(wp.get_device(str(device))), single, parameters)
        arrays = self.sensors.texels, self.sensors.readings, self.sensors.contact, self.sensors.wrench
        self.data = TouchData(*(wp.to_torch(one) for one in arrays))

    def reset(self, env_ids: Any = None) -> None:
        """Let environments begin again with their next step: by index, or all."""
        if env_ids is None:
            self.sensors.reset()
            return
        mask = self.data.contact.new_zeros(len(self.sensors))
        mask[env_ids] = True
        self.sensors.reset(wp.from_torch(mask, dtype=wp.bool))

    def check_step(self, dt: float) -> None:
        """Raise :class:`.ParameterError` where the engine's step is another."""
        if abs(dt - self._step) > 1e-6 * self._step:
            raise ParameterError(
                f"'{self._name}' is updated after {dt:g} s, and the model's timestep is {self._step:g} s: "
                "update the scene after each step."
            )


def sensor_of(name: str, sensor: SensorOnMesh | None) -> SensorOnMesh:
    """Return the sensor of a configuration; raise :class:`.ParameterError` where there is none."""
    if sensor is None:
        raise ParameterError(f"The sensor '{name}' has no texels: give `sensor`, as palpate.read_sensor returns it.")
    return sensor
