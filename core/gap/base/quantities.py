# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings and net forces: columns of arrays that hold a value for each, and which effects show in which."""

from __future__ import annotations

from ...effects.engine.registry import library

READINGS, FORCES = 0, 1
"""Columns of arrays that hold a value for readings and one for net forces."""


def friction_kinds() -> list[str]:
    """Return the names of the effects that act on friction alone."""
    return [kind.name for kind in library().values() if all(form.friction_law is not None for form in kind.forms)]
