# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of a Blender scene that a study varies by their path, as ``bpy.data.objects["Ball"].location[2]``.

Blender alone knows them and what they do, so each run with other values is read from the scene anew. What a property is (a
number with bounds, a switch, one of some words) is asked once and kept beside the scene in the study's folder, so that values
are also checked where there is no Blender.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from ..errors import FileError, ParameterError, os_error_reason
from ..io.file_writing import atomic_write
from ..io.npz import DAMAGED
from ..io.regular_file import read_bytes
from ..io.toml_file import read_toml
from ..model.parameter import Choice, ChoiceParameter, Parameter, Specification
from .variation import Variable

PREFIX = "bpy.data."
"""How the path of a property begins; Blender copies it in this form (*Copy Full Data Path*)."""
OVERRIDES_FORMAT, PROPERTIES_FORMAT = "palpate-overrides/1", "palpate-properties/1"
OVERRIDES = "overrides"
NUMBER, WHOLE_NUMBER, SWITCH, CHOICE = KINDS = ("number", "whole number", "switch", "choice")


class WholeNumber(Parameter):
    """A parameter that is a whole number."""

    def read(self, word: Any) -> float | None:
        """Return the value that a word of a file means, None when it means none."""
        return word if isinstance(word, int) and not isinstance(word, bool) else None

    wanted = "a whole number"


@dataclass(frozen=True)
class SceneProperty:
    """What a property of a scene is.

    Attributes
    ----------
    name : str
        Its path.
    kind : str
        One of :data:`KINDS`.
    unit : str
        Of a number, as Blender stores it; "" where it has none.
    low, high : float
        Bounds of a number, inclusive.
    choices : tuple of str
        Words that a choice knows.
    """

    name: str
    kind: str
    unit: str = ""
    low: float = -inf
    high: float = inf
    choices: tuple[str, ...] = ()

    def variable(self) -> Variable:
        """Return it as something that a study varies."""
        specification: Specification | None = None
        if self.kind in (NUMBER, WHOLE_NUMBER):
            make = Parameter if self.kind == NUMBER else WholeNumber
            specification = make(self.name, self.unit, 0.0, self.low, self.high, "Property of the scene")
        elif self.kind == CHOICE:
            items = tuple(Choice(word, word, "") for word in self.choices)
            specification = ChoiceParameter(self.name, self.choices[0] if self.choices else "", items, "Property of the scene")
        return Variable(self.name, "the scene", (self.name,), specification)


def is_scene_property(name: str) -> bool:
    """Return whether a name of a study is the path of a property of Blender."""
    return name.startswith(PREFIX)


def scene_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those values of a run that the scene is read with."""
    return {name: value for name, value in values.items() if is_scene_property(name)}


def write_overrides(path: str | os.PathLike, values: Mapping[str, Any]) -> None:
    """Write values of properties into the file that ``palpate bake --overrides`` takes; :class:`FileError` if that fails."""
    import tomli_w

    text = tomli_w.dumps({"format": OVERRIDES_FORMAT, OVERRIDES: dict(values)})
    with atomic_write(path) as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n")


def read_overrides(path: str | os.PathLike) -> dict[str, Any]:
    """Return the values by path that a file of overrides has.

    Raises
    ------
    FileError
        It cannot be read, or has something else than paths of properties.
    """
    table, name = read_toml(path, "file of overrides"), Path(path).name
    if table.get("format") != OVERRIDES_FORMAT or not isinstance(table.get(OVERRIDES), dict):
        raise FileError(f"'{name}' has no overrides: begin it with format = \"{OVERRIDES_FORMAT}\" and a table [{OVERRIDES}].")
    for key in table[OVERRIDES]:
        if not is_scene_property(key):
            raise ParameterError(
                f"'{key:.80}' in '{name}' is no path of a property: write it as bpy.data.objects[\"Name\"].property."
            )
    return dict(table[OVERRIDES])


def write_properties(path: str | os.PathLike, properties: Iterable[SceneProperty]) -> None:
    """Write what properties of a scene are; :class:`FileError` if that fails."""
    rows = [
        {
            "name": item.name,
            "kind": item.kind,
            "unit": item.unit,
            "low": None if math.isinf(item.low) else item.low,
            "high": None if math.isinf(item.high) else item.high,
            "choices": list(item.choices),
        }
        for item in properties
    ]
    with atomic_write(path) as fresh:
        text = json.dumps({"format": PROPERTIES_FORMAT, "properties": rows}, ensure_ascii=False, indent=1)
        fresh.write_text(text + "\n", encoding="utf-8", newline="\n")


def read_properties(path: str | os.PathLike) -> dict[str, SceneProperty]:
    """Return what :func:`write_properties` wrote, by path; nothing where there is no file.

    Raises
    ------
    FileError
        It cannot be read, or is damaged.
    """
    try:
        content = json.loads(read_bytes(path))
        if content["format"] != PROPERTIES_FORMAT:
            raise ValueError(f"its format is {content['format']!r:.40}")
        found = {}
        for row in content["properties"]:
            low, high = -inf if row["low"] is None else float(row["low"]), inf if row["high"] is None else float(row["high"])
            if row["kind"] not in KINDS:
                raise ValueError(f"kind {row['kind']!r:.40}")
            found[str(row["name"])] = SceneProperty(
                str(row["name"]), row["kind"], str(row["unit"]), low, high, tuple(map(str, row["choices"]))
            )
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error
    except DAMAGED as error:
        raise FileError(f"'{path}' is damaged ({error}): begin the study anew.") from error
    return found
