# SPDX-License-Identifier: GPL-3.0-or-later
"""How the texels of a sensor were laid onto the surface of its parent object."""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from .scene_units import units_of_lengths

SKIN_METHODS = (
    ("NONE", "None", "Not laid onto a surface"),
    ("ARRAY", "Array", "Rows and columns of a given pitch, wrapped around the surface"),
    ("GRID", "Rows at a Spacing", "Rows and columns at a spacing, as far as the region goes"),
    ("NOISE", "Even", "Evenly spaced without rows (blue noise)"),
    ("VERTICES", "Vertices", "One texel for each vertex of the region"),
)

FIELDS = {
    "ARRAY": ("rows", "columns", "pitch_x", "pitch_y", "shift_x", "shift_y", "angle", "lift"),
    "GRID": ("spacing", "angle", "lift"),
    "NOISE": ("spacing", "seed", "lift"),
    "VERTICES": ("lift",),
}
"""Settings that each pattern is made from."""


def _length(name: str, text: str, **more):
    """Return a property that is a length in metres."""
    return FloatProperty(name=name, description=text, precision=5, step=0.01, options=set(), **more)


class LengthsInUnits:
    """The lengths of a pattern in the units of the scene."""

    __annotations__ = units_of_lengths(
        {
            "pitch_x": ("Column Pitch", "Distance between columns"),
            "pitch_y": ("Row Pitch", "Distance between rows"),
            "shift_x": ("Shift Across", "Displacement of the middle of the array along its rows"),
            "shift_y": ("Shift Along", "Displacement of the middle of the array across its rows"),
            "spacing": ("Spacing", "Distance between texels"),
            "lift": ("Lift", "Height of the texels above the surface"),
        }
    )


class PALPATE_PG_skin(LengthsInUnits, bpy.types.PropertyGroup):
    """How the texels of a sensor were laid onto the surface of its parent: `Object.palpate.skin`"""

    method: EnumProperty(
        name="Pattern",
        description="How texels are laid onto the surface",
        items=SKIN_METHODS,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    rows: IntProperty(name="Rows", description="Number of rows of the array", default=14, min=2, options=set())
    columns: IntProperty(name="Columns", description="Number of columns of the array", default=6, min=2, options=set())
    pitch_x: _length("Column Pitch (m)", "Distance between columns, m", default=0.0034, min=1e-6)
    pitch_y: _length("Row Pitch (m)", "Distance between rows, m", default=0.0034, min=1e-6)
    shift_x: _length("Shift Across (m)", "Displacement of the middle of the array along its rows, m")
    shift_y: _length("Shift Along (m)", "Displacement of the middle of the array across its rows, m")
    angle: FloatProperty(
        name="Turn", description="Angle of the rows, anticlockwise seen from outside", subtype="ANGLE", options=set()
    )
    spacing: _length("Spacing (m)", "Distance between texels, m", default=0.002, min=1e-6)
    seed: IntProperty(name="Seed", description="Seed of the random pattern", min=0, options=set())
    lift: _length("Lift (m)", "Height of the texels above the surface, m", min=0.0)
    region: StringProperty(options={"HIDDEN"})
    region_name: StringProperty(options={"HIDDEN"})
    region_number: IntProperty(options={"HIDDEN"})
    region_threshold: FloatProperty(default=0.5, options={"HIDDEN"})  # that of sensors that were laid before it was stored
    made_from: StringProperty(options={"HIDDEN"})
