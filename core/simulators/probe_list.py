# SPDX-License-Identifier: GPL-3.0-or-later
"""Probe lists: a sensor as plain numbers in JSON, complete enough for Palpate to compute its forces without Blender."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..effects.engine.registry import check, from_dict, to_dict
from ..errors import FileError, PalpateError
from ..geometry.grid_layout import GridLayout
from ..geometry.mesh import TriangleMesh, checked_mesh
from ..geometry.texels import Texels
from ..geometry.texture_maps import uv_layout
from ..io.file_writing import write_text
from ..io.input_files import checked_name, read_bounded
from ..io.schema import known_words
from ..io.sensor_toml import MOST_TEXELS
from ..model.sensor import Sensor
from ..model.sensor_parameters import SENSOR_PARAMETERS, Painted, SensorParameters, stated_parameters
from .sensor_on_mesh import SensorOnMesh, texel_arrays

PROBES_FORMAT = "palpate-probes/1"
UNITS = {"position": "m", "normal": "1", "tangent": "1", "area": "m2", "row": "1", "column": "1"}
"""Of the arrays of :func:`.texel_arrays`; factors have none."""
LARGEST_FILE = 256 * 2**20
"""Bytes; a list of the largest sensor that is read has 20 MB."""
UNIT_LENGTH = 1e-6
"""Largest error of the length of a normal or tangent, and of their product: they may have been written in single precision."""


def write_probe_list(path: str | os.PathLike, item: SensorOnMesh) -> None:
    """Write a sensor as JSON: its texels, parameters and effects, and the triangles between its texels."""
    arrays = texel_arrays(item)
    about: dict[str, Any] = {
        "format": PROBES_FORMAT,
        "sensor": item.name,
        "texels": len(item.sensor.texels),
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
    write_text(path, json.dumps(content, allow_nan=False) + "\n")


def read_probe_list(path: str | os.PathLike) -> SensorOnMesh:
    """Read what :func:`write_probe_list` wrote.

    Returns
    -------
    SensorOnMesh
        Its mesh consists of the texels and the triangles between them.

    Raises
    ------
    FileError
        There is no such file, or it is damaged or something else.
    ParameterError, EffectError
        A value is not valid.
    """
    content = _read_json(path)
    try:
        return _sensor_of(content)
    except PalpateError as error:
        raise type(error)(f"'{Path(path).name}': {error}") from error


def is_probe_list(path: str | os.PathLike) -> bool:
    """Return True if a file is JSON that says that it is a probe list; raises FileError if it cannot be read."""
    return Path(path).suffix.lower() == ".json" and _read_json(path).get("format") == PROBES_FORMAT


def _read_json(path: str | os.PathLike) -> dict[str, Any]:
    text = read_bounded(path, LARGEST_FILE, "probe list")
    try:
        content = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise FileError(f"'{path}' is not JSON ({str(error)[:80]}): export it again.") from error
    if not isinstance(content, dict):
        raise FileError(f"'{path}' is not a probe list: give a file that 'palpate sensor export --to probes' wrote.")
    return content


def _sensor_of(content: Mapping[str, Any]) -> SensorOnMesh:
    if content.get("format") != PROBES_FORMAT:
        raise FileError(f"Its format is {content.get('format')!r:.60}: a probe list's is '{PROBES_FORMAT}'.")
    name = checked_name(content.get("sensor"), "the file")
    words = content.get("parameters", {})
    if not isinstance(words, Mapping):
        raise FileError("Its parameters are not a table: export it again.")
    known_words(words, SENSOR_PARAMETERS, "parameters")
    parameters = SensorParameters(**stated_parameters(words, "parameters"))
    parameters.check(name)
    entries = content.get("effects", [])
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise FileError("Its effects are not a list of tables: export it again.")
    effects = tuple(from_dict(entry, parameters.gain) for entry in entries)
    position = _array(content, "position", (-1, 3))
    count = len(position)
    check(effects, name, count, parameters.gain)
    if not 3 <= count <= MOST_TEXELS:
        raise FileError(f"It has {count} texels: from 3 to {MOST_TEXELS} are read.")
    faces = _array(content, "faces", (-1, 3)).astype(int)
    mesh, _ = checked_mesh(position, faces, name)
    painted = {item.name: f"factor_{item.name}" for item in fields(Painted)}
    factors = Painted(**{key: _array(content, word, (count,)) for key, word in painted.items() if word in content})
    factors.check(name, count)
    texels = _texels(content, mesh)
    frame = content.get("frame")
    if not isinstance(frame, Mapping):
        raise FileError("It has no frame: export it again.")
    place, turn = _array(frame, "position", (3,)), _array(frame, "quaternion", (4,))
    return SensorOnMesh(Sensor(name, 0, texels, parameters, painted=factors, effects=effects), mesh, None, place, turn)


def _texels(content: Mapping[str, Any], mesh: TriangleMesh) -> Texels:
    count = len(mesh.vertices)
    normal, tangent = _array(content, "normal", (count, 3)), _array(content, "tangent", (count, 3))
    area = _array(content, "area", (count,))
    wrong = np.abs(np.einsum("ij,ij->i", normal, normal) - 1.0) + np.abs(np.einsum("ij,ij->i", tangent, tangent) - 1.0)
    wrong += np.abs(np.einsum("ij,ij->i", normal, tangent))
    if wrong.max() > 4 * UNIT_LENGTH:
        raise FileError(f"Normal and tangent of texel {wrong.argmax()} are not orthogonal unit vectors: export it again.")
    if area.min() < 0:
        raise FileError(f"The area of texel {area.argmin()} is below zero: export it again.")
    layout: Any
    if "row" in content:
        row, column = (_array(content, word, (count,)).astype(int) for word in ("row", "column"))
        rows, columns = int(row.max()) + 1, int(column.max()) + 1
        if min(row.min(), column.min()) < 0 or len(np.unique(row * columns + column)) != count or rows * columns != count:
            raise FileError("Its rows and columns make no grid: export it again.")
        layout = GridLayout(rows, columns, row, column, mesh.triangles)
    else:
        layout, _ = uv_layout(mesh.vertices, normal, mesh.triangles)
    return Texels(np.arange(count), mesh.vertices, normal, tangent, area, layout)


def _array(content: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array of a file with a shape, in which -1 stands for any number; raises FileError if it is none."""
    try:
        values = np.asarray(content.get(name), float)
    except (ValueError, TypeError, OverflowError) as error:
        raise FileError(f"'{name}' is not a list of numbers: export it again.") from error
    if values.ndim != len(shape) or any(n not in (-1, m) for n, m in zip(shape, values.shape)):
        wanted = " × ".join("n" if n < 0 else str(n) for n in shape)
        raise FileError(f"'{name}' is missing or has another size than {wanted}: export it again.")
    if not np.isfinite(values).all():
        raise FileError(f"'{name}' has a number that is NaN or infinite: export it again.")
    return values
