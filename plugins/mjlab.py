# SPDX-License-Identifier: GPL-3.0-or-later
"""A Palpate sensor in a scene of mjlab, on its ``Sensor`` base class."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.errors import ParameterError
from ..core.geometry.mesh import TriangleMesh
from ..core.geometry.shapes import Shape
from ..core.simulators.environment_parameters import Columns
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from ..core.simulators.warp.engine import require_engine
from .engine_sensors import EngineSensors, TouchData, sensor_of, target_of

require_engine("mjlab", "mjlab", (1, 6))

import mujoco  # noqa: E402  # the bases below are mjlab's, so it is needed to read this module
from mjlab.sensor import Sensor, SensorCfg  # noqa: E402


@dataclass
class TouchSensorCfg(SensorCfg):
    """A tactile sensor on a body.

    Attributes
    ----------
    name : str
    sensor : Sensor
        As ``palpate.read_sensor`` returns it.
    body : str
        Whose frame is that of the texels; in mjlab a name such as ``robot/fingertip``.
    geoms : tuple of str
        Planes, spheres, capsules, boxes and meshes that press. MuJoCo's contact between them and the body has to be off if
        forces are applied.
    apply : bool
        Write the wrench on the geoms' bodies, and its opposite on the sensor's, to ``xfrc_applied`` of these bodies; other
        forces of theirs are overwritten.
    single : bool
        Compute in float32. MuJoCo Warp's poses are float32 in any case.
    parameters : mapping of str to (E,) float, optional
        In which the sensors of environments differ, as ``{"k": …, "mus": …}``.
    """

    sensor: SensorOnMesh | None = None
    body: str = ""
    geoms: tuple[str, ...] = field(default_factory=tuple)
    apply: bool = True
    single: bool = False
    parameters: Columns | None = None

    def build(self) -> TouchSensor:
        """Return the sensor."""
        return TouchSensor(self)


class TouchSensor(Sensor[TouchData]):
    """The sensor of a :class:`TouchSensorCfg`; :attr:`data` is a :class:`TouchData`."""

    def __init__(self, cfg: TouchSensorCfg):
        super().__init__()
        sensor_of(cfg.name, cfg.sensor)
        self.cfg = cfg

    def edit_spec(self, scene_spec: Any, entities: dict[str, Any]) -> None:
        """Do nothing: MuJoCo knows nothing of the sensor."""

    def initialize(self, mj_model: Any, model: Any, data: Any, device: str) -> None:
        """Find body and geoms, and allocate the results.

        Raises
        ------
        ParameterError
            A name is none of the model, or a geom is of another kind.
        """
        body = _index(mj_model, mujoco.mjtObj.mjOBJ_BODY, "body", self.cfg.body)
        geoms = [_index(mj_model, mujoco.mjtObj.mjOBJ_GEOM, "geom", name) for name in self.cfg.geoms]
        targets = [_target(mj_model, geom) for geom in geoms]
        cfg, step = self.cfg, float(mj_model.opt.timestep)
        sensor = sensor_of(cfg.name, cfg.sensor)
        self._touch = EngineSensors(cfg.name, sensor, targets, step, int(data.nworld), device, cfg.single, cfg.parameters)
        self._results = self._touch.data()
        self._data, self._body = getattr(data, "struct", data), body
        self._geoms = self._touch.indices(geoms)
        self._bodies = self._touch.indices([int(mj_model.geom_bodyid[geom]) for geom in geoms])

    def reset(self, env_ids: Any = None) -> None:
        """Let environments begin again with their next step."""
        super().reset(env_ids)
        self._touch.reset(env_ids)

    def update(self, dt: float) -> None:
        """Go on by one step of the simulation, to its present poses.

        Raises
        ------
        ParameterError
            `dt` is not the timestep of the model.
        """
        super().update(dt)
        self._touch.check_step(dt)
        from . import engine_kernels as kernels

        d, touch, sensors, body = self._data, self._touch, self._touch.sensors, self._body
        threads = len(sensors), 1 + len(self._geoms)
        frames = d.xpos, d.xquat, d.geom_xpos, d.geom_xmat
        touch.launch(kernels.write_mujoco_poses, threads, body, self._geoms, *frames, sensors.poses)
        sensors.step()
        if self.cfg.apply:
            wrenches = sensors.poses, sensors.wrench, d.xfrc_applied
            touch.launch(kernels.write_mujoco_wrenches, len(sensors), body, self._bodies, d.xipos, *wrenches)

    def _compute_data(self) -> TouchData:
        return self._results


def _index(mj_model: Any, kind: Any, what: str, name: str) -> int:
    found = mujoco.mj_name2id(mj_model, kind, name)
    if found < 0:
        count = mj_model.nbody if what == "body" else mj_model.ngeom
        known = ", ".join(str(mujoco.mj_id2name(mj_model, kind, i)) for i in range(min(count, 8)))
        raise ParameterError(f"The model has no {what} '{name}': take one of {known}.")
    return int(found)


def _target(mj_model: Any, geom: int) -> TriangleMesh | Shape:
    """Return a geom as a target."""

    def mesh() -> tuple[np.ndarray, np.ndarray]:
        one = mj_model.geom_dataid[geom]
        vertex, face = mj_model.mesh_vertadr[one], mj_model.mesh_faceadr[one]
        vertices = mj_model.mesh_vert[vertex : vertex + mj_model.mesh_vertnum[one]]
        return vertices, mj_model.mesh_face[face : face + mj_model.mesh_facenum[one]]

    kind = mujoco.mjtGeom(mj_model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
    return target_of(f"Geom {geom}", kind, mj_model.geom_size[geom].astype(float), mesh)
