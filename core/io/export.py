# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake as files for other programs: CSV, NPZ, HDF5, PNG.

Everything is in SI units, in the frames and with the signs of :mod:`.recording`. One folder, or one group of an HDF5 file, per
sensor; what belongs to all of them (times, motion of the bodies) is beside these.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import PalpateError
from ..figures import color_maps
from ..figures.figure_style import FigureStyle
from ..geometry.layout import GridLayout
from ..jobs.progress import Job, Progress
from ..model.recording import SensorRecording
from ..response import metrics
from .bake_folder import folder_names
from .bake_reader import Bake
from .file_writing import atomic_write, writable_folder
from .npz import write_arrays

UNITS = {
    "normal_force": "N",
    "shear": "N",
    "depth": "m",
    "slip": "m/s",
    "contact": "1",
    "net_force": "N",
    "net_torque": "N m",
    "centre_of_pressure": "m",
}
"""Of the parts of a recording; `reading` has the sensor's own."""
_TABLES = ("normal_force", "shear_x", "shear_y", "depth", "slip", "contact", "reading")
_DIGITS = 9
"""Significant ones in a CSV file: more than any measurement has, and a tenth of a full double's room."""
_LEAST_PIXELS = 256
"""Along the longer side of a PNG: smaller images are magnified by a whole number, pixel by pixel."""


def export(bake: Bake, kind: str, folder: str | os.PathLike, style: FigureStyle | None = None) -> Job[list[Path]]:
    """Write a bake in another format.

    Parameters
    ----------
    bake : Bake
    kind : {"csv", "npz", "hdf5", "png"}
    folder : path
        Made when only it is missing.
    style : FigureStyle, optional
        Colours and their scale, for PNG.

    Yields
    ------
    Progress
        Before each sensor is written; the stage is the sensor's name.

    Returns
    -------
    list of Path
        What was written: files, or one folder per sensor.

    Raises
    ------
    PalpateError
        The format is unknown or needs a package that is not installed, or a file cannot be written.
    """
    if kind not in KINDS:
        raise PalpateError(f"There is no export to '{kind}': choose from {', '.join(KINDS)}.")
    place = writable_folder(folder, create=True)
    return (yield from KINDS[kind](bake, place, style or FigureStyle()))


def _sensor_progress(bake: Bake, name: str) -> Progress:
    """Return the progress of an export that begins with a sensor."""
    names = list(bake.texels)
    return Progress(name, names.index(name) + 1, len(names))


def arrays_of(bake: Bake, name: str) -> dict[str, np.ndarray]:
    """Return everything about one sensor as arrays: what it felt, and, under ``texel_…``, where its texels are."""
    texels, felt = bake.texels[name], bake.recording.sensors[name]
    arrays = {item.name: getattr(felt, item.name) for item in fields(SensorRecording)}
    arrays |= {f"texel_{key}": getattr(texels, key) for key in ("position", "normal", "tangent", "area", "vertex")}
    arrays["texel_uv"] = texels.layout.uv()
    if isinstance(texels.layout, GridLayout):
        arrays["texel_row"], arrays["texel_column"] = texels.layout.row, texels.layout.column
    return arrays


# --- NPZ


def _npz(bake: Bake, place: Path, _: FigureStyle) -> Job[list[Path]]:
    written = []
    for name, stem in folder_names(bake.texels).items():
        yield _sensor_progress(bake, name)
        path = place / f"{stem}.npz"
        write_arrays(path, {"frame": bake.recording.frames, "time": bake.recording.times, **arrays_of(bake, name)})
        written.append(path)
    return written


# --- HDF5


def _hdf5(bake: Bake, place: Path, _: FigureStyle) -> Job[list[Path]]:
    try:
        import h5py
    except ImportError as error:
        raise PalpateError("HDF5 needs the package h5py, which is not installed: run 'pip install h5py'.") from error
    recording, path = bake.recording, place / "palpate.h5"
    with atomic_write(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs.update({"format": "palpate-hdf5/1", "digest": recording.digest, "dt": recording.dt})
        _dataset(file, "frame", recording.frames, "1")
        _dataset(file, "time", recording.times, "s")
        bodies = file.create_group("bodies")
        for i, body in enumerate(recording.body_names):
            group = bodies.create_group(_hdf5_name(body, bodies))
            group.attrs["name"] = body
            _dataset(group, "pose", recording.poses[:, i], "m, 1 (w x y z)")
            _dataset(group, "velocity", recording.velocities[:, i], "m/s, rad/s")
        sensors = file.create_group("sensors")
        for name in bake.texels:
            yield _sensor_progress(bake, name)
            group = sensors.create_group(_hdf5_name(name, sensors))
            group.attrs["name"], group.attrs["unit"] = name, bake.parameters[name].unit
            group.attrs["parameters"] = json.dumps(asdict(bake.parameters[name]))
            for key, array in arrays_of(bake, name).items():
                _dataset(group, key, array, _unit(bake, name, key))
    return [path]


def _hdf5_name(name: str, group: Any) -> str:
    """A slash would make a group inside a group."""
    plain = name.replace("/", "_").strip(".") or "_"
    while plain in group:
        plain += "_"
    return plain


def _dataset(group: Any, name: str, array: np.ndarray, unit: str) -> None:
    packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True} if array.size > 4096 else {}
    group.create_dataset(name, data=array, track_times=False, **packed).attrs["unit"] = unit


