# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading changes with time, whatever the load. Time counts from the start of the recording, or from the first frame."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.random_streams import random_walk
from ..engine.specification import EXACT_FORM_ERROR, Drawing, Form, Kind, TransducerArray, scalar

MINUTE = 60.0
"""Seconds after which the amounts of the forms "shifted-power" and "listed" hold."""


def linear(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Change at a constant rate."""
    return signal + scalar(values, "rate") * time[:, None]


def warm_up(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Approach a final value exponentially."""
    return signal - scalar(values, "amount") * np.expm1(-time[:, None] / scalar(values, "time"))


def shifted_power(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Change by a power of the time that is counted from an earlier moment; with an exponent of zero by its logarithm."""
    from scipy.special import boxcox1p

    exponent, shift = scalar(values, "exponent"), scalar(values, "time")
    share = boxcox1p(np.maximum(time, 0.0) / shift, exponent) / boxcox1p(MINUTE / shift, exponent)
    return signal + scalar(values, "amount") * share[:, None]


def sensitivity(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Approach a final sensitivity exponentially."""
    return signal * (1.0 - scalar(values, "amount") * np.expm1(-time[:, None] / scalar(values, "time")))


def walk(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Perform a random walk, independently in each texel."""
    spread = scalar(values, "spread")
    return signal + spread * random_walk("drift", seed, time, signal.shape[1]) if spread else signal


def listed(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Change in each texel by an amount of its own, with a common power of the time."""
    share = (np.maximum(time, 0.0) / MINUTE) ** scalar(values, "exponent")
    return signal + share[:, None] * np.asarray(values["amount"])


_OWN_AMOUNT = Parameter(
    "amount", "unit", 0.0, -1e5, 1e5, "Change a of the reading of each texel after 60 s.", per_texel=True, neutral=0.0
)

KIND = Kind(
    name="drift",
    title="Drift",
    text="The reading changes slowly by itself.",
    site="readout",
    order=64,
    forms=(
        Form(
            "linear",
            "r = r₀ + b t",
            "ISO/IEC Guide 99 (2007), 4.21: instrumental drift",
            (Parameter("rate", "unit/s", 1e-3, -1e3, 1e3, "Change b of the reading per second.", neutral=0.0),),
            memoryless=linear,
            after_conversion=True,
        ),
        Form(
            "warm-up",
            "r = r₀ + a · (1 − exp(−t/τ))",
            "Doebelin, Measurement Systems (2003): warm-up of an instrument",
            (
                Parameter("amount", "unit", 0.05, -1e4, 1e4, "Change a of the reading when warm.", neutral=0.0),
                Parameter("time", "s", 30.0, 0.1, 1e5, "Time constant τ of the change.", log=True),
            ),
            memoryless=warm_up,
            after_conversion=True,
        ),
        Form(
            "listed",
            "rᵢ = r₀ᵢ + aᵢ · (t / 60 s)ⁿ",
            "ISO/IEC Guide 99 (2007), 4.21: instrumental drift; a power of the time as in Findley et al., Creep and Relaxation "
            "of Nonlinear Viscoelastic Materials (1976)",
            (
                _OWN_AMOUNT,
                Parameter("exponent", "1", 1.0, 0.1, 3.0, "Exponent n of the time; 1 is a constant rate.", log=True),
            ),
            memoryless=listed,
            after_conversion=True,
            is_apart=True,
            error=0.01,  # of linear and warm-up it leaves 0.0094 at most (benchmarks/RESULTS.md)
        ),
        Form(
            "shifted-power",
            "r = r₀ + a · ((1 + t/τ)ⁿ − 1) / ((1 + 60 s/τ)ⁿ − 1)",
            "constructed after Box and Cox, J. R. Stat. Soc. B 26 (1964): the shifted power transformation, here of time; a "
            "straight line, a logarithm and an exponential approach are cases of it, or close to one",
            (
                Parameter("amount", "unit", 0.05, -1e4, 1e4, "Change a of the reading after 60 s.", neutral=0.0),
                Parameter("time", "s", 30.0, 0.1, 1e5, "Time τ before the start from which the power counts.", log=True),
                Parameter("exponent", "1", 0.5, -10.0, 3.0, "Exponent n: 1 is a constant rate, below 0 a final value exists."),
            ),
            memoryless=shifted_power,
            after_conversion=True,
            error=EXACT_FORM_ERROR,  # of linear and warm-up it leaves 0.0002 at most
        ),
        Form(
            "sensitivity",
            "r = f · (1 + a · (1 − exp(−t/τ)))",
            "Doebelin, Measurement Systems (2003), section 3.2: sensitivity drift",
            (
                Parameter("amount", "1", 0.2, -0.9, 5.0, "Final change a of the sensitivity, as a share.", neutral=0.0),
                Parameter("time", "s", 30.0, 0.1, 1e5, "Time constant τ of the change.", log=True),
            ),
            memoryless=sensitivity,
            needs="no clock",  # on the clock of a session a gain that changes by itself is a warm-up
            is_apart=True,
        ),
        Form(
            "random-walk",
            "r = r₀ + s · W(t),  W Brownian motion",
            "IEEE Std 952 (1997), annex C: random walk; constructed after Lévy (1948)",
            (Parameter("spread", "unit/√s", 0.005, 0.0, 1e3, "Standard deviation s after one second.", neutral=0.0),),
            memoryless=walk,
            after_conversion=True,
            random=True,
        ),
    ),
    experiment="record an hour without touching the sensor",
    drawing=Drawing(
        time=np.linspace(0, 120, 601), depth=np.zeros(601), values={"linear": {"rate": 4e-4}, "random-walk": {"spread": 0.004}}
    ),
    known_from=("timing", "rest"),
)
