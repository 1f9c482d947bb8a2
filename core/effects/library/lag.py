# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading comes late. At the first sample it is in equilibrium."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyval

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TexelInput, scalar
from .creep import step_weights


def first_order(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``τ q̇ = x − q``, x linear over the step.

    State: 1 once started, the last x, q. Constants: the weights of q, the old x and the new x in the new q.
    """
    before, q = texel.force, texel.force
    if state[0] != 0.0:
        before, q = state[1], state[2]
    q = constants[0] * q + constants[1] * before + constants[2] * texel.force
    if commit:
        state[0], state[1], state[2] = 1.0, texel.force, q
    return q, texel.slope * constants[2]


def second_order(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """A damped oscillator: place q, and speed v in units of 1/τ; x is linear over the step, for which this is exact.

    State: 1 once started, the last x, q, v. Constants: the weights of q, v, the old x and the new x in the new q, then in the
    new v.
    """
    before, q, v = texel.force, texel.force, 0.0
    if state[0] != 0.0:
        before, q, v = state[1], state[2], state[3]
    place = constants[0] * q + constants[1] * v + constants[2] * before + constants[3] * texel.force
    if commit:
        speed = constants[4] * q + constants[5] * v + constants[6] * before + constants[7] * texel.force
        state[0], state[1], state[2], state[3] = 1.0, texel.force, place, speed
    return place, texel.slope * constants[3]


def _first(values: Values, dt: np.ndarray) -> np.ndarray:
    return np.stack(step_weights(np.asarray(dt, float) / max(scalar(values, "time"), 1e-12)), axis=1)


def _second_order(time: float, damping: float, dt: np.ndarray) -> np.ndarray:
    """Return the constants of :func:`second_order` for ``τ² q̈ + 2 ζ τ q̇ + q = x``."""
    x = np.minimum(np.asarray(dt, float) / max(time, 1e-300), 1e300)
    # Roots -ζ ± s, real or conjugate; where they are equal, a difference of 2e-8 stands for none.
    split = np.sqrt(complex(damping**2 - 1.0)) or 1e-8
    slow = np.exp((split - damping) * x)
    sine = (slow * -np.expm1(-2.0 * split * x) / (2.0 * split)).real
    cosine = (slow * (1.0 + np.exp(-2.0 * split * x)) / 2.0).real
    # Responses of place and speed to an x of 1; and, over the step, to one that grows from 0 to 1. Small steps have series in
    # powers of the step, whose coefficients follow from the equation, because the formulas would cancel.
    kept = cosine + damping * sine
    seam = 0.1 / max(1.0, 2.0 * damping)
    small, near, size = x < seam, np.minimum(x, seam), np.maximum(x, 1e-300)
    powers = [0.0, 0.0, 0.5]
    for n in range(1, 8):
        powers.append(-(2.0 * damping * (n + 1) * powers[n + 1] + powers[n]) / ((n + 1) * (n + 2)))
    whole = np.where(small, polyval(near, powers), 1.0 - kept)
    place = polyval(near, [c / (n + 1) for n, c in enumerate(powers)])
    place = np.where(small, place, 1.0 - (2.0 * damping * whole + sine) / size)
    speed = whole / size
    return np.column_stack([kept, sine, whole - place, place, -sine, cosine - damping * sine, sine - speed, speed])


def _dead_time(values: Values) -> float:
    return scalar(values, "time") * scalar(values, "dead_share")


def _behind_dead_time(values: Values, dt: np.ndarray) -> np.ndarray:
    quality = max(scalar(values, "quality"), 1e-4)  # no division by zero; it is a first order to rounding
    return _second_order((scalar(values, "time") - _dead_time(values)) * quality, 0.5 / quality, dt)


_TIME = Parameter("time", "s", 0.05, 0.0, 100.0, "Time constant τ.", neutral=0.0)


_SECOND = np.linspace(0, 1, 501)


KIND = Kind(
    name="lag",
    title="Lag",
    text="The reading follows a change late.",
    site="readout",
    order=60,
    forms=(
        Form(
            "first-order",
            "τ ṙ = r₀ − r",
            "Doebelin, Measurement Systems (2003), section 3.3: first-order instrument",
            (_TIME,),
            law=first_order,
            constants=_first,
            state_size=3,
            after_conversion=True,
        ),
        Form(
            "dead-time",
            "r(t) = r₀(t − T)",
            "Doebelin, Measurement Systems (2003), section 3.3: dead-time element",
            (Parameter("time", "s", 0.05, 0.0, 10.0, "Dead time T.", neutral=0.0),),
            delay=lambda values: scalar(values, "time"),
            after_conversion=True,
        ),
        Form(
            "second-order",
            "τ² r̈ + 2 τ ṙ + r = r₀",
            "Doebelin, Measurement Systems (2003), section 3.3: second-order instrument, critically damped",
            (_TIME,),
            law=second_order,
            constants=lambda values, dt: _second_order(scalar(values, "time"), 1.0, dt),
            state_size=4,
            after_conversion=True,
        ),
        Form(
            "resonance",
            "r̈ + 2 ζ ω ṙ + ω² r = ω² r₀, ω = 2π / T",
            "Doebelin, Measurement Systems (2003), section 3.3: second-order instrument, underdamped",
            (
                Parameter("period", "s", 0.05, 1e-6, 100.0, "Period T of the undamped oscillation.", log=True, neutral=0.0),
                Parameter("damping", "1", 0.2, 1e-3, 0.95, "Damping ratio ζ.", log=True),
            ),
            law=second_order,
            constants=lambda values, dt: _second_order(scalar(values, "period") / (2.0 * np.pi), scalar(values, "damping"), dt),
            state_size=4,
            after_conversion=True,
            error=0.005,  # it follows what rings longer than the next form can (damping below 0.1)
        ),
        Form(
            "second-order-plus-dead-time",
            "τ² r̈ + τ ṙ / Q + r = r₀(t − s D), τ = (1 − s) D Q",
            "Seborg, Edgar and Mellichamp, Process Dynamics and Control (2004), section 7.2: second order plus time delay",
            (
                Parameter("time", "s", 0.05, 0.0, 100.0, "Mean delay D: by so much a slow change comes late.", neutral=0.0),
                Parameter("quality", "1", 0.5, 0.0, 5.0, "Quality factor Q: 0 is a first order, up to 0.5 nothing oscillates."),
                Parameter("dead_share", "1", 0.2, 0.0, 1.0, "Share s of the dead time in the mean delay.", neutral=0.0),
            ),
            law=second_order,
            constants=_behind_dead_time,
            delay=_dead_time,
            state_size=4,
            after_conversion=True,
            error=0.005,  # at most, of the other forms, filters behind a dead time and moving means (benchmarks/RESULTS.md)
        ),
    ),
    experiment="press and release as fast as possible, and record at a high rate",
    drawing=Drawing(time=_SECOND, depth=0.002 * np.interp(_SECOND, [0.1, 0.12, 0.6, 0.62], [0, 1, 1, 0])),
    known_from=("timing",),
    families=("late",),
)
