# SPDX-License-Identifier: GPL-3.0-or-later
"""Slow settling: under constant depth the force relaxes, or under constant load the reading rises.

All forms are sums of exponentials ``G(t) = 1 ∓ Σ a_i (1 − exp(−t/τ_i))``. For the logarithmic and the power law the τ_i are
spread evenly over the logarithm of time, so few states suffice and the cost does not grow with the length of the past.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Form, Kind, TexelInput, scalar

LOG_RATES = np.arange(-13.75, 2.76, 1.25)
"""Logarithms of the rates that represent a continuous spectrum. A step of 1.25 keeps the sum within 0.1 % of the formula."""
TERMS = len(LOG_RATES)


def settling(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """Add ``Σ a_i q_i`` with ``τ_i q̇_i = f − q_i``; `f` is taken as linear over the step, for which this is exact.

    State: the force at the end of the last step, then the q_i. Constants: how many exponentials, then for each of them the
    weights of the old q, the old force and the new force in the new q, and a_i.
    """
    count, before, force = int(constants[0]), state[0], texel.force
    total, rise = force, 1.0
    for i in range(count):
        j = 1 + 4 * i
        q = constants[j] * state[1 + i] + constants[j + 1] * before + constants[j + 2] * force
        total += constants[j + 3] * q
        rise += constants[j + 3] * constants[j + 2]
        if commit:
            state[1 + i] = q
    if commit:
        state[0] = force
    return total, texel.slope * rise


def filter_constants(amplitudes: np.ndarray, times: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """Return the constants of :func:`settling`, (m, 1 + 4 c), for steps `dt` (m,) and c exponentials."""
    x = np.asarray(dt, float)[:, None] / times
    table = np.stack([*step_weights(x), np.broadcast_to(amplitudes, x.shape)], axis=-1)
    return np.hstack([np.full((len(x), 1), float(len(times))), table.reshape(len(x), -1)])


def step_weights(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the weights of the old q, the old f and the new f in the new q, for ``τ q̇ = f − q`` with f linear over the step.

    `x` (m,) is the length of the step divided by τ.
    """
    risen = -np.expm1(-x)
    new = np.where(x > 1e-4, 1.0 - risen / np.maximum(x, 1e-300), 0.5 * x - x * x / 6.0)  # the series avoids cancellation
    return np.exp(-x), risen - new, new


def _constants(
    spectrum: Callable[[Values], tuple[np.ndarray, np.ndarray]], sign: float
) -> Callable[[Values, np.ndarray], np.ndarray]:
    def constants(values: Values, dt: np.ndarray) -> np.ndarray:
        amplitudes, times = spectrum(values)
        return filter_constants(sign * amplitudes, times, dt)

    return constants


