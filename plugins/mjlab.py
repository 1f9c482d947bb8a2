# SPDX-License-Identifier: GPL-3.0-or-later
"""A Palpate sensor in a scene of mjlab, on its ``Sensor`` base class."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.errors import ParameterError
from ..core.geometry.mesh import TriangleMesh
from ..core.geometry.shapes import Shape, box, capsule, plane, sphere
from ..core.simulators.environment_parameters import Columns
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from .engines import require_engine
from .torch_sensors import TorchSensors, TouchData, sensor_of, wp

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
        targets = [_shape(mj_model, geom) for geom in geoms]
        cfg, step = self.cfg, float(mj_model.opt.timestep)
        sensor = sensor_of(cfg.name, cfg.sensor)
        self._touch = TorchSensors(cfg.name, sensor, targets, step, int(data.nworld), device, cfg.single, cfg.parameters)
        self._sensors = self._touch.sensors
        self._data, self._body = getattr(data, "struct", data), body
        self._geoms = wp.array(geoms, dtype=int, device=device)
        self._bodies = wp.array([int(mj_model.geom_bodyid[geom]) for geom in geoms], dtype=int, device=device)

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
        from . import mjlab_kernels as kernels

        d, e = self._data, len(self._sensors)
        place = [self._body, self._geoms]
        poses = [d.xpos, d.xquat, d.geom_xpos, d.geom_xmat, self._sensors.poses]
        wp.launch(kernels.write_poses, dim=(e, 1 + len(self._geoms)), inputs=[*place, *poses], device=self._sensors.device)
        self._sensors.step()
        if self.cfg.apply:
            inputs = [self._body, self._bodies, d.xipos, self._sensors.poses, self._sensors.wrench, d.xfrc_applied]
            wp.launch(kernels.write_wrenches, dim=e, inputs=inputs, device=self._sensors.device)

    def _compute_data(self) -> TouchData:
        return self._touch.data


def _index(mj_model: Any, kind: Any, what: str, name: str) -> int:
    found = mujoco.mj_name2id(mj_model, kind, name)
    if found < 0:
        count = mj_model.nbody if what == "body" else mj_model.ngeom
        known = ", ".join(str(mujoco.mj_id2name(mj_model, kind, i)) for i in range(min(count, 8)))
        raise ParameterError(f"The model has no {what} '{name}': take one of {known}.")
    return int(found)


def _shape(mj_model: Any, geom: int) -> TriangleMesh | Shape:
    """Return a geom as a target."""
    kind, size = mujoco.mjtGeom(mj_model.geom_type[geom]), mj_model.geom_size[geom].astype(float)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return sphere(size[0])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return box(tuple(2.0 * size))
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return capsule(size[0], 2.0 * size[1])
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        return plane()
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = mj_model.geom_dataid[geom]
        vertex, face = mj_model.mesh_vertadr[mesh], mj_model.mesh_faceadr[mesh]
        vertices = mj_model.mesh_vert[vertex : vertex + mj_model.mesh_vertnum[mesh]]
        faces = mj_model.mesh_face[face : face + mj_model.mesh_facenum[mesh]]
        return TriangleMesh(np.array(vertices, float), np.array(faces, np.int64))
    raise ParameterError(f"Geom {geom} is a {kind.name}: take planes, spheres, capsules, boxes and meshes.")
