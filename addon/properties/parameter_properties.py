# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of Blender made from the specifications of parameters in :mod:`..core.model`, and read back as plain data."""

from __future__ import annotations

from collections.abc import Mapping

from bpy.props import EnumProperty, FloatProperty, StringProperty

from ...core.model.body import DRIVE_PARAMETERS
from ...core.model.parameter import ChoiceParameter, Parameter, Specification
from ...core.model.sensor_parameters import SENSOR_PARAMETERS, SensorParameters
from ..session import session_state, transforms
from .scene_units import ENDING, KINDS, in_units

FIXED: dict = {"options": set(), "override": {"LIBRARY_OVERRIDABLE"}, "update": session_state.settings_changed}
"""A parameter is constant during a run, so it has no keyframes; what is shown follows it."""
CONSTANT = "Constant during a run, so it has no keyframes"
"""Ends the tooltip of a number that one could want to keyframe, and stands in its context menu."""
LOWEST, HIGHEST = -1e9, 3.402823466e38
"""Bounds of a panel's number where the parameter has none; the second is the largest number of Blender."""


def unit_in_words(parameter: Parameter) -> str:
    """Return the unit for a tooltip."""
    return {"1": "no unit", "unit": "in the sensor's unit"}.get(parameter.unit, parameter.unit)


def with_unit(label: str, parameter: Parameter) -> str:
    """Return a label for a panel, followed by the unit where there is one."""
    return label if parameter.unit == "1" else f"{label} ({parameter.unit})"


def float_property(parameter: Parameter, label: str, description: str, limits: dict | None = None, **more):
    """Return a number of Blender with a parameter's default.

    Parameters
    ----------
    parameter : Parameter
    label, description : str
        Without and with the unit.
    limits : dict, optional
        ``min`` and ``max``. Default: the bounds of the parameter.
    **more
        Precision and step.
    """
    if limits is None:
        # Blender's bounds are inclusive: zero can be typed where only values above it are allowed. The check of the parameter
        # then says what to type, whereas a tiny lower bound would silently replace the zero by a number that means as little.
        limits = {"min": max(parameter.low, LOWEST), "max": min(parameter.high, HIGHEST)}
    name = with_unit(label, parameter)
    return FloatProperty(name=name, description=description, default=parameter.default, **limits, **more, **FIXED)


def described(parameter: Parameter) -> str:
    """Return a parameter's tooltip: meaning, SI unit, source and typical values."""
    text = f"{parameter.text}, {unit_in_words(parameter)}"
    if parameter.source:
        text += f" ({parameter.source})"
    return f"{text}. {parameter.note.rstrip('.')}. {CONSTANT}" if parameter.note else f"{text}. {CONSTANT}"


def property_of(specification: Specification):
    """Return the property of Blender that holds a parameter."""
    if isinstance(specification, ChoiceParameter):
        items = [(str(choice.value), choice.label, choice.text) for choice in specification.choices]
        default = str(specification.default)
        return EnumProperty(name=specification.label, description=specification.text, items=items, default=default, **FIXED)
    if not isinstance(specification, Parameter):
        return StringProperty(name=specification.label, description=specification.text, default=specification.default, **FIXED)
    description = described(specification)
    digits = {"precision": 5, "step": 0.1} if specification.unit == "m" else {"precision": 4, "step": 10}
    return float_property(specification, f"{specification.label} {specification.symbol}".strip(), description, **digits)


def properties_in_units(specifications: Mapping[str, Specification]) -> dict:
    """Return the properties that show parameters in the scene's units, for those that have a unit of Blender, by name."""
    found = {}
    for name, specification in specifications.items():
        if isinstance(specification, Parameter) and specification.unit in KINDS:
            label = f"{specification.label} {specification.symbol}".strip()
            found[name + ENDING] = in_units(
                name, specification.unit, label, described(specification), min=max(specification.low, LOWEST), step=0.1
            )
    return found


class SensorParameterProperties:
    """The parameters of a sensor, each under its own name, and again in the scene's units where they have one."""

    __annotations__ = {
        **{name: property_of(specification) for name, specification in SENSOR_PARAMETERS.items()},
        **properties_in_units(SENSOR_PARAMETERS),
    }


DRIVE_PARAMETER_PROPERTIES = {f"drive_{name}": name for name, item in DRIVE_PARAMETERS.items() if item.label}
"""Properties that hold a drive's parameters, and the names of these. A parameter without a label has no property."""


class DriveParameterProperties:
    """The parameters of a drive."""

    __annotations__ = {
        **{key: property_of(DRIVE_PARAMETERS[name]) for key, name in DRIVE_PARAMETER_PROPERTIES.items()},
        **properties_in_units({key: DRIVE_PARAMETERS[name] for key, name in DRIVE_PARAMETER_PROPERTIES.items()}),
    }


def sensor_parameters(settings) -> SensorParameters:
    """Return the parameters that the settings of a sensor hold."""
    values = {}
    for name, specification in SENSOR_PARAMETERS.items():
        value = getattr(settings, name)
        values[name] = transforms.as_typed(value) if isinstance(value, float) else type(specification.default)(value)
    return SensorParameters(**values)


def put_sensor_parameters(settings, parameters: SensorParameters) -> None:
    """Write parameters into the settings of a sensor."""
    for name, specification in SENSOR_PARAMETERS.items():
        value = getattr(parameters, name)
        setattr(settings, name, str(value) if isinstance(specification, ChoiceParameter) else value)


def drive_parameters(settings) -> dict[str, float]:
    """Return the values by name of those parameters of a drive that the settings of an object hold."""
    return {name: transforms.as_typed(getattr(settings, key)) for key, name in DRIVE_PARAMETER_PROPERTIES.items()}


PAINTED_PARAMETERS = ("k", "friction", "gain")
"""Each of them has two properties: ``<name>_map`` names a vertex group or attribute, ``<name>_factor`` is its factor."""


def is_map(attribute) -> bool:
    """True for an attribute of a mesh that holds a number for each vertex and that a user may mean."""
    return attribute.domain == "POINT" and attribute.data_type == "FLOAT" and not attribute.name.startswith((".", "palpate_"))


def _names_of_maps(settings, context, typed):
    """Return the names of vertex groups and attributes that contain what was typed."""
    obj = settings.id_data
    names = [group.name for group in obj.vertex_groups]
    if obj.type == "MESH":
        names += [item.name for item in obj.data.attributes if is_map(item)]
    return [name for name in names if typed.lower() in name.lower()]


def _map(what: str, effect: str):
    """Return the property that holds the name of a map."""
    return StringProperty(
        name=what,
        description=f"Vertex group or attribute that gives each texel a factor of {effect}. "
        "A weight of 1 means the factor below, 0 leaves the texel as it is; an attribute holds the factors themselves",
        search=_names_of_maps,
        **FIXED,
    )


def _factor(what: str):
    """Return the property that says what a weight of 1 means."""
    return FloatProperty(
        name="At Full Weight (×)",
        description=f"Factor of {what} where the weight is 1, no unit; 1 changes nothing",
        default=0.5,
        min=0.0,
        soft_max=4.0,
        precision=3,
        **FIXED,
    )


class PaintedProperties:
    """The painted maps of a sensor, one for each field of :class:`.Painted`."""

    k_map: _map("Painted Stiffness", "stiffness and damping")
    k_factor: _factor("stiffness and damping")
    friction_map: _map("Painted Friction", "static and dynamic friction")
    friction_factor: _factor("friction")
    gain_map: _map("Painted Gain", "the gain")
    gain_factor: _factor("the gain")
