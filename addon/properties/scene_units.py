# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties that show others in the units of the scene: millimetres where the scene is in millimetres.

What is saved, read and written to files are the others, in SI units. Blender shows a number with a unit in the scene's units
and takes it to be in Blender units, so these properties convert between both. Blender has no unit for newtons or N/m: such
numbers stay as they are, with the unit in their name.
"""

from __future__ import annotations

import bpy
from bpy.props import FloatProperty, FloatVectorProperty

from ..session import transforms

# Options of properties that are paths of files and folders which Palpate writes.
#
# Newer Blenders draw such a field red, as an error, unless the property says that // may begin its path and that it is an
# output.

_NAMES = {"PATH_SUPPORTS_BLEND_RELATIVE": "is_path_supports_blend_relative", "OUTPUT_PATH": "is_path_output"}
OUTPUT: set = {option for option, flag in _NAMES.items() if flag in bpy.types.Property.bl_rna.properties}


ENDING = "_in_units"
"""Suffix of such a property's name after the name of the one that it shows."""
KINDS = {"m": ("LENGTH", 1), "m/s": ("VELOCITY", 1), "kg": ("MASS", 3)}
"""Blender's kind of unit by the SI unit, and the power of the scene's unit scale with which Blender multiplies it."""
DIGITS = 6
"""Significant digits that are kept of what is typed where a Blender unit is no metre. Blender holds the scale and the quotient
in 32 bits each, whose errors reach the seventh digit."""


def in_units(name: str, unit: str, label: str, text: str, is_vector: bool = False, **more):
    """Return a property that shows another of the same group in the units of the scene.

    Parameters
    ----------
    name : str
        The property that is shown, in SI units.
    unit : str
        Its SI unit, from :data:`KINDS`.
    label, text : str
        Name and description without unit.
    is_vector : bool
        Three numbers along x, y and z.
    **more
        Bounds, step and other options of the property.
    """
    kind, power = KINDS[unit]

    def unit_size() -> float:
        return transforms.metres_per_unit(bpy.context.scene) ** power

    def in_si(shown: float) -> float:
        size = unit_size()
        return shown if size == 1.0 else float(f"{shown * size:.{DIGITS}g}")

    def read(group):
        value = getattr(group, name)
        return [part / unit_size() for part in value] if is_vector else value / unit_size()

    def write(group, shown) -> None:
        setattr(group, name, [in_si(part) for part in shown] if is_vector else in_si(shown))

    make, more = (FloatVectorProperty, {"size": 3, "subtype": "XYZ", **more}) if is_vector else (FloatProperty, more)
    return make(name=label, description=text, unit=kind, precision=4, get=read, set=write, options={"SKIP_SAVE"}, **more)


def name_in_units(group, name: str, scene) -> str:
    """Return the property that shows another in the scene's units; the other itself where the scene or it has no units."""
    shown = name + ENDING
    has_units = scene.unit_settings.system != "NONE"
    return shown if has_units and shown in group.bl_rna.properties else name
