# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction is larger at low sliding speed, in addition to the Stribeck effect of the base model."""

from __future__ import annotations

import math

import numpy as np

from ...model.parameter import Parameter
from ..engine.specification import Drawing, Form, Kind


def gaussian(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """``1 + a · exp(−(v/V)²)``."""
    x = speed / constants[1]
    return 1.0 + constants[0] * math.exp(-x * x), 0.0


def exponential(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """``1 + a · exp(−v/V)``."""
    return 1.0 + constants[0] * math.exp(-speed / constants[1]), 0.0


def rational(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """``1 + a / (1 + (v/V)²)``."""
    x = speed / constants[1]
    return 1.0 + constants[0] / (1.0 + x * x), 0.0


def stretched(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """``1 + a · exp(−(v/V)^q)``."""
    return 1.0 + constants[0] * math.exp(-((speed / constants[1]) ** constants[2])), 0.0


_PARAMETERS = (
    Parameter("rise", "1", 0.5, 0.0, 4.0, "Excess a of friction at rest over fast sliding, as a share.", neutral=0.0),
    Parameter("speed", "m/s", 0.01, 1e-5, 2.0, "Stribeck velocity V, at which most of the excess is gone.", log=True),
)

KIND = Kind(
    name="stribeck",
    title="Stribeck Friction",
    text="Friction is larger in slow sliding than in fast sliding.",
    site="contact",
    order=20,
    forms=(
        Form(
            "gaussian",
            "μ = μ₀ · (1 + a exp(−(v/V)²))",
            "Bo and Pavelescu, Wear 82 (1982); Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995)",
            _PARAMETERS,
            friction_law=gaussian,
        ),
        Form(
            "exponential",
            "μ = μ₀ · (1 + a exp(−v/V))",
            "Tustin, J. IEE 94 (1947); Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994)",
            _PARAMETERS,
            friction_law=exponential,
        ),
        Form(
            "rational",
            "μ = μ₀ · (1 + a / (1 + (v/V)²))",
            "Hess and Soom, J. Tribol. 112 (1990)",
            _PARAMETERS,
            friction_law=rational,
        ),
        Form(
            "stretched",
            "μ = μ₀ · (1 + a exp(−(v/V)^q))",
            "Bo and Pavelescu, Wear 82 (1982), with any exponent; Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 "
            "(1994)",
            (
                *_PARAMETERS,
                Parameter("exponent", "1", 0.7, 0.2, 4.0, "Exponent q: 1 is the exponential, 2 the Gaussian.", log=True),
            ),
            friction_law=stretched,
            error=0.005,  # at most, of the other forms and of a logarithmic law (benchmarks/RESULTS.md)
        ),
    ),
    experiment="slide at constant speeds from 0.1 to 100 mm/s",
    drawing=Drawing("speed"),
)
