# SPDX-License-Identifier: GPL-3.0-or-later
"""All magnetometers of a skin share the field of their surroundings, which changes as the skin is turned or iron comes near."""

from __future__ import annotations

import numpy as np

from ...errors import EffectError
from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar

AXES = ("x", "y", "z")


def _for_each_channel(values: Values, transducers: TransducerArray, channels: int) -> np.ndarray:
    """The three components once for each magnetometer, (channels,)."""
    if channels % 3:
        raise EffectError(
            f"Effect 'ambient-field' of sensor '{transducers.name}' needs three channels for each magnetometer, and it has "
            f"{channels} channels: use 'drift' or 'offset' instead."
        )
    return np.tile([scalar(values, axis) for axis in AXES], channels // 3)


def constant(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a field that stays."""
    return signal + _for_each_channel(values, transducers, signal.shape[1])


def linear(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add a field that changes at a constant rate."""
    return signal + time[:, None] * _for_each_channel(values, transducers, signal.shape[1])


def _parameters(unit: str, size: float, limit: float, what: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(axis, unit, size, -limit, limit, f"{what} along {axis}.", neutral=0.0) for axis in AXES)


KIND = Kind(
    name="ambient-field",
    title="Ambient Field",
    text="All magnetometers also measure the field of their surroundings; channels come as x, y, z.",
    site="readout",
    order=65,
    forms=(
        Form(
            "constant",
            "rᵢ = r₀ᵢ + B of the axis of i",
            "Tomo et al., IEEE Robot. Autom. Lett. 3 (2018): uSkin, whose readings are zeroed where the skin is used",
            _parameters("unit", 0.05, 1e5, "Field"),
            memoryless=constant,
            couples=True,
            after_conversion=True,
            needs="axes",
            is_tried=False,  # a zero of each channel does the same
        ),
        Form(
            "linear",
            "rᵢ = r₀ᵢ + Ḃ t of the axis of i",
            "ISO/IEC Guide 99 (2007), 4.21: instrumental drift, here shared by all magnetometers",
            _parameters("unit/s", 1e-3, 1e3, "Change of the field per second"),
            memoryless=linear,
            couples=True,
            after_conversion=True,
            needs="axes",
        ),
    ),
    experiment="record ten minutes without touching the skin, then turn it and record ten more",
    drawing=Drawing("texel", values={"constant": {"x": 0.1, "y": -0.2, "z": 0.3}}),
    known_from=("timing",),
)
