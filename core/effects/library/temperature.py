# SPDX-License-Identifier: GPL-3.0-or-later
"""Gain and zero follow the temperature. Recordings may hold it; where nothing recorded it, the sensor has one temperature."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar

REFERENCE = 25.0
"""°C at which sensors are commonly specified, and from which recorded temperatures count in a fit."""


def gain(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Multiply by a factor that is linear in the temperature."""
    return signal * (1.0 + scalar(values, "gain_change") * _warmth(time, values, transducers)[:, None])


def zero(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add what is linear in the temperature."""
    return signal + scalar(values, "zero_change") * _warmth(time, values, transducers)[:, None]


def both(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Change gain and zero."""
    load = gain(signal - transducers.zero, time, values, transducers, seed)
    return zero(transducers.zero + load, time, values, transducers, seed)


def _warmth(time: np.ndarray, values: Values, transducers: TransducerArray) -> np.ndarray:
    """Temperature at each sample less the reference, (t,) K."""
    if transducers.temperature is None:
        return np.full(len(time), scalar(values, "temperature") - scalar(values, "reference"))
    recorded_time, recorded = transducers.temperature
    return np.interp(time, recorded_time, recorded) - scalar(values, "reference")


_GAIN = Parameter("gain_change", "1/K", 0.005, -0.5, 0.5, "Share a by which the gain changes per kelvin.", neutral=0.0)
_ZERO = Parameter("zero_change", "unit/K", 0.005, -1e3, 1e3, "Change b of the reading per kelvin.", neutral=0.0)
_TEMPERATURES = (
    Parameter("temperature", "°C", 35.0, -273.0, 2000.0, "Temperature T of the sensor, unless recorded.", neutral=REFERENCE),
    Parameter("reference", "°C", REFERENCE, -273.0, 2000.0, "Reference temperature T₀ of gain and zero.", neutral=REFERENCE),
)

KIND = Kind(
    name="temperature",
    title="Temperature",
    text="Gain and zero follow the temperature.",
    site="readout",
    order=63,
    forms=(
        Form(
            "gain",
            "r = (1 + a (T − T₀)) · f",
            "ISA-37.1 (1982): thermal sensitivity shift",
            (_GAIN, *_TEMPERATURES),
            memoryless=gain,
        ),
        Form(
            "zero",
            "r = r₀ + b (T − T₀)",
            "ISA-37.1 (1982): thermal zero shift",
            (_ZERO, *_TEMPERATURES),
            memoryless=zero,
            after_conversion=True,
        ),
        Form(
            "gain-and-zero",
            "r = z + (1 + a (T − T₀)) · (r₀ − z) + b (T − T₀),  z the reading without load",
            "ISA-37.1 (1982): thermal sensitivity shift and thermal zero shift",
            (_GAIN, _ZERO, *_TEMPERATURES),
            memoryless=both,
            after_conversion=True,
        ),
    ),
    experiment="record its temperature, an unloaded hour and repeated presses while the sensor warms by 10 K",
    drawing=Drawing("force", values={"gain": {"gain_change": 0.02}, "zero": {"zero_change": 0.02}}),
    needs="temperature",
    known_parameters=("temperature", "reference"),  # recordings hold the temperature; the reference is that of gain and zero
)
