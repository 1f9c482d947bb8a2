# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading comes in steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, TransducerArray, scalar


def rounded(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """To the nearest step."""
    return _stepped(x, scalar(values, "step"), np.round)


def cut(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """To the step below."""
    return _stepped(x, scalar(values, "step"), np.floor)


def converter(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """To the nearest of ``2^bits`` steps over a range."""
    return _stepped(x, scalar(values, "range") / 2.0 ** scalar(values, "bits"), np.round)


def companded(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """To the step below, of steps that grow with the reading's change."""
    scale, growth = scalar(values, "scale"), scalar(values, "growth")
    if growth <= 0.0:
        return x
    change = x - transducers.zero
    steps = np.floor(np.log1p(np.abs(change) / scale) / growth)
    return transducers.zero + np.sign(change) * scale * np.expm1(growth * steps)


def _stepped(x: np.ndarray, step: float, way: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    return step * way(x / step) if step > 0.0 else x


_STEP = Parameter("step", "unit", 0.01, 0.0, 1e4, "Width Δ of a step.")

KIND = Kind(
    name="quantization",
    title="Quantization",
    text="The reading comes in steps.",
    site="readout",
    order=90,
    forms=(
        Form(
            "round",
            "r = Δ · round(r₀ / Δ)",
            "IEEE Std 1241 (2010): mid-tread quantizer",
            (_STEP,),
            neutral={"step": 0.0},
            memoryless=rounded,
            after_conversion=True,
        ),
        Form(
            "floor",
            "r = Δ · floor(r₀ / Δ)",
            "IEEE Std 1241 (2010): truncating quantizer",
            (_STEP,),
            neutral={"step": 0.0},
            memoryless=cut,
            after_conversion=True,
        ),
        Form(
            "bits",
            "r = Δ · round(r₀ / Δ),  Δ = R / 2ᵇ",
            "IEEE Std 1241 (2010): converter of b bits",
            (
                Parameter("bits", "1", 8.0, 1.0, 24.0, "Bits b of the converter."),
                Parameter("range", "unit", 1.0, 1e-6, 1e6, "Range R that they divide.", log=True),
            ),
            neutral={"range": 0.0},
            memoryless=converter,
            after_conversion=True,
        ),
        Form(
            "companding",
            "r = A · (exp(b · floor(ln(1 + r₀/A) / b)) − 1)",
            "ITU-T Recommendation G.711 (1988): companding by a logarithm",
            (
                Parameter("scale", "unit", 0.1, 1e-6, 1e5, "Reading A from which on steps grow with it.", log=True),
                Parameter("growth", "1", 0.05, 0.0, 3.0, "Width b of a step as a share of A and the reading together."),
            ),
            neutral={"growth": 0.0},
            memoryless=companded,
            after_conversion=True,
        ),
    ),
)
