# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors for other simulators and from them: one module per format in :mod:`.formats`, found by :mod:`.sensor_format`.

A new format is one new module in :mod:`.formats` that defines a ``FORMAT``; the command line, the menus and the checks take it
from there. :mod:`.pressed_sensor` computes Palpate's forces inside the loop of another simulator, and :mod:`.pressed_sensors`
those of many environments. :mod:`.warp` does the same as :mod:`.pressed_sensors` on Warp, also on a GPU.
:mod:`.probe_list` has all that they need of a sensor.
"""

__all__ = [
    "baked_sensors",
    "contact_translation",
    "environment_parameters",
    "openrave_file",
    "pressed_sensor",
    "pressed_sensors",
    "probe_list",
    "sensor_format",
    "sensor_on_mesh",
    "warp",
]
