# SPDX-License-Identifier: GPL-3.0-or-later
"""A Palpate sensor in a scene of Isaac Lab 3, on its ``SensorBase``.

Written against the documented interface of Isaac Lab 3.0 and tested with a double of it: NOT tried in Isaac Lab itself.
"""

from __future__ import annotations

import inspect
from typing import Any

from ..core.errors import PalpateError, ParameterError
from ..core.geometry.mesh import TriangleMesh
from ..core.geometry.shapes import Shape
from ..core.simulators.environment_parameters import Columns
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from ..core.simulators.warp.engine import require_engine
from .engine_sensors import EngineSensors, TouchData, sensor_of

require_engine("isaaclab", "isaaclab", (0, 0))  # its version in a checkout is not that of the release

from isaaclab.sensors import SensorBase, SensorBaseCfg  # noqa: E402  # the bases below are Isaac Lab's
from isaaclab.sim.views import FrameView  # noqa: E402
from isaaclab.utils.configclass import configclass  # noqa: E402

if "env_mask" not in inspect.signature(SensorBase.reset).parameters:
    raise PalpateError("The plug-in needs Isaac Lab 3.0 or later: run 'pip install --upgrade isaaclab'.")

from isaaclab.cloner.cloner_cfg import expand_env_regex_ns  # noqa: E402


class TouchSensor(SensorBase):
    """The sensor of a :class:`TouchSensorCfg`; :attr:`data` is a :class:`TouchData`.

    It goes on by one step with each update of the scene, also when nobody reads :attr:`data`. Set ``lazy_sensor_update=False``
    of the scene, which then publishes poses before it updates sensors. It applies no forces: add ``data.wrench`` to the
    targets' external wrenches, and its opposite to the sensor's body.
    """

    def __init__(self, cfg: Any):
        sensor_of(cfg.prim_path, cfg.sensor)
        super().__init__(cfg)

    @property
    def data(self) -> TouchData:
        """Forces and readings of the sensor."""
        return self._results

    def reset(self, env_ids: Any = None, env_mask: Any = None) -> None:
        """Let environments begin again with their next step: by index, by a mask of Warp, or all."""
        super().reset(env_ids, env_mask)
        if env_mask is not None:
            self._touch.sensors.reset(env_mask)
        else:
            self._touch.reset(None if isinstance(env_ids, slice) else env_ids)

    def update(self, dt: float, force_recompute: bool = False) -> None:
        """Go on by one step of the simulation, to its present poses.

        Raises
        ------
        ParameterError
            `dt` is not the step of the simulation.
        """
        if self.is_initialized:
            self._touch.check_step(dt)
        super().update(dt, force_recompute=True)

    def _initialize_impl(self) -> None:
        super()._initialize_impl()
        cfg = self.cfg
        paths = [cfg.prim_path, *map(expand_env_regex_ns, cfg.targets)]
        self._views = [FrameView(path, device=self._device) for path in paths]
        for path, view in zip(paths, self._views, strict=True):
            if view.count != self._num_envs:
                raise ParameterError(
                    f"'{path}' is found {view.count} times in {self._num_envs} environments: name one in each."
                )
        options = self._num_envs, self._device, cfg.single, cfg.parameters
        self._touch = EngineSensors(cfg.prim_path, cfg.sensor, list(cfg.targets.values()), self._sim_physics_dt, *options)
        self._results, self._poses = self._touch.data(), self._touch.tensor(self._touch.sensors.poses)

    def _update_buffers_impl(self, env_mask: Any) -> None:
        for column, view in enumerate(self._views):
            position, quaternion = view.get_world_poses()
            self._poses[:, column, :3] = position.torch
            self._poses[:, column, 3:] = quaternion.torch[:, [3, 0, 1, 2]]  # Isaac Lab's are (x, y, z, w)
        self._touch.sensors.step()


@configclass
class TouchSensorCfg(SensorBaseCfg):
    """A tactile sensor on a prim, such as ``{ENV_REGEX_NS}/Robot/fingertip``.

    Attributes
    ----------
    class_type : type
    prim_path : str
        Whose frame is that of the texels.
    sensor : Sensor
        As ``palpate.read_sensor`` returns it.
    targets : dict of str to Shape or TriangleMesh
        Objects in contact, by the paths of their prims: ``{"{ENV_REGEX_NS}/Cube": palpate.Body.box(0.05)}``.
    single : bool
        Compute in float32. Isaac Lab's poses are float32 in any case.
    parameters : mapping of str to (E,) float, optional
        In which the sensors of environments differ, as ``{"k": …, "mus": …}``.
    """

    class_type: type = TouchSensor
    sensor: SensorOnMesh | None = None
    targets: dict[str, TriangleMesh | Shape] = {}  # noqa: RUF012  # configclass makes a factory of it
    single: bool = False
    parameters: Columns | None = None
