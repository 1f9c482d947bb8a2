# SPDX-License-Identifier: GPL-3.0-or-later
"""HDF5: one file for the whole bake, one group per sensor, with units as attributes."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import imported
from ...figures.figure_style import FigureStyle
from ...io.bake_reader import Bake
from ...io.file_writing import atomic_write
from ...jobs import Job
from ..exporter import UNITS, Exporter, bake_arrays, sensor_progress


def write_hdf5(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write ``palpate.h5``. The library makes it in memory, because it crashes on a write that fails, as on a full disk."""
    h5py = imported("h5py", "HDF5")
    recording, path = bake.recording, folder / "palpate.h5"
    with h5py.File(path.name, "w", driver="core", backing_store=False, block_size=1 << 24) as file:  # bytes by which it grows
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
            yield sensor_progress(bake, name)
            group = sensors.create_group(_hdf5_name(name, sensors))
            group.attrs["name"], group.attrs["unit"] = name, bake.parameters[name].unit
            group.attrs["parameters"] = json.dumps(asdict(bake.parameters[name]))
            channels = recording.sensors[name].channels
            if channels is not None:
                group.attrs["channels_names"] = list(channels.names)
            for key, array in bake_arrays(bake, name).items():
                _dataset(group, key, array, _unit(bake, name, key))
        file.flush()
        with atomic_write(path) as temporary:
            temporary.write_bytes(file.id.get_file_image())
    return [path]


def _hdf5_name(name: str, group: Any) -> str:
    """Return a name for a new group. A slash in it would make a group inside a group."""
    plain = name.replace("/", "_").strip(".") or "_"
    while plain in group:
        plain += "_"
    return plain


def _dataset(group: Any, name: str, array: np.ndarray, unit: str) -> None:
    """Write an array, compressed unless it is empty."""
    packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True} if array.size else {}
    group.create_dataset(name, data=array, track_times=False, **packed).attrs["unit"] = unit


def _unit(bake: Bake, name: str, key: str) -> str:
    channels = bake.recording.sensors[name].channels
    if channels is not None and key == "channels":
        return channels.unit
    return bake.parameters[name].unit if key == "reading" else UNITS.get(key, "1")


EXPORTER = Exporter("hdf5", write_hdf5)
