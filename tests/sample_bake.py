# SPDX-License-Identifier: GPL-3.0-or-later
"""Small sensors, made-up recordings of them, and bakes of these, from which tests of readers start."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from solver_scenes import pad

from palpate.core.geometry.grid_layout import GridLayout
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.texels import Texels, texels_from_region
from palpate.core.geometry.texture_maps import UVLayout
from palpate.core.io.bake_folder import Manifest, folder_names, manifest_of, write_arrays_of, write_image_of, write_manifest
from palpate.core.model.body import Body, Motion
from palpate.core.model.recording import Recording, SensorFrame, SensorRecording
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import Painted, SensorParameters

ROWS, COLUMNS, PITCH = 5, 3, 0.004


def grid_texels():
    """A flat pad of 5 × 3 texels in z = 0."""
    return pad(ROWS, COLUMNS, PITCH)


def round_texels():
    """A cap of a sphere, whose texels form no grid."""
    angle = np.arange(12) * np.pi / 6
    rim = np.stack([0.01 * np.cos(angle), 0.01 * np.sin(angle), np.zeros(12)], axis=1)
    vertices = np.concatenate([[[0, 0, 0.004]], rim])
    triangles = np.array([[0, 1 + i, 1 + (i + 1) % 12] for i in range(12)])
    return texels_from_region(TriangleMesh(vertices, triangles), np.ones(13, bool), "cap")


def recording_of(texels, frames=10):
    """Forces that rise, slide along the rows, and vanish; nothing happens in the last three frames."""
    n = len(texels)
    load = np.clip(np.arange(frames) - 1, 0, None) * (np.arange(frames) < frames - 3)
    normal = load[:, None] * np.linspace(0.01, 0.02, n)
    shear = np.zeros((frames, n, 2))
    shear[:, :, 1] = 0.2 * normal
    zeros, vector = np.zeros((frames, n)), np.zeros((frames, 3))
    sensor = SensorRecording(
        normal, shear, np.linalg.norm(shear, axis=2), zeros, zeros, normal > 0, normal, vector, vector, vector
    )
    return Recording(
        frames=np.arange(1, frames + 1),
        times=np.arange(frames) / 24,
        sensors={"pad": sensor},
        body_names=("pad",),
        poses=np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (frames, 1, 1)),
        velocities=np.zeros((frames, 1, 6)),
        dt=1e-4,
    )


def write_sensor(
    bake: Path,
    name: str,
    texels: Texels,
    painted: Painted | None = None,
    recording: Recording | None = None,
    parameters: SensorParameters | None = None,
    sensors: tuple[str, ...] = (),
) -> Recording:
    """Write the folder of one sensor as a bake leaves it, with a made-up recording if none is given; return its recording."""
    sensor = Sensor(name, 0, texels, parameters or SensorParameters(), painted=painted or Painted())
    recording = recording or recording_of(texels, 7)
    recording = replace(recording, sensors={name: recording.sensors["pad"]}, digest=recording.digest or "d")
    own = bake / folder_names([name])[name]
    own.mkdir(parents=True)
    for number in recording.frames:
        write_image_of(own, sensor, recording.at(int(number)), recording.digest)
    first, last = (int(recording.frames[end]) for end in (0, -1))
    scenario = Scenario((Body("pad", Motion.at_rest()),), (sensor,), (), first, last)
    manifest = manifest_of(scenario, sensor, recording, write_arrays_of(own, sensor, recording))
    write_manifest(own, replace(manifest, sensors=sensors))
    return recording


def write_bake(folder: Path) -> None:
    """Write a bake of two sensors, ``pad`` with rows and columns and ``cap`` without."""
    names = ("cap", "pad")
    write_sensor(folder, "cap", round_texels(), sensors=names)
    write_sensor(folder, "pad", grid_texels(), Painted(k=np.ones(ROWS * COLUMNS)), sensors=names)


def manifest(**changes: Any) -> Manifest:
    """Return a manifest with something in every field."""
    return replace(
        Manifest(
            sensor="Pad ü/1",
            palpate="0.1.0",
            frame_start=1,
            frame_end=40,
            fps=24.0,
            dt=1 / 3e4,
            digest="ab" * 32,
            unit="kPa",
            shape=(14, 6),
            parameters={"k": 58.5, "unit": "N", "list": [1, 2.5]},
            warnings=("Texel 3 of 'Pad' bottomed out at frame 7: raise k.",),
            step_reason="Steps of 1 ms.",
            complete=True,
            scene_file="Hände.blend",
            files={"recording.npz": "ab" * 32, "sensor.npz": "cd" * 32},
            effects=[{"name": "creep", "amount": 0.2}],
        ),
        **changes,
    )


def tactile_frame(count: int, seed: int | np.random.Generator = 0) -> SensorFrame:
    """Return a frame of random numbers."""
    rng = np.random.default_rng(seed)
    return SensorFrame(
        normal_force=rng.random(count),
        shear=rng.normal(size=(count, 2)),
        friction=rng.random(count),
        depth=rng.random(count) * 1e-3,
        slip=rng.random(count),
        contact=rng.random(count) < 0.5,
        reading=rng.normal(size=count) * 1e3,
        net_force=rng.normal(size=3),
        net_torque=rng.normal(size=3),
        centre_of_pressure=rng.normal(size=3),
    )


def pictures_of(layout: GridLayout | UVLayout, frame: SensorFrame) -> dict[str, np.ndarray]:
    """Return the pictures that an image of a frame has to hold, by channel, each (height, width) with row 0 at the bottom."""
    values = {name: getattr(frame, name) for name in ("reading", "depth", "slip", "contact")}
    values |= {"R": frame.normal_force, "G": frame.shear[:, 0], "B": frame.shear[:, 1]}
    pictures = {name: layout.image(own.astype(float)).astype(np.float32) for name, own in values.items()}
    return {**pictures, "contact": (pictures["contact"] >= 0.5).astype(np.float32)}


def read_image(path: str | Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the channels of an image as OpenEXR reads them, the top row first, and the attributes that are texts."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        return channels, {name: value for name, value in file.header().items() if isinstance(value, str)}


def read_exr(path: str | Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the channels of a tactile image, row 0 at the bottom, and its metadata."""
    channels, attributes = read_image(path)
    about = {name.removeprefix("palpate."): value for name, value in attributes.items() if name.startswith("palpate.")}
    return {name: picture[::-1] for name, picture in channels.items()}, about
