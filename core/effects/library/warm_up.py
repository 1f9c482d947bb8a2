# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensitivity changes after power-on until the sensor is warm. A reading without load does not move (see :mod:`.drift`)."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar


def exponential(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Approach the gain of the warm sensor exponentially."""
    return signal * (1.0 - scalar(values, "amount") * np.expm1(-_since(time, values) / scalar(values, "time")))


def rational(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Approach the gain of the warm sensor by a rational law, which goes on for longer."""
    since = _since(time, values)
    return signal * (1.0 + scalar(values, "amount") * since / (since + scalar(values, "time")))


def _since(time: np.ndarray, values: Values) -> np.ndarray:
    """Time since power-on, (t, 1) s; never negative."""
    return np.asarray(np.maximum(time + scalar(values, "since"), 0.0)[:, None])


_AMOUNT = Parameter("amount", "1", 0.2, -0.9, 5.0, "Final change a of the sensitivity, as a share.", neutral=0.0)
_SINCE = Parameter("since", "s", 0.0, 0.0, 1e6, "Time t₀ from power-on to the first frame or recording.", neutral=0.0)

KIND = Kind(
    name="warm-up",
    title="Warm-Up",
    text="The sensitivity changes after power-on until the sensor is warm.",
    site="readout",
    order=48,
    forms=(
        Form(
            "exponential",
            "r = f · (1 + a · (1 − exp(−(t + t₀)/τ)))",
            "Doebelin, Measurement Systems (2003), section 3.2: sensitivity drift",
            (_AMOUNT, Parameter("time", "s", 300.0, 0.1, 1e5, "Time constant τ of the change.", log=True), _SINCE),
            memoryless=exponential,
        ),
        Form(
            "rational",
            "r = f · (1 + a · (t + t₀) / (t + t₀ + τ))",
            "Doebelin, Measurement Systems (2003), section 3.2: sensitivity drift, here with a slow end",
            (_AMOUNT, Parameter("time", "s", 300.0, 0.1, 1e5, "Time τ of half the change.", log=True), _SINCE),
            memoryless=rational,
        ),
    ),
    experiment="after an hour switched off, repeat one press every minute until it reads the same",
    drawing=Drawing(time=np.linspace(0, 900, 601), depth=np.full(601, 1e-3)),
    needs="clock",
    known_parameters=("since",),  # the clock of a session begins with its first recording
)
