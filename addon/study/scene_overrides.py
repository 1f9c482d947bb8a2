# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of the open file by their paths, as ``bpy.data.objects["Ball"].location[2]``: what they are, and other values.

Blender itself resolves a path, and executes nothing, so that a file of overrides from somebody else only sets properties.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import bpy

from ...core.errors import ParameterError, SceneError, did_you_mean
from ...core.study.scene_property import CHOICE, NUMBER, PREFIX, SWITCH, WHOLE_NUMBER, SceneProperty
from ..session import fcurves
from .property_path import double_quoted

LARGEST = 1e38
"""Bounds beyond it are those of the type, not of the property."""
_KEY = r'\["((?:[^"\\]|\\.)*)"\]'
_STEP = re.compile(rf"\.(\w+)|{_KEY}|\[(\d+)\]")
_LAST_STEP = re.compile(rf"(.*)(?:\.(\w+)|{_KEY})(?:\[(\d+)\])?")
"""The owner of a property, the property's name or key, and a component."""
_UNITS = {
    "LENGTH": "Blender units",
    "ROTATION": "rad",
    "MASS": "kg",
    "TIME": "frames",
    "TIME_ABSOLUTE": "s",
    "VELOCITY": "Blender units/s",
    "ACCELERATION": "Blender units/s²",
    "TEMPERATURE": "K",
}
_OWN_SETTINGS = "PALPATE_PG_"
"""Settings of Palpate can have no keyframes, since they are constant during a run; a study may set them nevertheless."""


@dataclass(frozen=True)
class Found:
    """A property of the open file.

    Attributes
    ----------
    path : str
    owner : bpy_struct
    key : str
        Name of the property, or of the custom property in quotation marks and brackets.
    index : int or None
        Component of a vector.
    """

    path: str
    owner: Any
    key: str
    index: int | None = None

    def get(self) -> Any:
        """Return its value."""
        value = self.owner[self.key] if self.is_custom else getattr(self.owner, self.key)
        return value if self.index is None else value[self.index]

    def put(self, value: Any) -> None:
        """Set its value."""
        if self.index is not None:
            (self.owner[self.key] if self.is_custom else getattr(self.owner, self.key))[self.index] = value
        elif self.is_custom:
            self.owner[self.key] = value
        else:
            setattr(self.owner, self.key, value)

    @property
    def is_custom(self) -> bool:
        """Whether it is a custom property, which the type of its owner does not know."""
        return self.key not in self.owner.bl_rna.properties

    @property
    def data_path(self) -> str:
        """Its path from its data-block, without the component, as keyframes name it."""
        if not self.is_custom:
            return self.owner.path_from_id(self.key)
        start = "" if self.owner == self.owner.id_data else self.owner.path_from_id()
        return f'{start}["{bpy.utils.escape_identifier(self.key)}"]'


def find_property(path: str) -> Found:
    """Return the property at a path.

    Raises
    ------
    ParameterError
        There is none; the message has the name that is most like it.
    """
    if not path.startswith(PREFIX):
        raise ParameterError(
            f"'{path:.80}' is not the path of a property: begin it with {PREFIX}, as Copy Full Data Path does."
        )
    inner = double_quoted(path.removeprefix(PREFIX))
    last = _LAST_STEP.fullmatch(inner)
    try:
        value = bpy.data.path_resolve(inner)
        owner = bpy.data.path_resolve(last[1]) if last and last[1] else None
    except ValueError:
        raise _unknown(path, inner) from None
    if last is None or not hasattr(owner, "bl_rna") or value is None or hasattr(value, "bl_rna"):
        raise ParameterError(f"'{path}' is not a number, switch or choice: add the name of one of its properties.")
    key = last[2] or re.sub(r"\\(.)", r"\1", last[3])
    return Found(path, owner, key, None if last[4] is None else int(last[4]))


