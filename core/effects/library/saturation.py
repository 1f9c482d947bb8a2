# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading cannot grow without end: a converter's last count, a transducer that flattens."""

from __future__ import annotations

import math

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, TransducerArray, scalar

_LEVEL = Parameter("level", "unit", 1.0, 1e-4, 1e5, "Largest change of the reading from the one without load.", log=True)


def clip(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Cut off at the level."""
    level = scalar(values, "level")
    return transducers.zero + np.clip(x - transducers.zero, -level, level)


def tanh(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Flatten as the hyperbolic tangent does."""
    level = scalar(values, "level")
    if math.isinf(level):
        return x
    return transducers.zero + level * np.tanh((x - transducers.zero) / level)


def rational(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Flatten as a voltage divider does."""
    change = x - transducers.zero
    return transducers.zero + change / (1.0 + np.abs(change) / scalar(values, "level"))


KIND = Kind(
    name="saturation",
    title="Saturation",
    text="The reading stops growing at a highest level.",
    site="readout",
    order=70,
    forms=(
        Form(
            "clip",
            "r = min(r₀, L)",
            "IEEE Std 1241 (2010), section 3: full scale of a converter",
            (_LEVEL,),
            neutral={"level": math.inf},
            memoryless=clip,
            after_conversion=True,
        ),
        Form(
            "tanh",
            "r = L · tanh(r₀ / L)",
            "Dahiya and Valle, Robotic Tactile Sensing (2013)",
            (_LEVEL,),
            neutral={"level": math.inf},
            memoryless=tanh,
            after_conversion=True,
        ),
        Form(
            "rational",
            "r = r₀ / (1 + |r₀| / L)",
            "Flórez and Velásquez, IEEE ANDESCON (2010): force-sensing resistor in a voltage divider",
            (_LEVEL,),
            neutral={"level": math.inf},
            memoryless=rational,
            after_conversion=True,
        ),
    ),
)
