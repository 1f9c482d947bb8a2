# SPDX-License-Identifier: GPL-3.0-or-later
"""Each channel has a calibration curve of its own, with a sign, as the axes of the magnetometers below a magnetic skin have."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TransducerArray

POWERS = ("offset", "factor", "second", "third", "fourth", "fifth")
"""Parameters by the power of the force that they multiply."""


def curve(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Apply the polynomial of each channel (Horner's rule); a coefficient that is missing is zero."""
    result = np.zeros_like(signal)
    for name in reversed(POWERS):
        result = result * signal + np.asarray(values.get(name, 0.0))
    return result


_OFFSET = Parameter("offset", "N", 0.0, -1e4, 1e4, "Force o that a channel shows without load.", per_texel=True, neutral=0.0)
_FACTOR = Parameter(
    "factor", "1", 1.0, -100.0, 100.0, "Factor g at small forces; negative: it falls.", per_texel=True, neutral=1.0
)
_SECOND = Parameter("second", "1/N", 0.0, -1e4, 1e4, "Coefficient c of the square of the force.", per_texel=True, neutral=0.0)
_THIRD = Parameter("third", "1/N²", 0.0, -1e6, 1e6, "Coefficient d of the cube of the force.", per_texel=True, neutral=0.0)
_HIGHER = (
    Parameter("fourth", "1/N³", 0.0, -1e8, 1e8, "Coefficient e of the fourth power.", per_texel=True, neutral=0.0),
    Parameter("fifth", "1/N⁴", 0.0, -1e8, 1e8, "Coefficient h of the fifth power.", per_texel=True, neutral=0.0),
)
_POLYNOMIAL = "ISO/IEC Guide 99 (2007), 4.31: calibration curve, here with a sign and to order {} for each channel"

KIND = Kind(
    name="channel-curve",
    title="Channel Curve",
    text="Each channel has its own curve over the force: it rises or falls, and stiffens or saturates.",
    site="readout",
    order=42,
    forms=(
        Form(
            "cubic",
            "rᵢ = oᵢ + gᵢ f + cᵢ f² + dᵢ f³",
            _POLYNOMIAL.format("three"),
            (_FACTOR, _OFFSET, _SECOND, _THIRD),
            memoryless=curve,
        ),
        Form("linear", "rᵢ = oᵢ + gᵢ f", _POLYNOMIAL.format("one"), (_FACTOR, _OFFSET), memoryless=curve),
        Form("quadratic", "rᵢ = oᵢ + gᵢ f + cᵢ f²", _POLYNOMIAL.format("two"), (_FACTOR, _OFFSET, _SECOND), memoryless=curve),
        Form(
            "quintic",
            "rᵢ = oᵢ + gᵢ f + cᵢ f² + dᵢ f³ + eᵢ f⁴ + hᵢ f⁵",
            _POLYNOMIAL.format("five"),
            (_FACTOR, _OFFSET, _SECOND, _THIRD, *_HIGHER),
            memoryless=curve,
            error=0.005,  # of 27 curves that rise or fall it leaves 0.001 at most (benchmarks/RESULTS.md)
        ),
    ),
    experiment="press slowly to the largest load and back, several times, at one place",
    drawing=Drawing(
        "force",
        values={
            "cubic": {"factor": -0.8, "second": 0.1, "third": 0.05},
            "linear": {"factor": -0.4},
            "quadratic": {"factor": 1.0, "second": -0.2},
            "quintic": {"factor": 0.5, "fourth": 0.08, "fifth": -0.03},
        },
    ),
    needs="signed channels",  # of texels that all rise, gains and a common curve say more
)