def _unknown(path: str, inner: str) -> ParameterError:
    """Return the error of a path that Blender does not find, with the name that is most like the first that is not there."""
    owner, before = bpy.data, "bpy.data"
    for step in _STEP.finditer(f".{inner}"):
        try:
            found = bpy.data.path_resolve(inner[: step.end() - 1])
        except ValueError:
            names = owner.bl_rna.properties.keys() if step[1] and hasattr(owner, "bl_rna") else getattr(owner, "keys", list)()
            name = next(word for word in step.groups() if word is not None)
            advice = did_you_mean(name, names, "check its spelling, or copy it by Copy Full Data Path.", 0.5)
            return ParameterError(f"There is no '{name}' in '{before}', which the study names as '{path}': {advice}")
        owner, before = found, before + step[0]
    return ParameterError(f"'{path}' cannot be read: copy it by Copy Full Data Path.")


def describe(path: str) -> SceneProperty:
    """Return type, unit and bounds of the property at a path.

    Raises
    ------
    ParameterError
        There is none, or a study cannot vary it.
    """
    found = find_property(path)
    value = found.get()
    if hasattr(value, "__len__") and not isinstance(value, str | set):
        raise ParameterError(f"'{path}' has {len(value)} components: add [0] to [{len(value) - 1}] for one of them.")
    item = _described_custom(found, value) if found.is_custom else _described(found)
    _refuse_animated(found)
    return item


def _described(found: Found) -> SceneProperty:
    rna = found.owner.bl_rna.properties[found.key]
    is_own = found.owner.bl_rna.identifier.startswith(_OWN_SETTINGS)
    if rna.is_readonly or not (rna.is_animatable or is_own) or not found.owner.id_data.is_editable:
        raise ParameterError(f"'{found.path}' cannot be set by a study: it is read-only, linked, or has no keyframes.")
    if rna.type == "BOOLEAN":
        return SceneProperty(found.path, SWITCH)
    if rna.type == "ENUM" and not rna.is_enum_flag:
        return SceneProperty(found.path, CHOICE, choices=tuple(item.identifier for item in rna.enum_items))
    if rna.type not in ("FLOAT", "INT"):
        raise ParameterError(f"'{found.path}' is not a number, switch or choice, so a study cannot vary it.")
    low, high = _bounds(rna.hard_min, rna.hard_max)
    kind = NUMBER if rna.type == "FLOAT" else WHOLE_NUMBER
    return SceneProperty(found.path, kind, _UNITS.get(rna.unit, ""), low, high)


def _described_custom(found: Found, value: Any) -> SceneProperty:
    if isinstance(value, bool):
        return SceneProperty(found.path, SWITCH)
    if not isinstance(value, int | float):
        raise ParameterError(f"'{found.path}' is not a number or switch, so a study cannot vary it.")
    limits = found.owner.id_properties_ui(found.key).as_dict()
    low, high = _bounds(limits.get("min", -inf), limits.get("max", inf))
    return SceneProperty(found.path, NUMBER if isinstance(value, float) else WHOLE_NUMBER, "", low, high)


def _bounds(low: float, high: float) -> tuple[float | None, float | None]:
    largest = 2**31 - 1 if isinstance(low, int) else LARGEST
    return (None if low <= -largest else float(low)), (None if high >= largest else float(high))


def _refuse_animated(found: Found) -> None:
    """Raise ParameterError for a property that keyframes or a driver would set again at the next frame."""
    path = found.data_path
    for curve in fcurves.curves_of(found.owner.id_data):
        if curve.data_path == path and (found.index is None or curve.array_index == found.index):
            raise ParameterError(
                f"'{found.path}' has keyframes or a driver, which would set it again at the next frame: delete them, or vary "
                "a property that they depend on."
            )


def apply(values: Mapping[str, Any]) -> None:
    """Set properties of the open file, all or none.

    Raises
    ------
    ParameterError
        A path is not that of a property, or a value is outside its bounds.
    SceneError
        Blender does not take a value.
    """
    checked = [(find_property(path), describe(path).variable().read(value)) for path, value in values.items()]
    for found, value in checked:
        try:
            found.put(value)
        except (TypeError, ValueError, AttributeError) as error:
            raise SceneError(f"Blender does not take {value!r} for '{found.path}' ({error}): vary something else.") from error
    bpy.context.view_layer.update()
