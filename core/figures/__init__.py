# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a recording: tactile images over time, curves, numbers, and what goes on a rendered picture.

Forces are in newtons, pressures in kilopascals, lengths in millimetres, and no text is smaller than 8 pt at the size of the
written figure. What a figure looks like is said once, by a :class:`Look`, for all figures of a recording.
"""

from .curves import force_curves, time_curves
from .look import Look
from .numbers import texel_numbers
from .panels import side_by_side
from .pictures import Label, label_picture
from .strips import tactile_strip

__all__ = [
    "Label",
    "Look",
    "force_curves",
    "label_picture",
    "side_by_side",
    "tactile_strip",
    "texel_numbers",
    "time_curves",
]
