# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes and edits sensors, pads and targets, and reports what is wrong with them.

Operators call these functions. Texels can be laid onto another object's surface (:mod:`.laid_sensors`) and bound to it
(:mod:`.surface_binding`); :mod:`.problems` finds faults and fixes them; :mod:`.exchange` reads and writes sensor files.
"""

__all__ = [
    "exchange",
    "laid_sensors",
    "magnetic_skins",
    "probes",
    "problems",
    "sensor_exchange",
    "sensor_import",
    "sensor_report",
    "sensors",
    "surface_binding",
    "texel_overlay",
]
