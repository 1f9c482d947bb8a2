# SPDX-License-Identifier: GPL-3.0-or-later
"""The laws of contact in plain Python, as the paper writes them: the reference for every test of the compiled formulas.

All functions take numbers or arrays.
"""

from __future__ import annotations

import numpy as np

from palpate.core.model.sensor_parameters import HUNT_CROSSLEY, SensorParameters


def normal_force(p: SensorParameters, depth, rate):
    """Normal force of a texel pressed in by `depth` (m) at `rate` (m/s), newtons: Eq. 8, or Hunt and Crossley's law."""
    if p.normal_law == HUNT_CROSSLEY:
        return np.maximum(p.k * np.maximum(depth, 0.0) ** p.exponent * (1.0 + 1.5 * p.dissipation * rate), 0.0)
    return np.maximum(p.k * depth + p.cn * rate, 0.0)


def steady_friction(p: SensorParameters, load, speed):
    """Eq. 10–12, with the exponential that was lost in print: friction of steady sliding without its viscous part, newtons."""
    return load * (p.mud + (p.mus - p.mud) * np.exp(-((speed / p.x0) ** 2)))


def bristle_rate(p: SensorParameters, load, z, v):
    """Eq. 9 in one dimension, m/s; `load` is the normal force (N), `z` the bristle deflection (m), `v` the velocity (m/s)."""
    return v - p.sigma0 * np.abs(v) / steady_friction(p, load, v) * z


def friction_force(p: SensorParameters, load, z, v):
    """Eq. 13 in one dimension, newtons."""
    return p.sigma0 * z + p.sigma1 * bristle_rate(p, load, z, v) + p.ct * v
