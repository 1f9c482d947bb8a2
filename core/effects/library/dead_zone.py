# SPDX-License-Identifier: GPL-3.0-or-later
"""Light touches are not felt."""

from __future__ import annotations

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, TransducerArray, scalar


def hard(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """The threshold is taken off."""
    return np.sign(x) * np.maximum(np.abs(x) - scalar(values, "threshold"), 0.0)


def soft(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Little by little: quadratic at first, and the threshold is taken off in the end."""
    size = np.abs(x)
    return x * size / np.maximum(size + scalar(values, "threshold"), 1e-300)


def step(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Nothing below the threshold, everything above it."""
    return np.where(np.abs(x) > scalar(values, "threshold"), x, 0.0)


_THRESHOLD = Parameter("threshold", "N", 0.01, 0.0, 100.0, "Force T that is just not felt yet.")

KIND = Kind(
    name="dead-zone",
    title="Dead Zone",
    text="Does not feel loads below a threshold.",
    site="readout",
    order=35,
    forms=(
        Form(
            "hard",
            "r = max(f − T, 0)",
            "Tao and Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996), section 2.1",
            (_THRESHOLD,),
            neutral={"threshold": 0.0},
            memoryless=hard,
        ),
        Form(
            "soft",
            "r = f² / (f + T)",
            "Weiss and Wörn, IEEE ICMA (2005): contact resistance R ∝ 1/f in series with a fixed one",
            (_THRESHOLD,),
            neutral={"threshold": 0.0},
            memoryless=soft,
        ),
        Form(
            "step",
            "r = f where f > T, else 0",
            "ISO/IEC Guide 99 (2007), 4.16: discrimination threshold",
            (_THRESHOLD,),
            neutral={"threshold": 0.0},
            memoryless=step,
        ),
    ),
)
