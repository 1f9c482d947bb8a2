# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the data: what a logger or its user did to the recordings, which is no effect of the sensor.

``data_fault`` describes a fault. ``clocks``, ``channels``, ``samples`` and ``scales`` find them, ``search`` calls these and
puts right what the rig asks for.
"""

__all__ = ["data_fault", "search"]
