# SPDX-License-Identifier: GPL-3.0-or-later
"""CSV: one folder of tables per sensor, one column per texel; motion of the bodies beside them."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ...figures.figure_style import FigureStyle
from ...geometry.layout.grid_layout import GridLayout
from ...geometry.texels import Texels
from ...io.bake_folder import folder_names
from ...io.bake_reader import Bake
from ...io.csv_table import harmless_cell
from ...io.file_writing import atomic_write, writable_folder
from ...jobs.progress import Job
from ...response import metrics
from ..exporter import Exporter, sensor_progress

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
    rows = np.column_stack([recording.frames, recording.times, recording.poses.reshape(len(recording.frames), -1)])
    _write_table(folder / "bodies.csv", header, rows)
    written = [folder / "bodies.csv"]
    for name, stem in folder_names(bake.texels).items():
        yield sensor_progress(bake, name)
        own = writable_folder(folder / stem, create=True)
        written += _write_sensor(bake, name, own)
    return written


def _write_sensor(bake: Bake, name: str, folder: Path) -> list[Path]:
    """Write the tables of one sensor and return them."""
    recorded, texels = bake.recording.sensors[name], bake.texels[name]
    clock = np.column_stack([bake.recording.frames, bake.recording.times])
    tables = {"texels": _texel_table(texels)}
    columns = [f"texel_{i}" for i in range(len(texels))]
    channels = {"shear_x": recorded.shear[:, :, 0], "shear_y": recorded.shear[:, :, 1]}
    for key in _QUANTITIES:
        values = channels[key] if key in channels else getattr(recorded, key)
        tables[key] = ["frame", "time", *columns], np.column_stack([clock, values])
    header = ["frame", "time", "normal", "shear", "texels touching", "slip share"]
    header += [f"{key}_{axis}" for key in ("force", "torque", "centre") for axis in "xyz"]
    total = np.column_stack(
        [
            clock,
            recorded.normal_force.sum(axis=1),
            np.linalg.norm(metrics.net_shear(recorded, texels), axis=1),
            recorded.contact.sum(axis=1),
            metrics.slip_share(recorded, bake.parameters[name], bake.painted[name]),
            recorded.net_force,
            recorded.net_torque,
            recorded.centre_of_pressure,
        ]
    )
    tables["sums"] = header, total
    for key, table in tables.items():
        _write_table(folder / f"{key}.csv", *table)
    return [folder / f"{key}.csv" for key in tables]


def _texel_table(texels: Texels) -> tuple[list[str], np.ndarray]:
    header = ["texel", "vertex", *"xyz", "nx", "ny", "nz", "area", "u", "v"]
    table = [np.arange(len(texels)), texels.vertex, texels.position, texels.normal, texels.area, texels.layout.uv()]
    if isinstance(texels.layout, GridLayout):
        header += ["row", "column"]
        table += [texels.layout.row, texels.layout.column]
    return header, np.column_stack(table)


def _write_table(path: Path, header: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    with atomic_write(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([harmless_cell(name) for name in header])
        writer.writerows([f"{value:.{_DIGITS}g}" for value in row] for row in rows)


EXPORTER = Exporter("csv", "CSV", "Tables, one column per texel", 0, write_csv)
