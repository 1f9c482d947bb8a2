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
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..effects.engine.registry import check, from_dict, to_dict
from ..errors import FileError, PalpateError
from ..model.effect import Effect
from ..model.sensor_parameters import SENSOR_PARAMETERS, SensorParameters
from .file_writing import atomic_write
from .regular_file import read_bytes

FORMAT = "palpate-sensor-toml/1"
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


def write_sensor(path: str | os.PathLike, model: SensorModel) -> None:
    """Write a sensor as TOML, completely or not at all; raise :class:`FileError` when that is not possible."""
    text = sensor_text(model)
    with atomic_write(path) as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n")


def sensor_text(model: SensorModel) -> str:
    """Return the text of a sensor's file."""
    import tomli_w

    words = {name: getattr(model.parameters, name) for name in SENSOR_PARAMETERS}
    table: dict[str, Any] = {"format": FORMAT, "name": model.name, "sensor": {**words, **_plain(model.shape)}}
    if model.effects:
        table["effect"] = [to_dict(item) for item in model.effects]
    return tomli_w.dumps(table)


def read_sensor(path: str | os.PathLike) -> SensorModel:
    """Read the file of a sensor.

    Raises
    ------
    FileError
        There is no such file, or it is not a sensor's file.
    EffectError, ParameterError
        A value is not valid.
    """
    try:
        text = read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileError(f"'{path}' is not a text file: choose a sensor's .toml.") from error
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({error.strerror}): check the name.") from error
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"'{path}' is not valid TOML ({error}): mend that line.") from error
    try:
        return sensor_of(table)
    except PalpateError as error:
        raise type(error)(f"'{Path(path).name}': {error}") from error


def sensor_of(table: Mapping[str, Any]) -> SensorModel:
    """Return the sensor that the tables of a file describe; raise the same errors as :func:`read_sensor`."""
    if table.get("format") != FORMAT:
        raise FileError(f'Its format is {table.get("format")!r}: a sensor\'s file begins with format = "{FORMAT}".')
    known_words(table, {"format", "name", "sensor", "effect"}, "the file")
    name, words, entries = table.get("name", "sensor"), table.get("sensor", {}), table.get("effect", [])
    if not isinstance(name, str) or not isinstance(words, Mapping):
        raise FileError('It needs name = "…" and [sensor] with the sensor\'s words.')
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise FileError("Its effects have to be written as [[effect]], one for each.")
    known_words(words, {*SENSOR_PARAMETERS, *SHAPE_WORDS}, "[sensor]")
    parameters = SensorParameters(**stated_parameters(words, "[sensor]"))
    parameters.check(name)
    effects = tuple(from_dict(entry, parameters.gain) for entry in entries)
    check(effects, name, gain=parameters.gain)
    return SensorModel(name, parameters, effects, {key: words[key] for key in SHAPE_WORDS if key in words})


def stated_parameters(words: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the values of those parameters of a sensor that the words of a [sensor] state.

    Every file with a [sensor] is read here. What a parameter may be is in :class:`.SensorParameters`.

    Parameters
    ----------
    words : mapping
        The table as it was written; words that are no parameters are left out.
    where : str
        Which table of which file this is, for the message.

    Raises
    ------
    FileError
        A word is of another kind than its parameter, such as a text where a number belongs.
    """
    values = {}
    for name, specification in SENSOR_PARAMETERS.items():
        if name in words:
            values[name] = specification.read(words[name])
            if values[name] is None:
                raise FileError(f"{name} of {where} is {words[name]!r}: give {specification.wanted}.")
    return values


def known_words(table: Mapping[str, Any], words: set[str], where: str) -> None:
    """Raise :class:`FileError` for the first key of a table that is not among the `words` of its format."""
    for key in table:
        if key not in words:
            raise FileError(f"'{key}' in {where} is not a word of this format: it knows {', '.join(sorted(words))}.")


def _plain(words: Mapping[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in words.items()}
