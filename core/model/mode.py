# SPDX-License-Identifier: GPL-3.0-or-later
"""What moves a body."""

from __future__ import annotations

from enum import IntEnum


class Mode(IntEnum):
    """What moves a body: its animation; forces; or its animation together with an actuator along an axis.

    What follows from it in the solver is in :mod:`palpate.core.solver.dynamics.modes`.
    """

    KEYFRAMED = 0
    FREE = 1
    DRIVEN = 2
