# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor's texels and painted values beside its recording, so that a bake can be drawn and exported without Blender."""

from __future__ import annotations

import os
from dataclasses import fields
from typing import Any

import numpy as np

from ..geometry.layout.grid_layout import GridLayout
from ..geometry.layout.texture_maps import UVLayout
from ..geometry.texels import Texels
from ..model.sensor_parameters import Painted
from .npz import open_arrays, write_arrays

SENSOR_FORMAT = "palpate-sensor/1"
SENSOR_NAME = "sensor.npz"

_ARRAYS = tuple(item.name for item in fields(Texels) if item.name != "layout")
_LAYOUTS: dict[str, type[GridLayout] | type[UVLayout]] = {"grid": GridLayout, "uv": UVLayout}


def save_sensor(path: str | os.PathLike, texels: Texels, painted: Painted | None = None, atomic: bool = True) -> None:
    """Write texels, their layout and what is painted on them as .npz, as :func:`.write_file` does.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    write_arrays(path, sensor_arrays(texels, painted), atomic)


def sensor_arrays(texels: Texels, painted: Painted | None = None) -> dict[str, np.ndarray]:
    """Return the members of the file by name."""
    kind = next(name for name, cls in _LAYOUTS.items() if isinstance(texels.layout, cls))
    arrays = {"format": np.array(SENSOR_FORMAT), "layout": np.array(kind)}
    arrays |= {name: np.asarray(getattr(texels, name)) for name in _ARRAYS}
    arrays |= {f"layout/{item.name}": np.asarray(getattr(texels.layout, item.name)) for item in fields(texels.layout)}
    for item in fields(painted or Painted()):
        values = getattr(painted, item.name, None)
        if values is not None:
            arrays[f"painted/{item.name}"] = np.asarray(values)
    return arrays


def load_sensor(path: str | os.PathLike) -> tuple[Texels, Painted]:
    """Read what :func:`save_sensor` wrote.

    Raises
    ------
    FileError
        There is no such file, or it is damaged or something else.
    """
    with open_arrays(path, "sensor", "bake again with this version") as members:
        return sensor_in(members)


def sensor_in(members: Any) -> tuple[Texels, Painted]:
    """Return the sensor whose members an archive gives by name; raises what :data:`.npz.DAMAGED` lists."""
    if str(members["format"]) != SENSOR_FORMAT:
        raise ValueError(f"its format is not '{SENSOR_FORMAT}'")
    cls = _LAYOUTS[str(members["layout"])]
    stored = {item.name: f"layout/{item.name}" for item in fields(cls)}
    layout: Any = cls(**{name: _plain(members[key]) for name, key in stored.items() if key in members.files})
    texels = Texels(**{name: members[name] for name in _ARRAYS}, layout=layout)
    found = {item.name: f"painted/{item.name}" for item in fields(Painted)}
    return texels, Painted(**{name: np.asarray(members[key], float) for name, key in found.items() if key in members.files})


def _plain(value: np.ndarray) -> Any:
    return value if value.ndim else value.item()
