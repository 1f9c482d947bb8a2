# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack of effects of a sensor, `Object.palpate.effects`: properties made from the library, to and from plain data.

A new file in the library of effects appears here by itself. The numbers of enum items are made from their names, so that a
saved file does not depend on what else is in the library.
"""

from __future__ import annotations

import json
import zlib

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ...core.effects.engine import registry
from ...core.effects.engine.specification import Form, Kind
from ...core.errors import EffectError
from ...core.model.parameter import Parameter
from ...core.model.sensor import Effect
from ..session import transforms
from .parameter_properties import CONSTANT, FIXED, float_property, unit_in_words, with_unit

SITE_ICONS = {"contact": "MOD_PHYSICS", "pad": "MOD_CLOTH", "readout": "DRIVER"}


def form_key(kind: Kind) -> str:
    """Name of the property that holds the form of this kind."""
    return f"{kind.name}_form".replace("-", "_")


def value_key(kind: Kind, form: Form, parameter: Parameter) -> str:
    """Name of the property that holds a parameter."""
    return f"{kind.name}_{form.name}_{parameter.name}".replace("-", "_")


def _items(entries) -> list[tuple]:
    return [(name, title, text, icon, zlib.crc32(name.encode()) & 0x7FFFFFFF) for name, title, text, icon in entries]


def kind_items() -> list[tuple]:
    """Enum items of all kinds, in the order in which they act."""
    return _items((kind.name, kind.title, kind.text, SITE_ICONS[kind.site]) for kind in registry.library().values())


def title(name: str) -> str:
    """Return a name of the library as a title for people."""
    return name.replace("-", " ").title()


def _property(form: Form, parameter: Parameter):
    """Return the property that holds a parameter of a form."""
    bounds = "" if parameter.unit.startswith("unit") else f"; {parameter.low:g} to {parameter.high:g}"
    text, reference = parameter.text.removesuffix("."), form.reference.removesuffix(".")
    text = f"{text} ({unit_in_words(parameter)}{bounds}). Source: {reference}. {CONSTANT}"
    label = title(parameter.name.replace("_", "-"))
    if parameter.per_texel:
        text = f"Numbers separated by commas, one per texel or one for all. {text}"
        return StringProperty(name=with_unit(label, parameter), description=text, **FIXED)
    # Bounds in the sensor's own unit depend on its gain: they are checked when the stack is read.
    limits = {} if parameter.unit.startswith("unit") else None
    step = 0.1 if parameter.unit == "m" else 1
    return float_property(parameter, label, text, limits, precision=5, step=step)


def _annotations() -> dict:
    made = {
        "use": BoolProperty(name="Use", description="Use this effect", default=True, **FIXED),
        "show": BoolProperty(name="Show", description="Show its parameters", default=True, options=set()),
        "kind": EnumProperty(
            name="Effect", description="Effect of a real sensor that the base model leaves out", items=kind_items(), **FIXED
        ),
        "seed": IntProperty(name="Seed", description="Seed of the random numbers", min=0, **FIXED),
    }
    for kind in registry.library().values():
        forms = _items((form.name, title(form.name), form.formula, "NONE") for form in kind.forms)
        made[form_key(kind)] = EnumProperty(
            name="Form", description="Formula of the effect", items=forms, default=kind.forms[0].name, **FIXED
        )
        for form in kind.forms:
            for parameter in form.parameters:
                made[value_key(kind, form, parameter)] = _property(form, parameter)
    return made


PALPATE_PG_effect = type(
    "PALPATE_PG_effect",
    (bpy.types.PropertyGroup,),
    {"__doc__": "One effect of a sensor", "__annotations__": _annotations()},
)


def kind_of(item) -> Kind:
    """Kind of an entry of the stack."""
    return registry.kind_of(item.kind)


def form_of(item) -> Form:
    """Form of an entry of the stack."""
    return registry.form_of(item.kind, getattr(item, form_key(kind_of(item))))


def parameters(item) -> list[tuple[Parameter, str]]:
    """Parameters of an entry of the stack, with the names of their properties."""
    kind, form = kind_of(item), form_of(item)
    return [(parameter, value_key(kind, form, parameter)) for parameter in form.parameters]


def stack(obj) -> tuple[Effect, ...]:
    """Return the effects of a sensor that are in use, as plain data.

    Raises
    ------
    EffectError
        A list of numbers cannot be read.
    """
    return tuple(_plain(obj, item) for item in obj.palpate.effects if item.use)


def settings(obj) -> list[tuple]:
    """Return all settings of a sensor's stack of effects as tuples that can be compared."""
    return [
        (item.kind, form_of(item).name, item.seed, *(getattr(item, key) for _, key in parameters(item)))
        for item in obj.palpate.effects
        if item.use
    ]


def put_stack(obj, effects) -> None:
    """Give a sensor these effects and no others.

    Raises
    ------
    EffectError
        An effect is not valid; the sensor keeps the effects that it has.
    """
    gain = transforms.as_typed(obj.palpate.gain)
    registry.check(effects, obj.name, gain=gain)
    obj.palpate.effects.clear()
    for effect in effects:
        add(obj, effect)


def add(obj, effect: Effect):
    """Put an effect at the end of a sensor's stack and return its entry."""
    kind, form = registry.kind_of(effect.name), registry.form_of(effect.name, effect.form)
    item = obj.palpate.effects.add()
    item.name, item.kind, item.seed = kind.title, kind.name, effect.seed
    setattr(item, form_key(kind), form.name)
    values = registry.complete_values(effect, transforms.as_typed(obj.palpate.gain))
    for parameter in form.parameters:
        value = values[parameter.name]
        if parameter.per_texel:
            value = ", ".join(repr(number) for number in (value if isinstance(value, tuple) else (value,)))
        setattr(item, value_key(kind, form, parameter), value)
    return item


def _plain(obj, item) -> Effect:
    form = form_of(item)
    values = {}
    for parameter, key in parameters(item):
        value = getattr(item, key)
        if not parameter.per_texel:
            values[parameter.name] = transforms.as_typed(value)
        elif value.strip():
            values[parameter.name] = _numbers(value, f"{parameter.name} of effect '{item.kind}' of sensor '{obj.name}'")
        else:
            values[parameter.name] = parameter.scaled(transforms.as_typed(obj.palpate.gain)).default
    return Effect(item.kind, form.name, values, item.seed if form.random else 0)


def _numbers(text: str, where: str):
    try:
        numbers = tuple(float(number) for number in json.loads(f"[{text}]"))
    except (ValueError, TypeError):
        raise EffectError(f"{where} cannot be read: write numbers separated by commas, one per texel or one for all.") from None
    return numbers[0] if len(numbers) == 1 else numbers
