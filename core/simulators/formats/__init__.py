# SPDX-License-Identifier: GPL-3.0-or-later
"""The formats of sensors: each module defines one ``FORMAT`` (:class:`..sensor_format.SensorFormat`).

That module finds the formats by itself. None needs the simulator whose files it writes.
"""

__all__ = []
