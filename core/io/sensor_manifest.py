# SPDX-License-Identifier: GPL-3.0-or-later
"""The manifest of one sensor in what was computed from a scenario: a bake, or a run of a study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from ..effects.engine.registry import to_dict
from ..model.recording import Recording
from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..version import VERSION
from .bake_folder import Manifest
from .recording_npz import described


def manifest_of(scenario: Scenario, sensor: Sensor, recording: Recording, files: Mapping[str, str]) -> Manifest:
    """Return the manifest of a sensor, complete but for what a .blend and its bake add.

    Parameters
    ----------
    scenario : Scenario
        That was computed.
    sensor : Sensor
        One of its sensors.
    recording : Recording
        Of the scenario.
    files : mapping of str to str
        SHA-256 of the files in the sensor's folder, by name.
    """
    channels = recording.sensors[sensor.name].channels
    return Manifest(
        sensor=sensor.name,
        palpate=VERSION,
        frame_start=scenario.frame_start,
        frame_end=scenario.frame_end,
        fps=scenario.fps,
        dt=recording.dt,
        digest=recording.digest,
        unit=sensor.parameters.unit,
        shape=(int(sensor.texels.layout.shape[0]), int(sensor.texels.layout.shape[1])),
        parameters=asdict(sensor.parameters),
        warnings=recording.warnings,
        complete=True,
        body=scenario.bodies[sensor.body].name,
        step_reason=recording.step_reason,
        sensors=tuple(recording.sensors),
        files=dict(sorted(files.items())),
        effects=[to_dict(effect) for effect in sensor.effects],
        channels={} if channels is None else described(channels),
    )
