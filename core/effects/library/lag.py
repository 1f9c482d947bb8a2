# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading comes late. At the first sample it is in equilibrium."""

from __future__ import annotations

import numpy as np

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
    """Two equal lags in series, p and q.

    State: 1 once started, the last x, p, q. Constants: as for the first order, for p; then the weights of p, the old x and the
    new x in the new q.
    """
    before, p, q = texel.force, texel.force, texel.force
    if state[0] != 0.0:
        before, p, q = state[1], state[2], state[3]
    q = constants[0] * q + constants[3] * p + constants[4] * before + constants[5] * texel.force
    p = constants[0] * p + constants[1] * before + constants[2] * texel.force
    if commit:
        state[0], state[1], state[2], state[3] = 1.0, texel.force, p, q
    return q, texel.slope * constants[5]


def resonance(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """An oscillator: place q, and speed v as a share of ω; x is linear over the step, for which this is exact.

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


def _second(values: Values, dt: np.ndarray) -> np.ndarray:
    first = _first(values, dt)
    x = np.asarray(dt, float) / max(scalar(values, "time"), 1e-12)
    keep = first[:, 0]
    turn = np.where(np.isfinite(keep * x), keep * x, 0.0)
    # Responses at the end of the step to an input of 1, and to one that grows from 0 to 1; series avoid cancellation.
    small = x < 1e-2
    whole = np.where(small, x * x / 2.0 - x**3 / 3.0 + x**4 / 8.0, 1.0 - keep - turn)
    exact = (x - 2.0 + 2.0 * keep + turn) / np.maximum(x, 1e-300)
    new = np.where(small, x * x / 6.0 - x**3 / 12.0 + x**4 / 40.0, exact)
    return np.column_stack([first, turn, whole - new, new])


def _resonance(values: Values, dt: np.ndarray) -> np.ndarray:
    damping = scalar(values, "damping")
    x = np.minimum(2.0 * np.pi * np.asarray(dt, float) / max(scalar(values, "period"), 1e-300), 1e300)  # phase, undamped
    sharp = np.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * x)
    cosine, sine = decay * np.cos(sharp * x), decay * np.sin(sharp * x) / sharp
    # Responses of place and speed to an x of 1; and, over the step, to one that grows from 0 to 1 (series avoid cancellation).
    kept = cosine + damping * sine
    small, near, late = x < 1e-2, np.minimum(x, 1e-2), 4.0 * damping**2 - 1.0
    place = near * near / 6.0 - damping * near**3 / 12.0 + late * near**4 / 120.0
    speed = near / 2.0 - damping * near * near / 3.0 + late * near**3 / 24.0
    size = np.maximum(x, 1e-300)
    place = np.where(small, place, 1.0 - (2.0 * damping * (1.0 - kept) + sine) / size)
    speed = np.where(small, speed, (1.0 - kept) / size)
    return np.column_stack([kept, sine, 1.0 - kept - place, place, -sine, cosine - damping * sine, sine - speed, speed])


_TIME = Parameter("time", "s", 0.05, 0.0, 100.0, "Time constant τ.")


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
            neutral={"time": 0.0},
            law=first_order,
            constants=_first,
            state_size=3,
            after_conversion=True,
        ),
        Form(
            "dead-time",
            "r(t) = r₀(t − T)",
            "Doebelin, Measurement Systems (2003), section 3.3: dead-time element",
            (Parameter("time", "s", 0.05, 0.0, 10.0, "Dead time T."),),
            neutral={"time": 0.0},
            delay=lambda values: scalar(values, "time"),
            after_conversion=True,
        ),
        Form(
            "second-order",
            "τ² r̈ + 2 τ ṙ + r = r₀",
            "Doebelin, Measurement Systems (2003), section 3.3: second-order instrument, critically damped",
            (_TIME,),
            neutral={"time": 0.0},
            law=second_order,
            constants=_second,
            state_size=4,
            after_conversion=True,
        ),
        Form(
            "resonance",
            "r̈ + 2 ζ ω ṙ + ω² r = ω² r₀, ω = 2π / T",
            "Doebelin, Measurement Systems (2003), section 3.3: second-order instrument, underdamped",
            (
                Parameter("period", "s", 0.05, 1e-6, 100.0, "Period T of the undamped oscillation.", log=True),
                Parameter("damping", "1", 0.2, 1e-3, 0.95, "Damping ratio ζ.", log=True),
            ),
            neutral={"period": 0.0},
            law=resonance,
            constants=_resonance,
            state_size=4,
            after_conversion=True,
        ),
    ),
    experiment="press and release as fast as possible, and record at a high rate",
    drawing=Drawing(time=_SECOND, depth=0.002 * np.interp(_SECOND, [0.1, 0.12, 0.6, 0.62], [0, 1, 1, 0])),
    known_from=("timing",),
    families=("late",),
)
