# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading without load is not what it should be."""

from __future__ import annotations

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.random_streams import normal
from ..engine.specification import Form, Kind, TransducerArray, scalar


def common(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """The same for all texels."""
    return x + scalar(values, "offset")


def random(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Another for each texel, normally distributed."""
    return x + scalar(values, "spread") * normal("offset", seed, np.arange(x.shape[1]))


def listed(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """A known one for each texel."""
    return x + np.asarray(values["offset"])


KIND = Kind(
    name="offset",
    title="Offset",
    text="Reads something without load.",
    site="readout",
    order=62,
    forms=(
        Form(
            "common",
            "r = r₀ + b",
            "ISO/IEC Guide 99 (2007), 4.28: zero error",
            (Parameter("offset", "unit", 0.05, -1e5, 1e5, "Offset b of all texels."),),
            neutral={"offset": 0.0},
            memoryless=common,
            after_conversion=True,
        ),
        Form(
            "random",
            "rᵢ = r₀ᵢ + s εᵢ,  ε normal",
            "ISO/IEC Guide 99 (2007), 4.28: zero error",
            (Parameter("spread", "unit", 0.05, 0.0, 1e5, "Standard deviation s of the texels' offsets."),),
            neutral={"spread": 0.0},
            memoryless=random,
            after_conversion=True,
            random=True,
        ),
        Form(
            "listed",
            "rᵢ = r₀ᵢ + bᵢ",
            "ISO/IEC Guide 99 (2007), 4.28: zero error",
            (Parameter("offset", "unit", 0.0, -1e5, 1e5, "Offset b of each texel.", per_texel=True),),
            neutral={"offset": 0.0},
            memoryless=listed,
            after_conversion=True,
        ),
    ),
)
