# SPDX-License-Identifier: GPL-3.0-or-later
"""The study of a scene's panel: a property becomes something that varies, and the settings become the file of a study."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ...core.errors import ParameterError, SceneError
from ...core.io.file_writing import writable_file, write_text
from ...core.model.body import DRIVE_PARAMETERS
from ...core.model.parameter import Choice, ChoiceParameter, Parameter, Specification
from ...core.model.sensor_parameters import SENSOR_PARAMETERS
from ...core.study import study_file
from ...core.study.scene_property import WholeNumber
from ...core.study.variation import AXES
from ..properties import effect_stack
from ..properties.object_properties import MOVED_BY_FORCES
from ..properties.parameter_properties import DRIVE_PARAMETER_PROPERTIES
from ..properties.scene_properties import NUMBER, WORDS
from ..scene.moved_bodies import TARGET_PROPERTIES
from ..session import transforms
from . import scene_overrides
from .scene_overrides import Found

WIDTH = 0.5
"""Part of its value by which a number that is put into a study varies to both sides."""
SENSORS = {"SENSOR", "PAD"}


@dataclass(frozen=True)
class Entry:
    """A property as a variable of a study.

    Attributes
    ----------
    name : str
        In the study's file.
    specification : Specification or None
        None for a switch.
    value : number, text or bool
        In the scene.
    """

    name: str
    specification: Specification | None
    value: Any


def entry_for(path: str) -> Entry:
    """Return the property at a path as a variable of a study: a name that the solver knows where there is one, else its path.

    Raises
    ------
    ParameterError
        It cannot vary.
    """
    found = scene_overrides.find_property(path)
    known = _known_to_solver(found)
    if known is not None:
        return known
    variable = scene_overrides.describe(path).variable()
    return Entry(path, variable.specification, found.get())


def _known_to_solver(found: Found) -> Entry | None:
    """Return the entry of a property whose number the solver knows, so that runs need no Blender."""
    block, kind = found.owner.id_data, found.owner.bl_rna.identifier
    if isinstance(block, bpy.types.Scene) and kind == "Scene" and found.key == "gravity" and found.index is not None:
        return Entry(f"gravity.{AXES[found.index]}", Parameter("gravity", "m/s²", 0.0, -math.inf, math.inf, ""), found.get())
    if not isinstance(block, bpy.types.Object):
        return None
    if kind == "PALPATE_PG_effect" and block.palpate.role in SENSORS:
        return _effect_entry(found, block)
    return _object_entry(found, block) if kind == "PALPATE_PG_object" else None


def _object_entry(found: Found, obj) -> Entry | None:
    settings, key, value = obj.palpate, found.key, found.get()
    number = transforms.as_typed(value) if isinstance(value, float) else value
    if key in SENSOR_PARAMETERS and settings.role in SENSORS:
        specification = SENSOR_PARAMETERS[key]
        if isinstance(specification, ChoiceParameter):
            number = type(specification.default)(value)
        return Entry(f"{obj.name}.{key}", specification, number)
    if key == "mass" and settings.body in MOVED_BY_FORCES:
        return Entry(f"{obj.name}.mass", Parameter("mass", "kg", 1.0, 0.0, math.inf, "", above_low=True), number)
    if key in ("velocity", "angular_velocity") and settings.body == "FREE" and found.index is not None:
        unit = "m/s" if key == "velocity" else "rad/s"
        return Entry(f"{obj.name}.{key}.{AXES[found.index]}", Parameter(key, unit, 0.0, -math.inf, math.inf, ""), number)
    if settings.body != "DRIVEN" or settings.drive_leader not in (None, obj):
        return None
    if key in DRIVE_PARAMETER_PROPERTIES:
        name = DRIVE_PARAMETER_PROPERTIES[key]
        return Entry(f"{obj.name}.drive.{name}", DRIVE_PARAMETERS[name], number)
    if key == TARGET_PROPERTIES[settings.drive_control]:
        unit = {"POSITION": "m", "VELOCITY": "m/s", "FORCE": "N"}[settings.drive_control]
        return Entry(f"{obj.name}.drive.target", Parameter("target", unit, 0.0, -math.inf, math.inf, ""), number)
    return None


def _effect_entry(found: Found, obj) -> Entry | None:
    item, start = found.owner, f"{obj.name}.effect.{found.owner.kind}"
    kind = effect_stack.kind_of(item)
    if found.key == "use":
        return Entry(start, None, found.get())
    if found.key == "seed":
        return Entry(f"{start}.seed", WholeNumber("seed", "1", 0.0, 0.0, 2**31 - 1, ""), found.get())
    if found.key == effect_stack.form_key(kind):
        forms = tuple(Choice(form.name, form.name, "") for form in kind.forms)
        return Entry(f"{start}.form", ChoiceParameter("form", kind.forms[0].name, forms, ""), found.get())
    for parameter, key in effect_stack.parameters(item):
        if key == found.key and not parameter.per_texel:
            specification = parameter.scaled(transforms.as_typed(obj.palpate.gain))
            return Entry(f"{start}.{parameter.name}", specification, transforms.as_typed(found.get()))
    return None


def vary(scene, path: str) -> list[str]:
    """Put the property at a path, or all components of a vector, into the study of a scene; return the names in the study.

    Raises
    ------
    ParameterError
        It cannot vary, or it varies already.
    """
    value = scene_overrides.find_property(path).get()
    is_vector = hasattr(value, "__len__") and not isinstance(value, str | set)
    entries = [entry_for(one) for one in ([f"{path}[{i}]" for i in range(len(value))] if is_vector else [path])]
    variables = scene.palpate.study.variables
    present = {item.name for item in variables}
    fresh = [entry for entry in entries if entry.name not in present]
    if not fresh:
        raise ParameterError(f"'{entries[0].name}' varies in the study already: change its range in the panel Study.")
    for entry in fresh:
        _add(variables, entry)
    return [entry.name for entry in fresh]


def _add(variables, entry: Entry) -> None:
    item, specification = variables.add(), entry.specification
    item.name = entry.name
    if isinstance(specification, Parameter) and not isinstance(specification, WholeNumber):
        item.kind = NUMBER
        item.unit = "" if specification.unit == "1" else specification.unit
        low, high = sorted((entry.value * (1.0 - WIDTH), entry.value * (1.0 + WIDTH)))
        low, high = (low, high) if low < high else (low, low + 1.0)
        item.low, item.high = max(low, specification.low), min(high, specification.high)
        item.mean, item.deviation = entry.value, max(abs(entry.value), 1e-6) * WIDTH / 2
        return
    item.kind, item.distribution = WORDS, "CHOICE"
    if specification is None:
        item.choices = "true, false"
    elif isinstance(specification, ChoiceParameter):
        item.choices = ", ".join(str(choice.value) for choice in specification.choices)
    else:
        item.choices = str(entry.value)


def study_tables(scene) -> dict[str, Any]:
    """Return the file of the scene's study as tables.

    Raises
    ------
    PalpateError
        The scene is not saved, or a value cannot be read.
    """
    if not bpy.data.filepath:
        raise SceneError("The scene has no file yet: save the .blend first, the study's runs read it.")
    own = scene.palpate.study
    design = own.design.lower().replace("_", "-")
    tables: dict[str, Any] = {"format": study_file.FORMAT, "scene": bpy.data.filepath, "design": design, "seed": own.seed}
    if own.design != "GRID":
        tables["samples"] = own.samples
    if own.images:
        tables["images"] = True
    if own.use_limit:
        tables["run_limit"] = transforms.as_typed(own.run_limit)
    if own.use_memory_limit:
        tables["run_memory"] = transforms.as_typed(own.run_memory)
    tables["vary"] = {item.name: _distribution(item, own.design) for item in own.variables if item.use}
    if own.use_press:
        tables["press"] = _press(own)
    return tables


def _distribution(item, design: str) -> Mapping[str, Any]:
    if item.kind == WORDS or item.distribution == "CHOICE":
        return {"choice": [_word(word.strip()) for word in item.choices.split(",") if word.strip()]}
    word = item.distribution.lower().replace("_", "-")
    pair = (item.mean, item.deviation) if item.distribution == "NORMAL" else (item.low, item.high)
    levels = {"levels": item.levels} if design == "GRID" else {}
    return {word: [transforms.as_typed(value) for value in pair], **levels}


def _word(text: str) -> Any:
    """Return the value of a word between commas: true, false, a number or a text."""
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        value = json.loads(text)
    except ValueError:
        return text
    return value if isinstance(value, int | float) and math.isfinite(value) else text


def _press(own) -> dict[str, Any]:
    low, high = (own.depth_low, own.depth_high) if own.press_by == "DEPTH" else (own.force_low, own.force_high)
    table: dict[str, Any] = {own.press_by.lower(): _range(low, high)}
    for name in ("slide", "tilt"):
        if getattr(own, name) > 0.0:
            table[name] = _range(0.0, getattr(own, name))
    if own.twist > 0.0:
        table["twist"] = _range(-own.twist, own.twist)
    return table


def _range(low: float, high: float) -> Any:
    """Return a uniform distribution, or the number where there is only one."""
    first, second = transforms.as_typed(low), transforms.as_typed(high)
    return first if first == second else {"uniform": [first, second]}


def study_path(scene) -> Path:
    """Return the file of the scene's study; its results are in the folder of the same name without the ending."""
    path = Path(bpy.path.abspath(scene.palpate.study.file))
    return path if path.suffix == ".toml" else path.with_name(f"{path.name}.toml")


def write_study(scene) -> Path:
    """Write the file of the scene's study and return its name.

    Raises
    ------
    PalpateError
        The scene is not saved, a value means nothing to a study, or the file cannot be written.
    """
    import tomli_w

    tables = study_tables(scene)
    if not tables["vary"] and not scene.palpate.study.use_press:
        raise ParameterError(
            "The study varies nothing: right-click on a number and choose Vary in Study, or use Random Presses."
        )
    path = Path(writable_file(study_path(scene)))
    with suppress(ValueError):  # on another drive
        tables["scene"] = Path(os.path.relpath(tables["scene"], path.parent)).as_posix()
    study_file.study_of(tables, path.name)
    write_text(path, tomli_w.dumps(tables))
    return path