def _unit(bake: Bake, name: str, key: str) -> str:
    if key == "reading":
        return bake.parameters[name].unit
    return {"texel_position": "m", "texel_area": "m2"}.get(key) or UNITS.get(key, "1")


# --- CSV


def _csv(bake: Bake, place: Path, _: FigureStyle) -> Job[list[Path]]:
    recording = bake.recording
    header = ["frame", "time"] + [
        f"{body} {key}" for body in recording.body_names for key in ("x", "y", "z", "qw", "qx", "qy", "qz")
    ]
    rows = np.column_stack([recording.frames, recording.times, recording.poses.reshape(len(recording.frames), -1)])
    _table(place / "bodies.csv", header, rows)
    written = [place / "bodies.csv"]
    for name, stem in folder_names(bake.texels).items():
        yield _sensor_progress(bake, name)
        folder = writable_folder(place / stem, create=True)
        _csv_sensor(bake, name, folder)
        written.append(folder)
    return written


def _csv_sensor(bake: Bake, name: str, folder: Path) -> None:
    felt, texels = bake.recording.sensors[name], bake.texels[name]
    clock = np.column_stack([bake.recording.frames, bake.recording.times])
    _table(folder / "texels.csv", *_texel_table(texels))
    columns = [f"texel_{i}" for i in range(len(texels))]
    channels = {"shear_x": felt.shear[:, :, 0], "shear_y": felt.shear[:, :, 1]}
    for key in _TABLES:
        values = channels[key] if key in channels else getattr(felt, key)
        _table(folder / f"{key}.csv", ["frame", "time", *columns], np.column_stack([clock, values]))
    header = ["frame", "time", "normal", "shear", "texels touching", "slip share"]
    header += [f"{key}_{axis}" for key in ("force", "torque", "centre") for axis in "xyz"]
    total = np.column_stack(
        [
            clock,
            felt.normal_force.sum(axis=1),
            np.linalg.norm(metrics.net_shear(felt, texels), axis=1),
            felt.contact.sum(axis=1),
            metrics.slip_share(felt, bake.parameters[name], bake.painted[name]),
            felt.net_force,
            felt.net_torque,
            felt.centre_of_pressure,
        ]
    )
    _table(folder / "sums.csv", header, total)


def _texel_table(texels: Any) -> tuple[list[str], np.ndarray]:
    header = ["texel", "vertex", *"xyz", "nx", "ny", "nz", "area", "u", "v"]
    table = [np.arange(len(texels)), texels.vertex, texels.position, texels.normal, texels.area, texels.layout.uv()]
    if isinstance(texels.layout, GridLayout):
        header += ["row", "column"]
        table += [texels.layout.row, texels.layout.column]
    return header, np.column_stack(table)


def _table(path: Path, header: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    with atomic_write(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([f"{value:.{_DIGITS}g}" for value in row] for row in rows)


# --- PNG


def _png(bake: Bake, place: Path, style: FigureStyle) -> Job[list[Path]]:
    from matplotlib.image import imsave

    recording, written = bake.recording, []
    top = style.scale_limit(recording, bake.texels)
    for name, stem in folder_names(bake.texels).items():
        yield _sensor_progress(bake, name)
        folder = writable_folder(place / stem, create=True)
        texels = bake.texels[name]
        layout, values = texels.layout, style.values(recording.sensors[name], texels)
        mask = layout.mask()
        times = max(1, -(-_LEAST_PIXELS // max(layout.shape)))
        for frame, own in zip(recording.frames, values, strict=True):
            color = color_maps.colors(style.colour_map, layout.image(own).ravel() / top).reshape(*layout.shape, 3)
            pixels = np.dstack([color, mask])[::-1]
            pixels = np.repeat(np.repeat(pixels, times, axis=0), times, axis=1)
            with atomic_write(folder / f"tactile_{frame:04d}.png") as temporary:
                imsave(temporary, (pixels * 255 + 0.5).astype(np.uint8), metadata={"Software": "Palpate"})
        scale = {
            "quantity": " ".join(style.quantity_label),
            "first_colour": 0.0,
            "last_colour": top,
            "colour_map": style.colour_map,
        }
        with atomic_write(folder / "scale.json") as temporary:
            temporary.write_text(json.dumps(scale, indent=2) + "\n", encoding="utf-8")
        written.append(folder)
    return written


KINDS: dict[str, Callable[[Bake, Path, FigureStyle], Job[list[Path]]]] = {
    "csv": _csv,
    "npz": _npz,
    "hdf5": _hdf5,
    "png": _png,
}
