# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading cannot grow without end: a converter's last count, a transducer that flattens."""

from __future__ import annotations

import math

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, Site, number

_LEVEL = Parameter("level", "unit", 1.0, 1e-4, 1e5, "Largest change of the reading from the one without load.", log=True)


def clip(x: np.ndarray, time: np.ndarray, values: Values, site: Site, seed: int) -> np.ndarray:
    """Cut off at the level."""
    level = number(values, "level")
    return site.zero + np.clip(x - site.zero, -level, level)


def tanh(x: np.ndarray, time: np.ndarray, values: Values, site: Site, seed: int) -> np.ndarray:
    """Flatten as the hyperbolic tangent does."""
    level = number(values, "level")
    if math.isinf(level):
        return x
    return site.zero + level * np.tanh((x - site.zero) / level)


def rational(x: np.ndarray, time: np.ndarray, values: Values, site: Site, seed: int) -> np.ndarray:
    """Flatten as a voltage divider does."""
    change = x - site.zero
    return site.zero + change / (1.0 + np.abs(change) / number(values, "level"))


KIND = Kind(
    name="saturation",
    title="Saturation",
    text="The reading stops growing at a highest level.",
    stage="readout",
    order=70,
    forms=(
        Form(
            "clip",
            "r = min(r₀, L)",
            "IEEE Std 1241 (2010), section 3: full scale of a converter",
            (_LEVEL,),
            off={"level": math.inf},
            shape=clip,
            after_conversion=True,
        ),
        Form(
            "tanh",
            "r = L · tanh(r₀ / L)",
            "Dahiya and Valle, Robotic Tactile Sensing (2013)",
            (_LEVEL,),
            off={"level": math.inf},
            shape=tanh,
            after_conversion=True,
        ),
        Form(
            "rational",
            "r = r₀ / (1 + |r₀| / L)",
            "Flórez and Velásquez, IEEE ANDESCON (2010): force-sensing resistor in a voltage divider",
            (_LEVEL,),
            off={"level": math.inf},
            shape=rational,
            after_conversion=True,
        ),
    ),
)
