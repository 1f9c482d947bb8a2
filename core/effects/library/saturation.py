# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading is limited: by the last count of a converter, or by a transducer that flattens."""

from __future__ import annotations

import math

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar, where_loaded

_LEVEL = Parameter(
    "level", "unit", 1.0, 1e-4, 1e5, "Largest reading L, counted from the reading without load.", log=True, neutral=math.inf
)


def clip(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Clip at the level."""
    level = scalar(values, "level")
    return transducers.zero + np.clip(signal - transducers.zero, -level, level)


def tanh(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Flatten like the hyperbolic tangent."""
    level = scalar(values, "level")
    if math.isinf(level):
        return signal
    return transducers.zero + where_loaded(lambda change: level * np.tanh(change / level), signal - transducers.zero)


def rational(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Flatten like a voltage divider."""
    change = signal - transducers.zero
    return transducers.zero + change / (1.0 + np.abs(change) / scalar(values, "level"))


def power(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Flatten softly or sharply; the exponent says how sharply."""
    level, sharpness = scalar(values, "level"), scalar(values, "sharpness")

    def flattened(change: np.ndarray) -> np.ndarray:
        return np.asarray(change / (1.0 + (np.abs(change) / level) ** sharpness) ** (1.0 / sharpness))

    return transducers.zero + where_loaded(flattened, signal - transducers.zero)


KIND = Kind(
    name="saturation",
    title="Saturation",
    text="The reading stops growing at a maximum.",
    site="readout",
    order=70,
    forms=(
        Form(
            "clip",
            "r = min(r₀, L)",
            "IEEE Std 1241 (2010), section 3: full scale of a converter",
            (_LEVEL,),
            memoryless=clip,
            after_conversion=True,
        ),
        Form(
            "tanh",
            "r = L · tanh(r₀ / L)",
            "Dahiya and Valle, Robotic Tactile Sensing (2013)",
            (_LEVEL,),
            memoryless=tanh,
            after_conversion=True,
        ),
        Form(
            "rational",
            "r = r₀ / (1 + |r₀| / L)",
            "Flórez and Velásquez, IEEE ANDESCON (2010): force-sensing resistor in a voltage divider",
            (_LEVEL,),
            memoryless=rational,
            after_conversion=True,
        ),
        Form(
            "power",
            "r = r₀ / (1 + (|r₀| / L)^p)^(1/p)",
            "Rapp, Proc. 2nd European Conf. on Satellite Communications (1991): a limiter from a soft knee to a sharp one",
            (
                _LEVEL,
                Parameter("sharpness", "1", 2.0, 0.7, 20.0, "Exponent p: 1 is a voltage divider, a large one clips.", log=True),
            ),
            memoryless=power,
            after_conversion=True,
            error=0.005,  # of the other forms it leaves 0.0016 at most
        ),
    ),
    experiment="press to the highest permitted load",
    drawing=Drawing("force"),
    families=("nonlinear",),
)
