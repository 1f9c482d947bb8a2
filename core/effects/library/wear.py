# SPDX-License-Identifier: GPL-3.0-or-later
"""Use takes force away for good: loads reduce the stiffness, rubbing removes material.

What a step wears off acts from the next step on; the wear of one step is too small to matter.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TexelInput, scalar


def exponential(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f exp(−A/L)`` with A the sum of all loads put on so far. State: A, the last force. Constants: L."""
    factor = math.exp(-state[0] / constants[0])
    if commit:
        state[0] += max(texel.force - state[1], 0.0)
        state[1] = texel.force
    return texel.force * factor, texel.slope * factor


def linear(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f · max(1 − A/L, 0)`` with A the sum of all loads put on so far. State: A, the last force. Constants: L."""
    factor = max(1.0 - state[0] / constants[0], 0.0)
    if commit:
        state[0] += max(texel.force - state[1], 0.0)
        state[1] = texel.force
    return texel.force * factor, texel.slope * factor


def dose(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f exp(−B/L)`` with B the load integrated over time. State: B. Constants: L, the length of the step."""
    factor = math.exp(-state[0] / constants[0])
    if commit:
        state[0] += max(texel.force, 0.0) * constants[1]
    return texel.force * factor, texel.slope * factor


def _with_step(values: Values, dt: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(dt), scalar(values, "life")), dt])


def archard(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f · max(1 − δ/d, 0)``, as if the surface lay δ lower; δ grows with load times distance slid. State: δ. Constants: κ."""
    worn = state[0]
    if commit:
        state[0] += constants[0] * max(texel.force, 0.0) * texel.slide_step
    if texel.depth <= worn:
        return 0.0, 0.0
    if worn == 0.0:
        return texel.force, texel.slope
    remaining = 1.0 - worn / texel.depth
    return texel.force * remaining, texel.slope * remaining + texel.force * worn / (texel.depth * texel.depth)


def work(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f exp(−W/L)`` with W the load integrated over the path of its surface, inwards and sideways.

    State: W, the depth at the end of the last step. Constants: L.
    """
    factor = math.exp(-state[0] / constants[0])
    if commit:
        state[0] += max(texel.force, 0.0) * math.hypot(texel.slide_step, max(texel.depth, 0.0) - state[1])
        state[1] = max(texel.depth, 0.0)
    return texel.force * factor, texel.slope * factor


def _life(unit: str, default: float, low: float, text: str) -> tuple[Parameter]:
    return (Parameter("life", unit, default, low, 1e9, text, log=True, neutral=math.inf),)


KIND = Kind(
    name="wear",
    title="Wear",
    text="Pressing or rubbing reduces the force permanently.",
    site="pad",
    order=40,
    forms=(
        Form(
            "exponential",
            "f = fₑ · exp(−A/L),  A the sum of all loads put on so far",
            "Lemaitre and Desmorat, Engineering Damage Mechanics (2005): fatigue damage",
            _life("N", 100.0, 0.01, "Sum L of loads that leaves 37 % of the force."),
            law=exponential,
            state_size=2,
        ),
        Form(
            "linear",
            "f = fₑ · (1 − A/L),  A the sum of all loads put on so far",
            "Palmgren (1924); Miner, J. Appl. Mech. 12 (1945): linear damage",
            _life("N", 100.0, 0.01, "Sum L of loads that leaves nothing."),
            law=linear,
            state_size=2,
        ),
        Form(
            "dose",
            "f = fₑ · exp(−B/L),  Ḃ = fₑ",
            "Lemaitre and Desmorat, Engineering Damage Mechanics (2005), section 5: creep damage",
            _life("N·s", 100.0, 0.01, "Integral L of load over time that leaves 37 % of the force."),
            law=dose,
            constants=_with_step,
            state_size=1,
        ),
        Form(
            "archard",
            "f = fₑ · (1 − δ/d),  δ̇ = κ fₑ |v|",
            "Archard, J. Appl. Phys. 24 (1953)",
            (Parameter("rate", "1/N", 1e-3, 0.0, 10.0, "Thickness κ lost per newton and metre slid, m/(N·m).", neutral=0.0),),
            law=archard,
            state_size=1,
        ),
        Form(
            "work",
            "f = fₑ · exp(−W/L),  Ẇ = fₑ √(v² + ḋ²)",
            "Fouvry, Kapsa and Vincent, Wear 200 (1996): what is lost goes with the energy that was dissipated",
            _life("J", 0.1, 1e-6, "Load times path L that leaves 37 % of the force."),
            law=work,
            state_size=2,
        ),
    ),
    experiment="repeat one cycle several hundred times on the same texels",
    drawing=Drawing("pressings", values={"archard": {"rate": 2e-4}, "work": {"life": 5.0}}),
    known_from=("unloading", "cycles"),
)
