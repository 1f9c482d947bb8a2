# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors in many environments on Warp, by the same formulas as everywhere: a processor's core, or a GPU.

:mod:`.translation` makes Warp functions of the sources of laws, and Warp kernels of :mod:`.press_kernels`. :mod:`.warp_sensors`
has the class that programs use. Warp is imported when one is made.
"""

__all__ = ["effect_functions", "engine", "press_arrays", "press_kernels", "translation", "warp_sensors"]
