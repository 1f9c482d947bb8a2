# SPDX-License-Identifier: GPL-3.0-or-later
"""The normal law of a contact point: linear (paper, Eq. 8) or Hunt and Crossley's.

With `d` the depth and ḋ its rate:

* linear: ``fn = max(k d + cn ḋ, 0)``, along the object's surface normal;
* Hunt and Crossley (J. Appl. Mech. 42, 1975, eq. 8 and 13): ``fn = max(k dᵖ (1 + 3/2 α ḋ), 0)``.

Neither pulls: adhesion is an effect. The functions of numbers here are compiled; :func:`.kernels.plain` gives the same formulas
for whole arrays.
"""

from __future__ import annotations

import numpy as np

from ..compiled.kernels import inlined, kernel
from . import contact_stiffness
from .contact_law import LINEAR_EXPONENT, ContactLaw

hunt_crossley_damping = inlined(contact_stiffness.hunt_crossley_damping)


@inlined
def elastic_force(depth: float, law: ContactLaw) -> float:
    """Force of the spring at a depth of zero or more, N: ``k d`` or ``k dᵖ``."""
    return law.k * depth if law.exponent == LINEAR_EXPONENT else law.k * depth**law.exponent


@inlined
def elastic_stiffness(depth: float, force: float, law: ContactLaw) -> float:
    """Derivative of :func:`elastic_force`, whose value is `force`, at a depth above zero, N/m."""
    return law.k if law.exponent == LINEAR_EXPONENT else law.exponent * force / depth


@inlined
def damping_coefficient(law: ContactLaw) -> float:
    """Coefficient of the rate in the damping term: `cn` (N·s/m), or ``3/2 α`` (s/m), which multiplies the elastic force."""
    return law.cn if law.exponent == LINEAR_EXPONENT else hunt_crossley_damping(law.dissipation)


@inlined
def damped_force(elastic: float, rate: float, law: ContactLaw) -> float:
    """Elastic force and damping together, N; it may be negative."""
    damping = damping_coefficient(law) * rate
    return elastic + damping if law.exponent == LINEAR_EXPONENT else elastic * (1.0 + damping)


@inlined
def damped_force_derivatives(
    elastic: float, stiffness: float, coefficient: float, rate: float, linear: bool
) -> tuple[float, float, float]:
    """Add damping to an elastic force, and differentiate the sum.

    This is :func:`damped_force` for an elastic force that effects have changed.

    Parameters
    ----------
    elastic, stiffness : float, N and N/m
        Elastic force and its derivative by depth.
    coefficient : float
        See :func:`damping_coefficient`.
    rate : float, m/s
    linear : bool

    Returns
    -------
    force : float, N
    by_depth, by_rate : float, N/m and N·s/m
    """
    by_depth = stiffness if linear else stiffness * (1.0 + coefficient * rate)
    by_rate = coefficient if linear else coefficient * elastic
    return elastic + by_rate * rate, by_depth, by_rate


@inlined
def linear_normal_force(depth: float, rate: float, law: ContactLaw) -> float:
    """Normal force of the linear law, as :func:`normal_force`."""
    return max(law.k * depth + law.cn * rate, 0.0)


@kernel
def normal_force(depth: float, rate: float, law: ContactLaw) -> float:
    """Normal force at a depth (m) and its rate (m/s), N; never negative."""
    if law.exponent == LINEAR_EXPONENT:
        return linear_normal_force(depth, rate, law)
    return max(damped_force(elastic_force(max(depth, 0.0), law), rate, law), 0.0)


@inlined
def linear_tangent(depth: float, dt: float, law: ContactLaw) -> tuple[float, float]:
    """Tangent of the linear law, as :func:`normal_tangent`, which is its own tangent at every rate."""
    return law.k * depth, law.k * dt + law.cn


@kernel
def normal_tangent(depth: float, rate: float, dt: float, law: ContactLaw) -> tuple[float, float]:
    """Tangent of the normal force at a step's end as a function of the rate: ``force = bias + slope · rate``.

    Parameters
    ----------
    depth : float, metres
        At the step's beginning; at its end it is ``depth + dt · rate``.
    rate : float, m/s
        Where the tangent touches the law.
    dt : float, seconds
    law : ContactLaw

    Returns
    -------
    bias : float, N
    slope : float, N·s/m
        Never negative. Both are zero where Hunt and Crossley's law gives no force.
    """
    if law.exponent == LINEAR_EXPONENT:
        return linear_tangent(depth, dt, law)
    damping = damping_coefficient(law)
    end, factor = depth + dt * rate, 1.0 + damping * rate
    if end <= 0.0 or factor <= 0.0:
        return 0.0, 0.0
    spring = elastic_force(end, law)
    slope = spring * (law.exponent * dt * factor / end + damping)
    return spring * factor - slope * rate, slope


def elastic_energy(stiffness: np.ndarray, depth: np.ndarray, exponent: float) -> float:
    """Energy that springs hold together, joules.

    Parameters
    ----------
    stiffness, depth : (n,) float, N/m (N/mᵖ) and metres
    exponent : float
        As in :class:`.ContactLaw`.
    """
    power = 1.0 if exponent == LINEAR_EXPONENT else exponent
    return float(np.sum(stiffness * depth ** (power + 1.0))) / (power + 1.0)
