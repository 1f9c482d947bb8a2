# SPDX-License-Identifier: GPL-3.0-or-later
"""Probe lists: the texels of a sensor as plain numbers, in JSON and in NPZ, for Genesis, Isaac Lab and one's own code."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...effects.engine.registry import to_dict
from ...io.bake_folder import folder_names
from ...io.file_writing import write_file
from ...io.npz import write_arrays
from ..sensor_format import SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh, texel_arrays

PROBES_FORMAT = "palpate-probes/1"
UNITS = {"position": "m", "normal": "1", "tangent": "1", "area": "m2", "row": "1", "column": "1"}
"""Of the arrays of :func:`.texel_arrays`; factors have none."""


def write_probes(sensors: Sequence[SensorOnMesh], folder: Path) -> Written:
    """Write a JSON and an NPZ file per sensor."""
    files: list[Path] = []
    for item, stem in zip(sensors, folder_names(item.name for item in sensors).values(), strict=True):
        files += [folder / f"{stem}.json", folder / f"{stem}.npz"]
        write_probe_list(files[-2], item)
        arrays = texel_arrays(item) | {"frame_position": item.position, "frame_quaternion": item.quaternion}
        write_arrays(files[-1], arrays | {"faces": item.faces, "format": np.array(PROBES_FORMAT)}, atomic=False)
    return Written(
        files, [f"'{item.name}': parameters and effects are written as data; no simulator reads them." for item in sensors]
    )


def write_probe_list(path: str | os.PathLike, item: SensorOnMesh) -> None:
    """Write the texels of a sensor as JSON."""
    arrays = texel_arrays(item)
    about: dict[str, Any] = {
        "format": PROBES_FORMAT,
        "sensor": item.name,
        "texels": len(item.texels),
        "frame": {
            "about": "The arrays are in this frame; its pose in the scene is a position (m) and a quaternion (w, x, y, z).",
            "position": item.position.tolist(),
            "quaternion": item.quaternion.tolist(),
        },
        "units": {name: UNITS.get(name, "1") for name in arrays},
        "parameters": asdict(item.sensor.parameters),
        "effects": [to_dict(effect) for effect in item.sensor.effects],
    }
    content = about | {name: values.tolist() for name, values in arrays.items()} | {"faces": item.faces.tolist()}
    with write_file(path, atomic=False) as place:
        place.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")


FORMAT = SensorFormat(
    "probes", "Probe List (JSON, NPZ)", "Positions, normals and areas of the texels, for any code", write_probes
)
