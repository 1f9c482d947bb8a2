# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenarios as .npz: what a Blender scene says to the solver, complete, for programs that have no Blender.

The member ``header`` is JSON text: the format, the digest of the scenario, and the tree of its dataclasses, in which an array
stands as the number of its member ``array_<i>``. The scenario that is read has the digest of the one that was written.
"""

from __future__ import annotations

import json
import os
from dataclasses import is_dataclass
from typing import Any

import numpy as np

from ..errors import FileError
from ..geometry.grid_layout import GridLayout
from ..geometry.mesh import TriangleMesh
from ..geometry.texels import Texels
from ..geometry.texture_maps import UVLayout
from ..model.body import Body, Drive, Motion, Signal
from ..model.recording import stated_fields
from ..model.scenario import Scenario, Target
from ..model.sensor import Deformation, Effect, Sensor
from ..model.sensor_parameters import Painted, SensorParameters
from ..skins.channel_readouts import LinearReadout, MagneticReadout, ReadoutMatrix
from ..skins.magnetic_skin import MagneticSkin, Magnetometers, Magnets
from .recording_npz import open_arrays, write_arrays

SCENARIO_FORMAT = "palpate-scenario/1"

_CLASSES: dict[str, type] = {
    cls.__name__: cls
    for cls in (Body, Deformation, Drive, Effect, GridLayout, Motion, Painted, Scenario, Sensor, SensorParameters)
    + (Signal, Target, Texels, TriangleMesh, UVLayout)
    + (MagneticReadout, MagneticSkin, Magnetometers, Magnets, LinearReadout, ReadoutMatrix)
}
_CLASS, _ARRAY, _TUPLE, _DICT = "class", "array", "tuple", "dict"
"""Keys of JSON objects that stand for what JSON does not have."""


def save_scenario(path: str | os.PathLike, scenario: Scenario) -> None:
    """Write a scenario as .npz, whole or not at all; equal scenarios give equal bytes.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    arrays: list[np.ndarray] = []
    tree = _packed(scenario, arrays)
    header = {"format": SCENARIO_FORMAT, "digest": scenario.digest(), "scenario": tree}
    members = {"header": np.array(json.dumps(header))} | {f"array_{i}": array for i, array in enumerate(arrays)}
    write_arrays(path, members)


def load_scenario(path: str | os.PathLike) -> Scenario:
    """Read what :func:`save_scenario` wrote.

    Raises
    ------
    FileError
        There is no such file, it is damaged or something else, or its digest is not that of what was written.
    """
    with open_arrays(path, "scenario", "write it again") as members:
        header = json.loads(str(members["header"]))
        if header["format"] != SCENARIO_FORMAT:
            raise FileError(
                f"'{path}' has the format {header['format']!r:.40}, not '{SCENARIO_FORMAT}': write it again with this version."
            )
        scenario = _unpacked(header["scenario"], members)
    if not isinstance(scenario, Scenario) or scenario.digest() != header["digest"]:
        raise FileError(f"'{path}' is damaged: its digest is not that of its content; write it again.")
    return scenario


def _packed(value: Any, arrays: list[np.ndarray]) -> Any:
    """Return a value as JSON knows it; its arrays are appended to `arrays`."""
    if is_dataclass(value) and not isinstance(value, type):
        stated = {item.name: _packed(getattr(value, item.name), arrays) for item in stated_fields(value)}
        return {_CLASS: type(value).__name__, "fields": stated}
    if isinstance(value, np.ndarray | np.generic):
        arrays.append(np.asarray(value))
        return {_ARRAY: len(arrays) - 1, "scalar": isinstance(value, np.generic)}
    if isinstance(value, tuple):
        return {_TUPLE: [_packed(item, arrays) for item in value]}
    if isinstance(value, list):
        return [_packed(item, arrays) for item in value]
    if isinstance(value, dict):
        return {_DICT: [[key, _packed(item, arrays)] for key, item in value.items()]}
    if value is None or type(value) in (bool, int, float, str):
        return value
    raise TypeError(f"{type(value).__name__} cannot be part of a scenario's file")


def _unpacked(node: Any, members: Any) -> Any:
    """Return the value that :func:`_packed` made JSON of."""
    if isinstance(node, list):
        return [_unpacked(item, members) for item in node]
    if not isinstance(node, dict):
        return node
    if _CLASS in node:
        stated = {name: _unpacked(item, members) for name, item in node["fields"].items()}
        return _CLASSES[node[_CLASS]](**stated)
    if _ARRAY in node:
        array = members[f"array_{node[_ARRAY]}"]
        return array[()] if node["scalar"] else array
    if _TUPLE in node:
        return tuple(_unpacked(item, members) for item in node[_TUPLE])
    return {key: _unpacked(item, members) for key, item in node[_DICT]}
