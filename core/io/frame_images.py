# SPDX-License-Identifier: GPL-3.0-or-later
"""The images of some frames of a sensor: the tactile image of each, and that of its channels where it has several."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..model.recording import Frame
from ..model.sensor import Sensor
from .bake_folder import channel_file, frame_file
from .tactile_exr import channel_layout, describe, write_channel_exrs, write_exrs


def write_frame_images(folder: Path, sensor: Sensor, frames: Sequence[Frame], digest: str) -> list[Path]:
    """Write the images of frames of one sensor, and return their paths kind by kind; raises as :func:`.write_exrs`.

    Parameters
    ----------
    folder : path
    sensor : Sensor
    frames : sequence of Frame
        At least one.
    digest : str
        Of the scenario.
    """
    recorded = [frame.sensors[sensor.name] for frame in frames]
    headers = [describe(sensor, frame, digest) for frame in frames]
    paths = [folder / frame_file(frame.frame) for frame in frames]
    write_exrs(paths, sensor.texels.layout, recorded, headers)
    channels = [own.channels for own in recorded if own.channels is not None]
    if not channels:
        return paths
    more = [folder / channel_file(frame.frame) for frame in frames]
    write_channel_exrs(more, channel_layout(sensor.texels, channels[0]), channels, headers)
    return paths + more
