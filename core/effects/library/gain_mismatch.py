# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels differ in sensitivity."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.random_streams import normal
from ..engine.specification import EXACT_FORM_ERROR, Drawing, Form, Kind, TransducerArray, scalar


def random(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Multiply by ``exp(s ε)``, which is log-normal with median one."""
    return signal * np.exp(scalar(values, "spread") * normal("gain-mismatch", seed, np.arange(signal.shape[1])))


def listed(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Multiply by a given factor for each texel."""
    return signal * np.asarray(values["factor"])


def curved(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Apply a curve of its own to each texel: a factor, and a share that grows with the force."""
    return signal * (np.asarray(values["factor"]) * (1.0 + np.asarray(values["curvature"]) * np.abs(signal)))


def random_power(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Apply a power of its own to each texel; all agree at one force."""
    force = scalar(values, "force")
    exponent = np.exp(scalar(values, "spread") * normal("gain-mismatch", seed, np.arange(signal.shape[1])))
    return np.sign(signal) * force * (np.abs(signal) / force) ** exponent


def gradient(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Multiply by a factor that is linear in x and y, from ``1 − g`` at one end to ``1 + g`` at the other."""
    middle = 0.5 * (transducers.position.min(axis=0) + transducers.position.max(axis=0))
    half = np.maximum(0.5 * np.ptp(transducers.position, axis=0), 1e-12)
    place = (transducers.position - middle) / half
    return signal * (1.0 + scalar(values, "along_x") * place[:, 0] + scalar(values, "along_y") * place[:, 1])


_FACTOR = Parameter("factor", "1", 1.0, 0.0, 100.0, "Factor g of each texel.", per_texel=True, neutral=1.0)
_CURVATURE = Parameter(
    "curvature", "1/N", 0.0, -1e4, 1e4, "Share c by which the factor grows per newton.", per_texel=True, neutral=0.0
)

KIND = Kind(
    name="gain-mismatch",
    title="Gain Mismatch",
    text="Texels read differently under the same load.",
    site="readout",
    order=40,
    forms=(
        Form(
            "random",
            "rᵢ = exp(s εᵢ) · fᵢ,  ε normal",
            "Schürmann et al., IEEE World Haptics (2011): a modular sensor, calibrated texel by texel",
            (Parameter("spread", "1", 0.1, 0.0, 1.5, "Standard deviation s of the factors' logarithm.", neutral=0.0),),
            memoryless=random,
            random=True,
        ),
        Form(
            "listed",
            "rᵢ = gᵢ · fᵢ",
            "ISO/IEC Guide 99 (2007), 2.39: calibration",
            (_FACTOR,),
            memoryless=listed,
            error=EXACT_FORM_ERROR,  # every factor of a texel is one of these
        ),
        Form(
            "gradient",
            "r = (1 + gₓ x + g_y y) · f,  x and y from −1 to 1 across the sensor",
            "ISO/IEC Guide 99 (2007), 2.39: calibration, to first order in the place",
            (
                Parameter("along_x", "1", 0.2, -0.5, 0.5, "Change g of the factor from the centre to the +x end.", neutral=0.0),
                Parameter("along_y", "1", 0.0, -0.5, 0.5, "Change g of the factor from the centre to the +y end.", neutral=0.0),
            ),
            memoryless=gradient,
        ),
        Form(
            "curved",
            "rᵢ = gᵢ · fᵢ · (1 + cᵢ fᵢ)",
            "ISO/IEC Guide 99 (2007), 4.31: calibration curve, here to second order for each texel",
            (_FACTOR, _CURVATURE),
            memoryless=curved,
            is_tried=False,  # that two numbers per texel take no other effect's name has not been measured
            is_apart=True,
        ),
        Form(
            "random-power",
            "rᵢ = F · (fᵢ/F)^pᵢ,  pᵢ = exp(s εᵢ),  ε normal",
            "ISO/IEC Guide 99 (2007), 4.31: calibration curve, here a power for each texel",
            (
                Parameter("spread", "1", 0.1, 0.0, 1.0, "Standard deviation s of the powers' logarithm.", neutral=0.0),
                Parameter("force", "N", 1.0, 1e-6, 1e6, "Force F at which all texels agree.", log=True),
            ),
            memoryless=random_power,
            random=True,
        ),
    ),
    experiment="press every texel with the same flat indenter to the same depth",
    drawing=Drawing("texel"),
    known_from=("places",),
    is_gain_of_texels=True,
)
