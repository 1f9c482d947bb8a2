# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings and net forces: columns of arrays that hold a value for each, and which effects show in which."""

from __future__ import annotations

from ...effects.engine.registry import library, site_of_action
from ...model.sensor import Effect

READINGS, FORCES = 0, 1
"""Columns of arrays that hold a value for readings and one for net forces."""


def friction_kinds() -> list[str]:
    """Return the names of the effects that act on friction alone."""
    return [kind.name for kind in library().values() if all(form.friction_law is not None for form in kind.forms)]


def quantities_changed_by(effect: Effect) -> tuple[int, ...]:
    """Return which of READINGS and FORCES an effect can change: a readout not the forces, and friction not the readings."""
    if site_of_action(effect) == "readout":
        return (READINGS,)
    return (FORCES,) if effect.name in friction_kinds() else (READINGS, FORCES)
