# SPDX-License-Identifier: GPL-3.0-or-later
"""Probe lists: the texels of a sensor as plain numbers, in JSON and in NPZ, for Genesis, Isaac Lab and one's own code."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...geometry.grid_layout import GridLayout
from ...io.recording_npz import write_arrays
from ..probe_list import PROBES_FORMAT, is_probe_list, read_probe_list, write_probe_list
from ..sensor_format import FoundSensor, SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh, texel_arrays


def write_probes(item: SensorOnMesh, path: Path, _: str) -> Written:
    """Write a JSON and an NPZ file."""
    listed, archive = Path(f"{path}.json"), Path(f"{path}.npz")
    write_probe_list(listed, item)
    arrays = texel_arrays(item) | {"frame_position": item.position, "frame_quaternion": item.quaternion}
    write_arrays(archive, arrays | {"faces": item.faces, "format": np.array(PROBES_FORMAT)})
    note = "parameters and effects are written as data; only Palpate computes with them."
    return Written([listed, archive], [f"'{item.name}': {note}"])


def read_probes(path: str | os.PathLike) -> list[FoundSensor]:
    """Return the sensor of a probe list, in the JSON file."""
    item = read_probe_list(path)
    sensor, notes = item.sensor, []
    painted = [name for name, values in vars(sensor.painted).items() if values is not None]
    if painted:
        notes.append(f"'{item.name}': painted factors ({', '.join(painted)}) were not imported.")
    layout = sensor.texels.layout
    row, column = (layout.row, layout.column) if isinstance(layout, GridLayout) else (None, None)
    found = FoundSensor(item.name, sensor.texels.position, sensor.texels.normal, item.faces, row, column, notes=notes)
    found = replace(found, frame_position=item.position, frame_quaternion=item.quaternion)
    return [replace(found, parameters=sensor.parameters, effects=sensor.effects)]


FORMAT = SensorFormat(
    "probes",
    "Probe List (JSON, NPZ)",
    "Positions, normals and areas of the texels, for any code",
    write_probes,
    read_probes,
    is_probe_list,
)
