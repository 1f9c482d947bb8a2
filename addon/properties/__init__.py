# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of objects and scenes: the properties that Blender shows in panels and saves with the file.

Only what has to be saved lives here, no state of a simulation. Numbers are in SI units with the unit in the name, since Blender
has no unit for N/m; :mod:`.scene_units` shows lengths, masses and velocities in the units of the scene. Names of properties
stand in saved files, so a property that is renamed is also read under its former name, in :mod:`.migrations`.
"""

__all__ = [
    "effect_stack",
    "figure_properties",
    "migrations",
    "object_properties",
    "parameter_properties",
    "registration",
    "scene_properties",
    "scene_units",
]
