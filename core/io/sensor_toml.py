# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor as a text file: its parameters, its effects and, for a sensor of a rig, the keys for its shape.

::

    format = "palpate-sensor-toml/1"
    name = "pad"

    [sensor]                       # the keys of a rig's [sensor]; parameters without a value have their default
    k = 58.4
    unit = "N"
    grid = { rows = 14, columns = 6, pitch = [0.0034, 0.0034] }

    [[effect]]                     # one for each effect; docs/effects.md lists their parameters
    name = "creep"
    form = "exponential"
    amount = 0.21
    time = 1.7

Reading a file gives exactly the numbers that were written.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from ..effects.engine.registry import check, from_dict, to_dict
from ..errors import FileError, PalpateError
from ..model.sensor import Effect
from ..model.sensor_parameters import SENSOR_PARAMETERS, SensorParameters, stated_parameters
from .file_writing import write_text
from .input_files import checked_name, is_number, read_toml
from .schema import Name, known_words, read_words, wanted

FORMAT = "palpate-sensor-toml/1"
MOST_TEXELS = 65536
"""Texels of a grid in a file."""
SHORTEST_LENGTH, LONGEST_LENGTH = 1e-9, 1e6
"""Metres; a length of a sensor or of an indenter is between them, whatever its unit was taken for."""
SHAPE_WORDS = ("grid", "mesh", "thickness")
"""Keys of a rig's [sensor] that say where its texels are. They are kept as they are."""


@dataclass(frozen=True)
class SensorModel:
    """A sensor without its texels.

    Attributes
    ----------
    name : str
    parameters : SensorParameters
    effects : tuple of Effect
    shape : mapping
        Keys of a rig's [sensor] for its shape (:data:`SHAPE_WORDS`); empty when the sensor is a mesh of a scene.
    """

    name: str
    parameters: SensorParameters = field(default_factory=SensorParameters)
    effects: tuple[Effect, ...] = ()
    shape: Mapping[str, Any] = field(default_factory=dict)


@dataclass
class _SensorFile:
    name: Name = "sensor"
    sensor: Annotated[dict[str, Any], wanted("write [sensor] with the sensor's words")] = field(default_factory=dict)
    effect: Annotated[list[dict[str, Any]], wanted("write [[effect]], one for each")] = field(default_factory=list)


def write_sensor(path: str | os.PathLike, model: SensorModel) -> None:
    """Write a sensor as TOML, completely or not at all; raise :class:`FileError` when that is not possible."""
    import tomli_w

    words = {name: getattr(model.parameters, name) for name in SENSOR_PARAMETERS}
    table: dict[str, Any] = {"format": FORMAT, "name": model.name, "sensor": {**words, **model.shape}}
    if model.effects:
        table["effect"] = [to_dict(item) for item in model.effects]
    write_text(path, tomli_w.dumps(table))


def read_sensor(path: str | os.PathLike) -> SensorModel:
    """Read the file of a sensor.

    Raises
    ------
    FileError
        There is no such file, or it is not a sensor's file.
    EffectError, ParameterError
        A value is not valid.
    """
    table = read_toml(path, "sensor")
    try:
        return _sensor_of(table)
    except PalpateError as error:
        raise type(error)(f"'{Path(path).name}': {error}") from error


def _sensor_of(table: Mapping[str, Any]) -> SensorModel:
    if table.get("format") != FORMAT:
        raise FileError(f'Its format is {table.get("format")!r}: a sensor\'s file begins with format = "{FORMAT}".')
    found = read_words(table, _SensorFile, "the file", besides=("format",))
    name, words = found.name, found.sensor
    known_words(words, (*SENSOR_PARAMETERS, *SHAPE_WORDS), "[sensor]")
    parameters = SensorParameters(**stated_parameters(words, "[sensor]"))
    parameters.check(name)
    effects = tuple(from_dict(entry, parameters.gain) for entry in found.effect)
    check(effects, name, gain=parameters.gain)
    return SensorModel(name, parameters, effects, _checked_shape(words))


def _checked_shape(words: Mapping[str, Any]) -> dict[str, Any]:
    """Return the words for the shape that a [sensor] has; raise FileError for a grid, mesh or thickness that is none."""
    shape = {key: words[key] for key in SHAPE_WORDS if key in words}
    if "grid" in shape:
        rows, columns, pitch = checked_grid(shape["grid"], "[sensor]")
        shape["grid"] = {**shape["grid"], "rows": rows, "columns": columns, "pitch": list(pitch)}
    if "mesh" in shape:
        checked_name(shape["mesh"], "mesh of [sensor]")
    if "thickness" in shape:
        checked_lengths(shape["thickness"], 1, "thickness of [sensor]")
    return shape


def checked_grid(grid: Any, where: str) -> tuple[int, int, tuple[float, float]]:
    """Return rows, columns and pitch (x and y, metres) of a grid as a file writes it.

    Raises
    ------
    FileError
        It is no grid, or one with too many texels; `where` says of which table or file.
    """
    if not isinstance(grid, Mapping):
        raise FileError(f"grid of {where} is {grid!r:.80}: write {{ rows = 14, columns = 6, pitch = [0.0034, 0.0034] }}.")
    known_words(grid, {"rows", "columns", "pitch"}, f"grid of {where}")
    counts = []
    for key in ("rows", "columns"):
        count = grid.get(key)
        if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= MOST_TEXELS:
            raise FileError(f"{key} of {where} is {count!r:.60}: give a whole number from 1 to {MOST_TEXELS}.")
        counts.append(count)
    rows, columns = counts
    if rows * columns > MOST_TEXELS:
        raise FileError(f"The grid of {where} has {rows * columns} texels: at most {MOST_TEXELS} are read.")
    pitch = grid.get("pitch")
    pitch_x, pitch_y = checked_lengths(pitch if isinstance(pitch, list | tuple) else [pitch, pitch], 2, f"pitch of {where}")
    return rows, columns, (pitch_x, pitch_y)


def checked_lengths(value: Any, count: int, what: str) -> tuple[float, ...]:
    """Return a number of lengths (m) that a file gives; raise FileError, which names `what`, when they are none."""
    items = value if isinstance(value, list | tuple) else [value]
    if len(items) != count or not all(is_number(item) and SHORTEST_LENGTH <= item <= LONGEST_LENGTH for item in items):
        many = "a number" if count == 1 else f"{count} numbers"
        raise FileError(
            f"{what} is {value!r:.80}: give {many} above zero, in metres, from {SHORTEST_LENGTH:g} to {LONGEST_LENGTH:g}."
        )
    return tuple(float(item) for item in items)
