# SPDX-License-Identifier: GPL-3.0-or-later
"""Metrics of a run of a study.

======================  ============================================================================================
``max_normal_force``    N, largest sum of the texels' normal forces
``max_texel_force``     N, largest normal force of a texel
``max_shear``           N, largest magnitude of the sum of shear
``max_depth``           m
``max_contact_texels``  largest number of texels that touch at once
``first_contact``       s, first frame with a contact; missing where nothing touches
``first_slip``          s, first frame in which a texel slips; missing where none does
``max_slip_share``      largest share of the normal force on slipping texels
``end_normal_force``    N, at the last frame
======================  ============================================================================================

With several sensors each name begins with that of the sensor. ``BODY.held`` is 1 when a free body is still within reach of a
sensor at the last frame and that sensor feels something, else 0; ``BODY.fall`` is how far its centre of mass has moved along
gravity, m. ``press.x``, ``y``, ``z`` are the place of a press in the frame of the sensor's body, m.
"""

from __future__ import annotations

import numpy as np

from ..geometry.rotations import rotation_matrices
from ..model.recording import Recording, SensorRecording
from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..response.metrics import net_shear, share_on, slipping
from .presses import Press, place_of


def metrics_of(scenario: Scenario, recording: Recording, press: Press | None = None) -> dict[str, float]:
    """Return the metrics of a run by name.

    Parameters
    ----------
    scenario : Scenario
        Of the run.
    recording : Recording
    press : Press, optional
        That the run has made.
    """
    read_out = [sensor for sensor in scenario.sensors if sensor.readout]
    found: dict[str, float] = {}
    for sensor in read_out:
        start = f"{sensor.name}." if len(read_out) > 1 else ""
        own = _sensor_metrics(sensor, recording.sensors[sensor.name], recording.times)
        found |= {f"{start}{name}": value for name, value in own.items()}
    for index, body in enumerate(scenario.bodies):
        if body.free:
            found[f"{body.name}.held"] = float(_is_held(index, scenario, recording))
            found[f"{body.name}.fall"] = _fall(index, scenario, recording)
    if press is not None:
        found |= {f"press.{axis}": float(value) for axis, value in zip("xyz", place_of(scenario, press), strict=True)}
    return found


def _sensor_metrics(sensor: Sensor, measured: SensorRecording, times: np.ndarray) -> dict[str, float]:
    normal, touching = measured.normal_force.sum(axis=1), np.asarray(measured.contact, bool)
    slips = slipping(measured, sensor.parameters, sensor.painted)
    found = {
        "max_normal_force": float(normal.max()),
        "max_texel_force": float(measured.normal_force.max()),
        "max_shear": float(np.linalg.norm(net_shear(measured, sensor.texels), axis=1).max()),
        "max_depth": float(measured.depth.max()),
        "max_contact_texels": float(touching.sum(axis=1).max()),
        "max_slip_share": float(share_on(slips, measured).max()),
        "end_normal_force": float(normal[-1]),
    }
    for name, happens in (("first_contact", touching), ("first_slip", slips)):
        frames = np.flatnonzero(happens.any(axis=1))
        if len(frames):
            found[name] = float(times[frames[0]])
    return found


def _fall(index: int, scenario: Scenario, recording: Recording) -> float:
    size = np.linalg.norm(scenario.gravity)
    if size == 0.0:
        return 0.0
    center = _centers(index, scenario, recording)
    return float((center[-1] - center[0]) @ scenario.gravity / size)


def _centers(index: int, scenario: Scenario, recording: Recording) -> np.ndarray:
    """Return where the centre of mass of a body is at the first and at the last frame, (2, 3) m, world."""
    poses = recording.poses[[0, -1], index]
    return poses[:, :3] + np.einsum("fij,j->fi", rotation_matrices(poses[:, 3:]), scenario.bodies[index].center_of_mass)


def _is_held(index: int, scenario: Scenario, recording: Recording) -> bool:
    """Return whether a free body is near a sensor in contact at the last frame."""
    center = _centers(index, scenario, recording)[1]
    own = [target for target in scenario.targets if target.body == index]
    middle = scenario.bodies[index].center_of_mass
    reach = max((float(np.linalg.norm(target.mesh.vertices - middle, axis=1).max()) for target in own), default=0.0)
    for sensor in scenario.sensors:
        if sensor.body == index or not sensor.readout or not recording.sensors[sensor.name].contact[-1].any():
            continue
        pose = recording.poses[-1, sensor.body]
        texels = pose[:3] + sensor.texels.position @ rotation_matrices(pose[None, 3:])[0].T
        if np.linalg.norm(texels - center, axis=1).min() <= reach + sensor.parameters.max_penetration:
            return True
    return False
