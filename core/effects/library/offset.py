# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading without load is wrong."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.random_streams import normal
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar


def common(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add the same offset to all texels."""
    return signal + scalar(values, "offset")


def random(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a normally distributed offset to each texel."""
    return signal + scalar(values, "spread") * normal("offset", seed, np.arange(signal.shape[1]))


def listed(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a given offset to each texel."""
    return signal + np.asarray(values["offset"])


def relieved(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a given offset to each texel, which falls with the reading."""
    return signal + np.asarray(values["offset"]) * np.exp(-np.abs(signal - transducers.zero) / scalar(values, "level"))


_SECOND = np.linspace(0, 1, 501)


KIND = Kind(
    name="offset",
    title="Offset",
    text="The reading without load is not zero.",
    site="readout",
    order=62,
    forms=(
        Form(
            "common",
            "r = r₀ + b",
            "ISO/IEC Guide 99 (2007), 4.28: zero error",
            (Parameter("offset", "unit", 0.05, -1e5, 1e5, "Offset b of all texels.", neutral=0.0),),
            memoryless=common,
            after_conversion=True,
            same_as="zero",
        ),
        Form(
            "random",
            "rᵢ = r₀ᵢ + s εᵢ,  ε normal",
            "ISO/IEC Guide 99 (2007), 4.28: zero error",
            (Parameter("spread", "unit", 0.05, 0.0, 1e5, "Standard deviation s of the texels' offsets.", neutral=0.0),),
            memoryless=random,
            after_conversion=True,
            random=True,
        ),
        Form(
            "listed",
            "rᵢ = r₀ᵢ + bᵢ",
            "ISO/IEC Guide 99 (2007), 4.28: zero error",
            (Parameter("offset", "unit", 0.0, -1e5, 1e5, "Offset b of each texel.", per_texel=True, neutral=0.0),),
            memoryless=listed,
            after_conversion=True,
        ),
        Form(
            "relieved",
            "rᵢ = r₀ᵢ + bᵢ exp(−|r₀ᵢ − z| / L),  z the sensor's zero",
            "ISO/IEC Guide 99 (2007), 4.28: zero error; a cover that presses on the texels until the load takes over",
            (
                Parameter(
                    "offset", "unit", 0.0, -1e5, 1e5, "Offset b of each texel without load.", per_texel=True, neutral=0.0
                ),
                Parameter("level", "unit", 1.0, 1e-3, 1e5, "Reading L at which an offset has fallen to 37 %.", log=True),
            ),
            memoryless=relieved,
            after_conversion=True,
            error=0.005,  # listed is a limit of it; of b / (1 + r/L) up to three L it leaves 0.003
        ),
    ),
    experiment="record a minute without touching the sensor, before and after a trial",
    drawing=Drawing(time=_SECOND, depth=0.0002 * np.sin(np.pi * _SECOND) ** 2, values={"common": {"offset": 0.05}}),
    signature="unloaded",
)
