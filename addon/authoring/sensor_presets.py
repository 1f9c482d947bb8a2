# SPDX-License-Identifier: GPL-3.0-or-later
"""What presets hold, and parameters that are copied from one sensor to another."""

from __future__ import annotations

from pathlib import Path

from ...core.model.sensor_parameters import SENSOR_PARAMETERS
from ..properties import effect_stack

FOLDER = Path(__file__).parents[1] / "presets"
"""Folder of the presets that come with Palpate."""
COPIED = (*SENSOR_PARAMETERS, "k_factor", "friction_factor", "gain_factor")
"""Names of the properties that presets hold and that are copied: all that do not depend on the mesh of one sensor."""


def copy_parameters(source, target) -> None:
    """Give a sensor the parameters and effects of another one.

    Its region and its name stay. Effects that are switched off are not copied.
    """
    for name in COPIED:
        setattr(target.palpate, name, getattr(source.palpate, name))
    effect_stack.put_stack(target, effect_stack.stack(source))
