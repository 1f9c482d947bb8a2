# SPDX-License-Identifier: GPL-3.0-or-later
"""Largest stiffness and damping of the normal law (:mod:`.normal_force`), for advice on the time step.

This module holds no kernel, so that a panel can ask for advice without loading the compiler.
"""

from __future__ import annotations

from ..model.sensor_parameters import HUNT_CROSSLEY, SensorParameters


def largest_stiffness_and_damping(parameters: SensorParameters) -> tuple[float, float]:
    """Return stiffness (N/m) and damping (N·s/m) along the normal where they are largest within the maximum penetration."""
    p = parameters
    if p.normal_law != HUNT_CROSSLEY:
        return p.k, p.cn
    stiffness = p.k * p.exponent * p.max_penetration ** (p.exponent - 1.0)
    return stiffness, 1.5 * p.dissipation * p.k * p.max_penetration**p.exponent
