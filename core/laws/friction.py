# SPDX-License-Identifier: GPL-3.0-or-later
"""LuGre friction of a contact point (paper, section 3.2, Eq. 9 to 13, with its errata; docs/model.md explains them).

With `z` the deflection of the bristles (m), `v` the tangential velocity (m/s) and `fn` the normal force (N):

* Eq. 10–12: ``g = fn (mud + (mus - mud) exp(-|v|² / x0²))``; the exponential was lost in print;
* Eq. 9: ``ż = v - sigma0 |v| / g · z``;
* Eq. 13: ``ft = sigma0 z + sigma1 ż + ct v``.

Two things are added. The deflection is carried along as the texel and the surface under it turn. And it never exceeds what
static friction holds, ``sigma0 |z| ≤ mus fn``: where the normal force falls faster than the bristles can slide, Eq. 9 alone
would leave friction without a normal force.

Over a step the velocity is taken as constant, for which Eq. 9 has a closed solution. It is bounded for every step size.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..model.sensor_parameters import SensorParameters
from .contact_law import ContactLaw, contact_law

TAYLOR = tuple(1.0 / math.factorial(n + 1) for n in range(15))
"""Taylor coefficients of (1 - exp(-y)) / y without their signs, from y⁰ to y¹⁴."""

RAMP_SERIES = (12.0 * np.finfo(float).eps) ** (1.0 / 3.0)
"""Decay x over a step below which the effect of a changing force is the first term of its series, x/6. There the next term,
x²/12, is as large as the rounding of the full expression, ε/x; both are 2e-11."""


@inlined
def decay_and_mean(x: float) -> tuple[float, float]:
    """Return exp(-x) and (1 - exp(-x)) / x for x ≥ 0, both to 1e-15 of one, zero included.

    It is written out so that it runs in vector registers, which a call of the library's exp prevents, and gives the same bits
    on every machine. The series is exact to rounding up to y = 5/8; its terms are added in pairs (Estrin 1960), whose sums need
    not wait for each other. Doubling y six times uses
    ``(1 - exp(-2y)) / 2y = (1 - exp(-y)) / y · (1 + exp(-y)) / 2``, whose factors are positive, so that errors do not grow.
    """
    within = min(x, 40.0)  # exp(-40) is below the rounding of one
    half = within * 0.0078125
    y = 2.0 * half
    y2 = y * y
    y4 = y2 * y2
    low = TAYLOR[0] - y * TAYLOR[1] + y2 * (TAYLOR[2] - y * TAYLOR[3])
    low += y4 * (TAYLOR[4] - y * TAYLOR[5] + y2 * (TAYLOR[6] - y * TAYLOR[7]))
    high = TAYLOR[8] - y * TAYLOR[9] + y2 * (TAYLOR[10] - y * TAYLOR[11])
    high += y4 * (TAYLOR[12] - y * TAYLOR[13] + y2 * TAYLOR[14])
    mean = low + y4 * y4 * high
    for _ in range(6):
        mean *= 1.0 - half * mean
        half += half
    return max(1.0 - within * mean, 0.0), (mean if x <= 40.0 else 1.0 / x)


@inlined
def stribeck_coefficient(speed_squared: float, law: ContactLaw) -> float:
    """Friction coefficient of steady sliding, ``mud + (mus - mud) exp(-|v|²/x0²)`` (Eq. 10–12 divided by fn)."""
    share, _ = decay_and_mean(speed_squared / (law.x0 * law.x0))
    return law.mud + (law.mus - law.mud) * share


@inlined
def bristle_step(speed_squared: float, normal_force: float, dt: float, law: ContactLaw) -> tuple[float, float]:
    """Solve Eq. 9 over `dt` at constant velocity; :func:`next_deflection` takes the solution.

    Returns
    -------
    keep : float
    gain : float, seconds
    """
    g = normal_force * stribeck_coefficient(speed_squared, law)
    held = g > 0.0  # without friction nothing holds the bristles
    keep, mean = decay_and_mean(law.sigma0 * dt * math.sqrt(speed_squared) / g if held else 0.0)
    return (keep if held else 0.0), (mean * dt if held else 0.0)


@inlined
def ramped_bristle_step(
    speed_squared: float, force_before: float, force_after: float, dt: float, law: ContactLaw
) -> tuple[float, float]:
    """Return :func:`bristle_step` for a normal force that changes evenly over the step.

    Bristles decay as under the mean force, towards a steady deflection that changes as the force does (first-order hold), so
    that after a long slide they have the deflection that belongs to the force at the end.
    """
    mean_force = 0.5 * (force_before + force_after)
    decay = sliding_decay(speed_squared, mean_force, law) * dt
    held = decay >= 0.0
    keep, mean = decay_and_mean(max(decay, 0.0))
    change = (force_after - mean_force) / mean_force if mean_force > 0.0 else 0.0
    lag = (1.0 + keep - 2.0 * mean) / decay if decay > RAMP_SERIES else decay / 6.0
    return (keep if held else 0.0), (dt * (mean + change * lag) if held else 0.0)


@inlined
def next_deflection(keep: float, deflection: float, gain: float, velocity: float) -> float:
    """One component of the bristle deflection after a step (m), given that before it (m) and the tangential velocity (m/s)."""
    return keep * deflection + gain * velocity


@inlined
def turned_into_plane(deflection: tuple[float, float, float], normal: tuple[float, float, float]) -> tuple[float, float, float]:
    """Turn a bristle deflection (m) into the plane with the given unit normal; its length stays."""
    (zx, zy, zz), (nx, ny, nz) = deflection, normal
    out_of_plane = zx * nx + zy * ny + zz * nz
    length = zx * zx + zy * zy + zz * zz
    flat_x, flat_y, flat_z = zx - out_of_plane * nx, zy - out_of_plane * ny, zz - out_of_plane * nz
    flat = flat_x * flat_x + flat_y * flat_y + flat_z * flat_z
    scale = math.sqrt(length / flat) if flat > 0.0 and out_of_plane != 0.0 else 1.0
    return scale * flat_x, scale * flat_y, scale * flat_z


@inlined
def max_bristle_deflection(normal_force: float, law: ContactLaw) -> float:
    """Largest bristle deflection that static friction holds, metres."""
    return max(normal_force, 0.0) * (law.mus / law.sigma0)


@inlined
def deflection_scale(square: float, limit: float) -> float:
    """Factor that shortens a deflection whose length squared is `square` (m²) to `limit` (m), where it is longer."""
    return limit / math.sqrt(square) if square > limit * limit else 1.0


@inlined
def sliding_decay(speed_squared: float, normal_force: float, law: ContactLaw) -> float:
    """Rate at which sliding lets bristles go, ``sigma0 |v| / g`` in Eq. 9, 1/s; -1 where nothing holds them."""
    g = normal_force * stribeck_coefficient(speed_squared, law)
    held = g > 0.0
    return law.sigma0 * math.sqrt(speed_squared) / (g if held else 1.0) if held else -1.0


@inlined
def rate_under_decay(z: float, velocity: float, decay: float) -> float:
    """One component of Eq. 9, m/s, given :func:`sliding_decay`, which all three have in common."""
    return velocity - decay * z if decay >= 0.0 else 0.0


@inlined
def bristle_rate(z: float, velocity: float, speed_squared: float, normal_force: float, law: ContactLaw) -> float:
    """One component of Eq. 9, m/s."""
    return rate_under_decay(z, velocity, sliding_decay(speed_squared, normal_force, law))


@inlined
def friction_force(z: float, bristle_rate: float, velocity: float, law: ContactLaw) -> float:
    """One component of Eq. 13, N."""
    return law.sigma0 * z + law.sigma1 * bristle_rate + law.ct * velocity


@inlined
def friction_tangent(keep: float, gain: float, held: float, dt: float, law: ContactLaw) -> tuple[float, float]:
    """Eq. 13 at a step's end as a function of the velocity: ``ft = bias · z + slope · v``, z being the deflection before.

    Parameters
    ----------
    keep, gain : float
        Of :func:`bristle_step`, limited to what static friction holds.
    held : float
        Factor by which the deflection had to be shortened before the step.
    dt : float, seconds
    law : ContactLaw

    Returns
    -------
    bias : float, N/m
    slope : float, N·s/m
    """
    bias = law.sigma0 * keep + law.sigma1 / dt * (keep - held)
    return bias, (law.sigma0 + law.sigma1 / dt) * gain + law.ct


@kernel
def friction_along_path(
    time: np.ndarray, velocity: np.ndarray, normal_force: float, law: ContactLaw, force: np.ndarray
) -> None:
    """Friction of one contact point along a straight path, from rest, under a constant normal force (Eq. 9, 13).

    Parameters
    ----------
    time : (m,) float, seconds, increasing
    velocity : (m,) float, m/s
        Between two samples the mean of both counts, for which Eq. 9 is solved exactly.
    normal_force : float, N
    law : ContactLaw
    force : (m,) float, N
        Written.
    """
    z = 0.0
    for i in range(len(time)):
        if i > 0:
            v = 0.5 * (velocity[i - 1] + velocity[i])
            keep, gain = bristle_step(v * v, normal_force, time[i] - time[i - 1], law)
            z = next_deflection(keep, z, gain, v)
        v = velocity[i]
        force[i] = friction_force(z, bristle_rate(z, v, v * v, normal_force, law), v, law)


def stribeck_force(normal_force: np.ndarray, speed: np.ndarray, parameters: SensorParameters) -> np.ndarray:
    """Return the friction of steady sliding without its viscous part, ``g`` of Eq. 10, N.

    Parameters
    ----------
    normal_force : (...) float, N
    speed : (...) float, m/s
    parameters : SensorParameters
    """
    coefficient = np.array(np.ravel(speed), dtype=float)
    _replace_by_stribeck_coefficient(coefficient, contact_law(parameters))
    return normal_force * coefficient.reshape(np.shape(speed))


@kernel
def _replace_by_stribeck_coefficient(speed: np.ndarray, law: ContactLaw) -> None:
    """Replace each speed (m/s) of an array by the coefficient of steady sliding."""
    for i in range(len(speed)):
        speed[i] = stribeck_coefficient(speed[i] * speed[i], law)
