# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps that a user paints on a sensor: a factor of a parameter for each vertex."""

from bpy.props import FloatProperty, StringProperty

from .parameter_properties import FIXED

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
