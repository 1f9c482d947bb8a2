# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads below a threshold are not measured."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import EXACT_FORM_ERROR, Drawing, Form, Kind, TransducerArray, scalar, where_loaded


def hard(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Subtract the threshold."""
    return np.sign(signal) * np.maximum(np.abs(signal) - scalar(values, "threshold"), 0.0)


def soft(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Grow quadratically at first; under large loads the threshold is subtracted."""
    size = np.abs(signal)
    return signal * size / np.maximum(size + scalar(values, "threshold"), 1e-300)


def step(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Read zero below the threshold, and the whole load above it."""
    return np.where(np.abs(signal) > scalar(values, "threshold"), signal, 0.0)


def knee(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Grow with a power at first; under large loads the threshold is subtracted. A large exponent is a sharp knee."""
    threshold, sharpness = scalar(values, "threshold"), scalar(values, "sharpness")
    if threshold == 0.0:
        return signal

    def beyond(force: np.ndarray) -> np.ndarray:
        ratio = np.abs(force) / threshold
        larger = np.maximum(ratio, 1.0)
        grown = larger * (1.0 + (np.minimum(ratio, 1.0) / larger) ** sharpness) ** (1.0 / sharpness)
        return np.asarray(np.sign(force) * threshold * (grown - 1.0))

    return where_loaded(beyond, signal)


_THRESHOLD = Parameter("threshold", "N", 0.01, 0.0, 100.0, "Largest force T that is not measured.", neutral=0.0)


KIND = Kind(
    name="dead-zone",
    title="Dead Zone",
    text="Loads below a threshold are not measured.",
    site="readout",
    order=35,
    forms=(
        Form(
            "hard",
            "r = max(f − T, 0)",
            "Tao and Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996), section 2.1",
            (_THRESHOLD,),
            memoryless=hard,
        ),
        Form(
            "soft",
            "r = f² / (f + T)",
            "Weiss and Wörn, IEEE ICMA (2005): contact resistance R ∝ 1/f in series with a fixed one",
            (_THRESHOLD,),
            memoryless=soft,
        ),
        Form(
            "knee",
            "r = (fᵖ + Tᵖ)^(1/p) − T",
            "Tao and Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996), section 2.1, with "
            "a rounded corner",
            (
                _THRESHOLD,
                Parameter(
                    "sharpness", "1", 3.0, 1.2, 20.0, "Exponent p: 2 is a hyperbola, a large one a sharp knee.", log=True
                ),
            ),
            memoryless=knee,
            error=EXACT_FORM_ERROR,  # of hard and soft it leaves 0.0002 at most
        ),
        Form(
            "step",
            "r = f where f > T, else 0",
            "ISO/IEC Guide 99 (2007), 4.16: discrimination threshold",
            (_THRESHOLD,),
            memoryless=step,
            jumps_at=("threshold",),
            is_apart=True,
        ),
    ),
    experiment="approach slowly, with many samples at the first touch, with a flat and with a round indenter",
    drawing=Drawing("force", values={form: {"threshold": 0.4} for form in ("hard", "soft", "step")}),
    families=("nonlinear",),
)
