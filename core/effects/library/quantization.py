# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading takes only discrete values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import EXACT_FORM_ERROR, STEPS, Drawing, Form, Kind, TransducerArray, scalar


def even(sizes: np.ndarray, values: Values) -> np.ndarray:
    """Return sizes in steps Δ."""
    return sizes / scalar(values, "step")


def after_logarithm(sizes: np.ndarray, values: Values) -> np.ndarray:
    """Return sizes in steps that are even after a logarithm."""
    return np.log1p(sizes / scalar(values, "scale")) / scalar(values, "growth")


def after_power(sizes: np.ndarray, values: Values) -> np.ndarray:
    """Return sizes in steps that are even after a power."""
    return (sizes / scalar(values, "first")) ** scalar(values, "exponent")


def rounded(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Round to the nearest step."""
    return _stepped(signal, scalar(values, "step"), np.round)


def rounded_down(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Round down."""
    return _stepped(signal, scalar(values, "step"), np.floor)


def converter(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Round to the nearest of ``2^bits`` steps over a range."""
    return _stepped(signal, scalar(values, "range") / 2.0 ** scalar(values, "bits"), np.round)


def companded(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Round in steps that are even after a logarithm of the distance from the reading without load."""
    scale, growth = scalar(values, "scale"), scalar(values, "growth")
    if growth <= 0.0:
        return signal
    change = signal - transducers.zero
    steps = np.floor(after_logarithm(np.abs(change), values) + scalar(values, "rounding"))
    return transducers.zero + np.sign(change) * scale * np.expm1(growth * steps)


def power(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Round in steps that are even after a power of the distance from the reading without load."""
    first, exponent = scalar(values, "first"), scalar(values, "exponent")
    if first <= 0.0:
        return signal
    change = signal - transducers.zero
    steps = np.floor(after_power(np.abs(change), values) + scalar(values, "rounding"))
    return transducers.zero + np.sign(change) * first * steps ** (1.0 / exponent)


def _stepped(signal: np.ndarray, step: float, rounding: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return multiples of a step, or the signal itself if the step is zero."""
    return step * rounding(signal / step) if step > 0.0 else signal


_STEP = Parameter("step", "unit", 0.01, 0.0, 1e4, "Width Δ of a step.", neutral=0.0)
_ROUNDING = Parameter("rounding", "1", 0.0, 0.0, 0.5, "Share h of a step that is rounded up: 0 truncates, 0.5 rounds.")

KIND = Kind(
    name="quantization",
    title="Quantization",
    text="The reading is discrete.",
    site="readout",
    order=90,
    forms=(
        Form(
            "round",
            "r = Δ · round(r₀ / Δ)",
            "IEEE Std 1241 (2010): mid-tread quantizer",
            (_STEP,),
            memoryless=rounded,
            after_conversion=True,
            level_number=even,
            error=EXACT_FORM_ERROR,  # the values of a converter are these exactly
        ),
        Form(
            "floor",
            "r = Δ · floor(r₀ / Δ)",
            "IEEE Std 1241 (2010): truncating quantizer",
            (_STEP,),
            memoryless=rounded_down,
            after_conversion=True,
            level_number=even,
            error=EXACT_FORM_ERROR,  # the values of a converter are these exactly
        ),
        Form(
            "bits",
            "r = Δ · round(r₀ / Δ),  Δ = R / 2ᵇ",
            "IEEE Std 1241 (2010): converter of b bits",
            (
                Parameter("bits", "1", 8.0, 1.0, 24.0, "Bits b of the converter."),
                Parameter("range", "unit", 1.0, 1e-6, 1e6, "Range R that they divide into steps.", log=True, neutral=0.0),
            ),
            memoryless=converter,
            after_conversion=True,
            is_tried=False,  # "round" has the same steps
        ),
        Form(
            "companding",
            "r = A · (exp(b · floor(ln(1 + r₀/A) / b + h)) − 1)",
            "ITU-T Recommendation G.711 (1988): companding by a logarithm",
            (
                Parameter("scale", "unit", 0.1, 1e-6, 1e5, "Reading A above which the steps grow with the reading.", log=True),
                Parameter("growth", "1", 0.05, 0.0, 3.0, "Width b of a step, as a share of A plus the reading.", neutral=0.0),
                _ROUNDING,
            ),
            memoryless=companded,
            after_conversion=True,
            level_number=after_logarithm,
            error=EXACT_FORM_ERROR,  # the values of a converter are these exactly
        ),
        Form(
            "power",
            "r = s · floor((r₀/s)ᵖ + h)^(1/p)",
            "Max, IRE Trans. Inf. Theory 6 (1960): uneven steps as even steps behind a compressor, here a power",
            (
                Parameter("first", "unit", 0.02, 0.0, 1e4, "Reading s at the end of the first step.", neutral=0.0),
                Parameter("exponent", "1", 0.5, 0.1, 3.0, "Power p of the reading that is divided evenly."),
                _ROUNDING,
            ),
            memoryless=power,
            after_conversion=True,
            level_number=after_power,
            error=EXACT_FORM_ERROR,  # the values of a converter are these exactly
        ),
    ),
    experiment="raise the load very slowly through its whole range",
    drawing=Drawing(
        "force",
        values={"round": {"step": 0.25}, "floor": {"step": 0.25}, "bits": {"bits": 4, "range": 2.4}, "power": {"first": 0.1}},
    ),
    found_by=STEPS,
)
