# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading comes late. It starts where it would have come to rest."""

from __future__ import annotations

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, scalar
from .creep import shares_of_a_step


def first_order(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``τ q̇ = x − q``, x linear over the step. Memory: started, the last x, q. Constants: shares of q, old x, new x."""
    before, q = force, force
    if memory[point, at] != 0.0:
        before, q = memory[point, at + 1], memory[point, at + 2]
    q = numbers[row, 0] * q + numbers[row, 1] * before + numbers[row, 2] * force
    if commit:
        memory[point, at], memory[point, at + 1], memory[point, at + 2] = 1.0, force, q
    return q, slope * numbers[row, 2]


def second_order(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """Two equal lags in turn, p and q. Memory: started, the last x, p, q. Constants: as above for p, then for q by p, x, x."""
    before, p, q = force, force, force
    if memory[point, at] != 0.0:
        before, p, q = memory[point, at + 1], memory[point, at + 2], memory[point, at + 3]
    q = numbers[row, 0] * q + numbers[row, 3] * p + numbers[row, 4] * before + numbers[row, 5] * force
    p = numbers[row, 0] * p + numbers[row, 1] * before + numbers[row, 2] * force
    if commit:
        memory[point, at], memory[point, at + 1], memory[point, at + 2], memory[point, at + 3] = 1.0, force, p, q
    return q, slope * numbers[row, 5]


def _first(values: Values, dt: np.ndarray) -> np.ndarray:
    return np.stack(shares_of_a_step(np.asarray(dt, float) / max(scalar(values, "time"), 1e-12)), axis=1)


def _second(values: Values, dt: np.ndarray) -> np.ndarray:
    first = _first(values, dt)
    x = np.asarray(dt, float) / max(scalar(values, "time"), 1e-12)
    keep = first[:, 0]
    turn = np.where(np.isfinite(keep * x), keep * x, 0.0)
    # Answers at the step's end to an input of 1, and to one that grows from 0 to 1; their series where digits would be lost.
    small = x < 1e-2
    whole = np.where(small, x * x / 2.0 - x**3 / 3.0 + x**4 / 8.0, 1.0 - keep - turn)
    exact = (x - 2.0 + 2.0 * keep + turn) / np.maximum(x, 1e-300)
    new = np.where(small, x * x / 6.0 - x**3 / 12.0 + x**4 / 40.0, exact)
    return np.column_stack([first, turn, whole - new, new])


_TIME = Parameter("time", "s", 0.05, 0.0, 100.0, "Time constant τ.")

KIND = Kind(
    name="lag",
    title="Lag",
    text="Answers late to a change.",
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
            memory=3,
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
            memory=4,
            after_conversion=True,
        ),
    ),
)
