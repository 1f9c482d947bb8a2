# SPDX-License-Identifier: GPL-3.0-or-later
"""CSV: one folder of tables per sensor, one column per texel; motion of the bodies beside them."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Sequence
from functools import partial
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
from ...model.recording import Recording
from ..exporter import Exporter, channel_labels, sensor_progress

_QUANTITIES = ("normal_force", "shear_x", "shear_y", "depth", "slip", "contact", "reading")
"""Quantities of a texel; each gets a table of its own."""
_DIGITS = 9
"""Significant digits: more than any measurement has, in about half the space of a full double."""


def write_csv(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write ``bodies.csv`` and, in a folder per sensor, a table of its texels, one per quantity, and one of sums."""
    recording = bake.recording
    columns = [f"{body} {key}" for body in recording.body_names for key in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    written = [_write_over_time(folder / "bodies.csv", columns, recording, lambda part: part.poses)]
    for name, stem in folder_names(bake.texels).items():
        yield sensor_progress(bake, name)
        written += _write_sensor(bake, name, writable_folder(folder / stem, create=True))
    return written


def _write_sensor(bake: Bake, name: str, folder: Path) -> list[Path]:
    """Write the tables of one sensor and return them."""
    recording, texels, channels = bake.recording, bake.texels[name], bake.recording.sensors[name].channels
    written = [_write_table(folder / "texels.csv", *_texel_table(texels))]
    columns = dict.fromkeys(_QUANTITIES, [f"texel_{i}" for i in range(len(texels))])
    columns["sums"] = ["normal", "shear", "texels touching", "slip share"]
    columns["sums"] += [f"{key}_{axis}" for key in ("force", "torque", "centre") for axis in "xyz"]
    if channels is not None:
        columns["channels"] = channel_labels(channels)
    for key, names in columns.items():
        written.append(_write_over_time(folder / f"{key}.csv", names, recording, partial(_values, bake, name, key)))
    if channels is not None and channels.place is not None:
        places = np.column_stack([np.arange(len(channels.place)), channels.place])
        written.append(_write_table(folder / "channel_places.csv", ["place", *"xyz"], [places]))
    return written


def _values(bake: Bake, name: str, key: str, part: Recording) -> np.ndarray:
    """(F, …) values of a sensor for some frames: a quantity of its texels, its channels, or its sums."""
    recorded, texels = part.sensors[name], bake.texels[name]
    if key.startswith("shear_"):
        return recorded.shear[:, :, "xy".index(key[-1])]
    if key == "channels" and recorded.channels is not None:
        return recorded.channels.values
    if key != "sums":
        return np.asarray(getattr(recorded, key))
    return np.column_stack(
        [
            recorded.normal_force.sum(axis=1),
            np.linalg.norm(response.net_shear(recorded, texels), axis=1),
            recorded.contact.sum(axis=1),
            response.slip_share(recorded, bake.parameters[name], bake.painted[name]),
            recorded.net_force,
            recorded.net_torque,
            recorded.centre_of_pressure,
        ]
    )


def _texel_table(texels: Texels) -> tuple[list[str], list[np.ndarray]]:
    header = ["texel", "vertex", *"xyz", "nx", "ny", "nz", "area", "u", "v"]
    table = [np.arange(len(texels)), texels.vertex, texels.position, texels.normal, texels.area, texels.layout.uv()]
    if isinstance(texels.layout, GridLayout):
        header += ["row", "column"]
        table += [texels.layout.row, texels.layout.column]
    return header, [np.column_stack(table)]


def _write_over_time(path: Path, names: Sequence[str], recording: Recording, values: Callable[[Recording], np.ndarray]) -> Path:
    """Write a table with a row for each frame: its number, its time, and what `values` gives for it, under `names`."""
    blocks = ((part, values(part)) for part in recording.blocks())
    tables = (np.column_stack([part.frames, part.times, own.reshape(len(own), -1)]) for part, own in blocks)
    return _write_table(path, ["frame", "time", *names], tables)


def _write_table(path: Path, header: Sequence[str], tables: Iterable[np.ndarray]) -> Path:
    """Write tables below one another and return the file."""
    with atomic_write(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([harmless_cell(name) for name in header])
        for table in tables:
            writer.writerows([f"{value:.{_DIGITS}g}" for value in row] for row in table)
    return path


EXPORTER = Exporter("csv", write_csv)
