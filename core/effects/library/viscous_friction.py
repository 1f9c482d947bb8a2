# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction that grows with the sliding speed, on top of the base model's ``ct v``."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ..engine.specification import Drawing, Form, Kind


def linear(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """``c v``."""
    return 1.0, constants[0]


def power(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """``C · v^p``; linear below 0.01 mm/s."""
    return 1.0, constants[0] * max(speed, 1e-5) ** (constants[1] - 1.0)


def load(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """``c f v``."""
    return 1.0, constants[0] * max(force, 0.0)


KIND = Kind(
    name="viscous-friction",
    title="Viscous Friction",
    text="Friction grows with the sliding speed.",
    site="contact",
    order=30,
    forms=(
        Form(
            "linear",
            "fₜ = fₜ₀ + c v",
            "Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994)",
            (Parameter("viscosity", "N·s/m", 0.05, 0.0, 1e3, "Drag c of one texel per metre per second.", neutral=0.0),),
            friction_law=linear,
        ),
        Form(
            "load",
            "fₜ = fₜ₀ + c f v",
            "Bowden and Tabor, The Friction and Lubrication of Solids (1950): the area that is sheared grows with the load",
            (Parameter("viscosity", "s/m", 0.5, 0.0, 1e3, "Drag c per newton of load and metre per second.", neutral=0.0),),
            friction_law=load,
        ),
        Form(
            "power",
            "fₜ = fₜ₀ + C vᵖ",
            "Olsson et al., Eur. J. Control 4 (1998)",
            (
                Parameter("drag", "N·(s/m)^p", 0.05, 0.0, 1e3, "Drag C of one texel at one metre per second.", neutral=0.0),
                Parameter("exponent", "1", 0.5, 0.2, 2.0, "Exponent p of the speed."),
            ),
            friction_law=power,
        ),
    ),
    experiment="slide at constant speeds, up to the fastest possible",
    drawing=Drawing("speed", values={"linear": {"viscosity": 2.0}, "load": {"viscosity": 4.0}, "power": {"drag": 0.3}}),
)