def prony(values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Return amplitudes and times of one or two exponentials."""
    pairs = [("amount", "time"), ("amount_2", "time_2")]
    found = [(values[a], values[t]) for a, t in pairs if a in values]
    amplitudes, times = np.array(found, dtype=float).T
    if len(amplitudes) > 1:  # together they take at most 95 % of the force
        amplitudes = amplitudes / max(1.0, float(amplitudes.sum()) / 0.95)
    return amplitudes, times


def logarithmic(values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Return exponentials whose sum is ``a · log10(1 + t/τ)`` up to 100,000 τ, at even steps of the logarithm of time."""
    # 1 - exp(-x s) weighted with exp(-x) dx / x integrates to ln(1 + s).
    rates = np.exp(LOG_RATES)
    weights = (LOG_RATES[1] - LOG_RATES[0]) * np.exp(-rates) / math.log(10.0)
    return scalar(values, "amount") * weights, scalar(values, "time") / rates


def power(values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Return exponentials whose sum is ``a · (1 − (1 + t/τ)^−p)``: its spectrum is x^(p−1) exp(−x) / Γ(p)."""
    exponent, rates = scalar(values, "exponent"), np.exp(LOG_RATES)
    weights = (LOG_RATES[1] - LOG_RATES[0]) * rates**exponent * np.exp(-rates) / math.gamma(exponent)
    return scalar(values, "amount") * weights, scalar(values, "time") / rates


_TIME = Parameter("time", "s", 2.0, 0.02, 1000.0, "Time constant τ of the settling.", log=True)
_ONSET = Parameter("time", "s", 0.5, 0.01, 100.0, "Time τ of the onset.", log=True)
_AMOUNT = Parameter("amount", "1", 0.2, 0.0, 0.95, "Final loss a, as a share of the force.", neutral=0.0)
_RISE = Parameter("amount", "1", 0.2, -0.9, 5.0, "Final rise a, as a share; negative: fall.", neutral=0.0)
_SECOND = (
    Parameter("amount_2", "1", 0.1, 0.0, 0.95, "Loss a₂ of a second, slower settling.", neutral=0.0),
    Parameter("time_2", "s", 20.0, 0.02, 1000.0, "Time constant τ₂ of the second settling.", log=True),
)
_DECADE = Parameter("amount", "1", 0.05, 0.0, 0.15, "Loss a per decade of time, as a share.", neutral=0.0)
_RISE_DECADE = Parameter("amount", "1", 0.05, 0.0, 1.0, "Rise a per decade of time, as a share.", neutral=0.0)
_EXPONENT = Parameter("exponent", "1", 0.3, 0.05, 1.5, "Exponent p of the power law.")

_VISCOELASTIC = "Fung, Biomechanics (1993), section 7.6: quasi-linear viscoelasticity"
_LOG = "Findley, Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials (1976)"
_POWER = "Nutting (1921); Schapery and Park, Int. J. Solids Struct. 36 (1999): power law by exponentials"


KIND = Kind(
    name="creep",
    title="Creep",
    text="At constant depth the force relaxes, or under constant load the reading rises.",
    site="pad",
    order=30,
    forms=(
        Form(
            "exponential",
            "f(t) = fₑ − a · q,  τ q̇ = fₑ − q",
            _VISCOELASTIC,
            (_AMOUNT, _TIME),
            law=settling,
            constants=_constants(prony, -1.0),
            state_size=2,
        ),
        Form(
            "two-exponentials",
            "f(t) = fₑ − a₁ q₁ − a₂ q₂,  τᵢ q̇ᵢ = fₑ − qᵢ",
            _VISCOELASTIC,
            (_AMOUNT, _TIME, *_SECOND),
            law=settling,
            constants=_constants(prony, -1.0),
            state_size=3,
            error=0.005,  # of the other forms that relax it leaves 0.0034 at most
        ),
        Form(
            "logarithmic",
            "step response 1 − a · log₁₀(1 + t/τ)",
            _LOG,
            (_DECADE, _ONSET),
            law=settling,
            constants=_constants(logarithmic, -1.0),
            state_size=1 + TERMS,
        ),
        Form(
            "power",
            "step response 1 − a · (1 − (1 + t/τ)⁻ᵖ)",
            _POWER,
            (_AMOUNT, _ONSET, _EXPONENT),
            law=settling,
            constants=_constants(power, -1.0),
            state_size=1 + TERMS,
        ),
        Form(
            "rising-exponential",
            "r(t) = f + a · q,  τ q̇ = f − q",
            _VISCOELASTIC,
            (_RISE, _TIME),
            law=settling,
            constants=_constants(prony, 1.0),
            state_size=2,
            site="readout",
            fitted_up_to={"amount": 1.0},  # a reading that rises fivefold is a lag
        ),
        Form(
            "rising-logarithmic",
            "step response 1 + a · log₁₀(1 + t/τ)",
            _LOG,
            (_RISE_DECADE, _ONSET),
            law=settling,
            constants=_constants(logarithmic, 1.0),
            state_size=1 + TERMS,
            site="readout",
            fitted_up_to={"amount": 0.3},
        ),
    ),
    experiment="hold one depth for at least a minute, then release and wait as long",
    known_from=("timing",),
    families=("late",),
)
