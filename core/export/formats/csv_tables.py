# SPDX-License-Identifier: GPL-3.0-or-later
"""CSV: one folder of tables per sensor, one column per texel; motion of the bodies beside them."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ... import response
from ...figures.figure_style import FigureStyle
from ...geometry.grid_layout import GridLayout
from ...geometry.texels import Texels
from ...io.bake_folder import folder_names
from ...io.bake_reader import Bake
from ...io.csv_table import harmless_cell
from ...io.file_writing import atomic_write, writable_folder
from ...jobs import Job
from ...model.recording import Recording, SensorRecording
from ..exporter import Exporter, channel_labels, sensor_progress

_QUANTITIES = ("normal_force", "shear_x", "shear_y", "depth", "slip", "contact", "reading")
"""Quantities of a texel; each gets a table of its own."""
_DIGITS = 9
"""Significant digits: more than any measurement has, in about half the space of a full double."""


def write_csv(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write ``bodies.csv`` and, in a folder per sensor, a table of its texels, one per quantity, and one of sums."""
    recording = bake.recording
    header = ["frame", "time"] + [
        f"{body} {key}" for body in recording.body_names for key in ("x", "y", "z", "qw", "qx", "qy", "qz")
    ]
    tables = (
        np.column_stack([part.frames, part.times, part.poses.reshape(len(part.frames), -1)]) for part in recording.blocks()
    )
    _write_table(folder / "bodies.csv", header, tables)
    written = [folder / "bodies.csv"]
    for name, stem in folder_names(bake.texels).items():
        yield sensor_progress(bake, name)
        own = writable_folder(folder / stem, create=True)
        written += _write_sensor(bake, name, own)
    return written


def _write_sensor(bake: Bake, name: str, folder: Path) -> list[Path]:
    """Write the tables of one sensor and return them."""
    recording, texels = bake.recording, bake.texels[name]
    header, table = _texel_table(texels)
    _write_table(folder / "texels.csv", header, [table])
    columns = ["frame", "time", *(f"texel_{i}" for i in range(len(texels)))]
    for key in _QUANTITIES:
        tables = (np.column_stack([_clock(part), _channel(part.sensors[name], key)]) for part in recording.blocks())
        _write_table(folder / f"{key}.csv", columns, tables)
    header = ["frame", "time", "normal", "shear", "texels touching", "slip share"]
    header += [f"{key}_{axis}" for key in ("force", "torque", "centre") for axis in "xyz"]
    _write_table(folder / "sums.csv", header, (_sums(bake, name, part) for part in recording.blocks()))
    return [*(folder / f"{key}.csv" for key in ("texels", *_QUANTITIES, "sums")), *_write_channels(recording, name, folder)]


def _write_channels(recording: Recording, name: str, folder: Path) -> list[Path]:
    """Write the tables of a sensor with several channels: their readings, and where they are measured."""
    channels = recording.sensors[name].channels
    if channels is None:
        return []
    blocks = ((part, part.sensors[name].channels) for part in recording.blocks())
    tables = (np.column_stack([_clock(part), own.values.reshape(len(part.frames), -1)]) for part, own in blocks if own)
    _write_table(folder / "channels.csv", ["frame", "time", *channel_labels(channels)], tables)
    if channels.place is None:
        return [folder / "channels.csv"]
    places = np.column_stack([np.arange(len(channels.place)), channels.place])
    _write_table(folder / "channel_places.csv", ["place", *"xyz"], [places])
    return [folder / "channels.csv", folder / "channel_places.csv"]


def _clock(part: Recording) -> np.ndarray:
    return np.column_stack([part.frames, part.times])


def _channel(sensor: SensorRecording, key: str) -> np.ndarray:
    """(F, n) values of a quantity."""
    if key.startswith("shear_"):
        return sensor.shear[:, :, "xy".index(key[-1])]
    return np.asarray(getattr(sensor, key))


def _sums(bake: Bake, name: str, part: Recording) -> np.ndarray:
    """Return the sums of a sensor for some frames."""
    recorded, texels = part.sensors[name], bake.texels[name]
    return np.column_stack(
        [
            _clock(part),
            recorded.normal_force.sum(axis=1),
            np.linalg.norm(response.net_shear(recorded, texels), axis=1),
            recorded.contact.sum(axis=1),
            response.slip_share(recorded, bake.parameters[name], bake.painted[name]),
            recorded.net_force,
            recorded.net_torque,
            recorded.centre_of_pressure,
        ]
    )


def _texel_table(texels: Texels) -> tuple[list[str], np.ndarray]:
    header = ["texel", "vertex", *"xyz", "nx", "ny", "nz", "area", "u", "v"]
    table = [np.arange(len(texels)), texels.vertex, texels.position, texels.normal, texels.area, texels.layout.uv()]
    if isinstance(texels.layout, GridLayout):
        header += ["row", "column"]
        table += [texels.layout.row, texels.layout.column]
    return header, np.column_stack(table)


def _write_table(path: Path, header: Sequence[str], tables: Iterable[np.ndarray]) -> None:
    """Write tables below one another."""
    with atomic_write(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([harmless_cell(name) for name in header])
        for table in tables:
            writer.writerows([f"{value:.{_DIGITS}g}" for value in row] for row in table)


EXPORTER = Exporter("csv", write_csv)
