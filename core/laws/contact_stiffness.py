# SPDX-License-Identifier: GPL-3.0-or-later
"""Largest stiffness and damping of the normal law (:mod:`.normal_force`), for advice on the time step.

This module does not load the compiler, so that a panel can ask for advice. Kernels take :func:`hunt_crossley_damping` from
:mod:`.normal_force`, which compiles it.
"""

from __future__ import annotations

from ..model.sensor_parameters import HUNT_CROSSLEY, SensorParameters


def hunt_crossley_damping(dissipation: float) -> float:
    """Return the damping force of Hunt and Crossley's law per elastic force and rate, ``3/2 α`` (s/m)."""
    return 1.5 * dissipation


def largest_stiffness_and_damping(parameters: SensorParameters) -> tuple[float, float]:
    """Return stiffness (N/m) and damping (N·s/m) along the normal where they are largest within the maximum penetration."""
    p = parameters
    if p.normal_law != HUNT_CROSSLEY:
        return p.k, p.cn
    stiffness = p.k * p.exponent * p.max_penetration ** (p.exponent - 1.0)
    return stiffness, hunt_crossley_damping(p.dissipation) * p.k * p.max_penetration**p.exponent
