# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of a Blender scene that a study varies by their path, as ``bpy.data.objects["Ball"].location[2]``.

Blender alone knows them and what they do, so each run with other values is read from the scene again. What a property is (a
number with bounds, a switch, one of some words) is asked once and kept beside the scene in the study's folder, so that values
are also checked where there is no Blender.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from typing import Any, Literal, get_args

from ..errors import FileError, ParameterError
from ..io.file_writing import write_text
from ..io.input_files import read_toml
from ..io.schema import read_json
from ..model.parameter import Choice, ChoiceParameter, Parameter, Specification
from .variation import Variable

PREFIX = "bpy.data."
"""How the path of a property begins; Blender copies it in this form (*Copy Full Data Path*)."""
OVERRIDES_FORMAT, PROPERTIES_FORMAT = "palpate-overrides/1", "palpate-properties/1"
OVERRIDES = "overrides"
Kind = Literal["number", "whole number", "switch", "choice"]
NUMBER, WHOLE_NUMBER, SWITCH, CHOICE = get_args(Kind)


class WholeNumber(Parameter):
    """A parameter that is a whole number."""

    def read(self, word: Any) -> float | None:
        """Return the value that a word of a file means, None when it means none."""
        return word if isinstance(word, int) and not isinstance(word, bool) else None

    wanted = "a whole number"


@dataclass(frozen=True)
class SceneProperty:
    """Type, unit and bounds of a property of a scene.

    Attributes
    ----------
    name : str
        Its path.
    kind : str
    unit : str
        Of a number, as Blender stores it; "" where it has none.
    low, high : float or None
        Bounds of a number, inclusive; None where it has none.
    choices : tuple of str
        Words that a choice knows.
    """

    name: str
    kind: Kind
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()

    def variable(self) -> Variable:
        """Return it as something that a study varies."""
        specification: Specification | None = None
        if self.kind in (NUMBER, WHOLE_NUMBER):
            make = Parameter if self.kind == NUMBER else WholeNumber
            low, high = (-inf if self.low is None else self.low), (inf if self.high is None else self.high)
            specification = make(self.name, self.unit, 0.0, low, high, "Property of the scene")
        elif self.kind == CHOICE:
            items = tuple(Choice(word, word, "") for word in self.choices)
            specification = ChoiceParameter(self.name, self.choices[0] if self.choices else "", items, "Property of the scene")
        return Variable(self.name, "the scene", (self.name,), specification)


def is_scene_property(name: str) -> bool:
    """Return whether a name of a study is the path of a property of Blender."""
    return name.startswith(PREFIX)


def write_overrides(path: str | os.PathLike, values: Mapping[str, Any]) -> None:
    """Write values of properties into the file that ``palpate bake --overrides`` takes; :class:`FileError` if that fails."""
    import tomli_w

    text = tomli_w.dumps({"format": OVERRIDES_FORMAT, OVERRIDES: dict(values)})
    write_text(path, text)


def read_overrides(path: str | os.PathLike) -> dict[str, Any]:
    """Return the values by path that a file of overrides has.

    Raises
    ------
    FileError, ParameterError
        It cannot be read, or has something else than paths of properties.
    """
    table, name = read_toml(path, "file of overrides"), Path(path).name
    if table.get("format") != OVERRIDES_FORMAT or not isinstance(table.get(OVERRIDES), dict):
        raise FileError(f"'{name}' has no overrides: begin it with format = \"{OVERRIDES_FORMAT}\" and a table [{OVERRIDES}].")
    for key in table[OVERRIDES]:
        if not is_scene_property(key):
            raise ParameterError(
                f"'{key:.80}' in '{name}' is not the path of a property: write it as bpy.data.objects[\"Name\"].property."
            )
    return dict(table[OVERRIDES])


def write_properties(path: str | os.PathLike, properties: Iterable[SceneProperty]) -> None:
    """Write what properties of a scene are; :class:`FileError` if that fails."""
    rows = [asdict(item) for item in properties]
    text = json.dumps({"format": PROPERTIES_FORMAT, "properties": rows}, ensure_ascii=False, indent=1)
    write_text(path, text + "\n")


def read_properties(path: str | os.PathLike) -> dict[str, SceneProperty]:
    """Read the properties that :func:`write_properties` wrote, by path; none where there is no file.

    Raises
    ------
    FileError
        It cannot be read, or is damaged.
    """
    try:
        found, _ = read_json(path, _PropertiesFile, PROPERTIES_FORMAT, "start the study again")
    except FileNotFoundError:
        return {}
    return {row.name: row for row in found.properties}


@dataclass
class _PropertiesFile:
    """File of :func:`write_properties`."""

    properties: tuple[SceneProperty, ...]
