# SPDX-License-Identifier: GPL-3.0-or-later
"""Use takes something away for good: less force the more was pressed, or less foam the more was rubbed.

What a step wears off acts from the next step on; it is far too little in one step to matter.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, constants_from, scalar


def exponential(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f exp(−A/L)`` with A all loads put on so far. Memory: A and the last force."""
    factor = math.exp(-memory[point, at] / numbers[row, 0])
    if commit:
        memory[point, at] += max(force - memory[point, at + 1], 0.0)
        memory[point, at + 1] = force
    return force * factor, slope * factor


def linear(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f · max(1 − A/L, 0)`` with A all loads put on so far. Memory: A and the last force."""
    factor = max(1.0 - memory[point, at] / numbers[row, 0], 0.0)
    if commit:
        memory[point, at] += max(force - memory[point, at + 1], 0.0)
        memory[point, at + 1] = force
    return force * factor, slope * factor


def dose(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f exp(−B/L)`` with B the load summed over time. Memory: B. Constants: L and the length of the step."""
    factor = math.exp(-memory[point, at] / numbers[row, 0])
    if commit:
        memory[point, at] += max(force, 0.0) * numbers[row, 1]
    return force * factor, slope * factor


def _with_step(values: Values, dt: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(dt), scalar(values, "life")), dt])


def archard(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f · max(1 − δ/d, 0)``, as if the surface lay δ lower; δ grows with load times way slid. Memory: δ."""
    gone = memory[point, at]
    if commit:
        memory[point, at] += numbers[row, 0] * max(force, 0.0) * slide
    if depth <= gone:
        return 0.0, 0.0
    if gone == 0.0:
        return force, slope
    left = 1.0 - gone / depth
    return force * left, slope * left + force * gone / (depth * depth)


def work(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f exp(−W/L)`` with W the load summed over the way its surface goes, in and along. Memory: W and the last depth."""
    factor = math.exp(-memory[point, at] / numbers[row, 0])
    if commit:
        memory[point, at] += max(force, 0.0) * math.hypot(slide, max(depth, 0.0) - memory[point, at + 1])
        memory[point, at + 1] = max(depth, 0.0)
    return force * factor, slope * factor


KIND = Kind(
    name="wear",
    title="Wear",
    text="Loses force for good, the more it has been pressed or rubbed.",
    site="pad",
    order=40,
    forms=(
        Form(
            "exponential",
            "f = fₑ · exp(−A/L),  A the sum of all loads put on so far",
            "Lemaitre and Desmorat, Engineering Damage Mechanics (2005): fatigue damage",
            (Parameter("life", "N", 100.0, 0.01, 1e9, "Sum L of loads that leaves 37 % of the force.", log=True),),
            neutral={"life": math.inf},
            law=exponential,
            constants=constants_from("life"),
            memory=2,
        ),
        Form(
            "linear",
            "f = fₑ · (1 − A/L),  A the sum of all loads put on so far",
            "Palmgren (1924); Miner, J. Appl. Mech. 12 (1945): linear damage",
            (Parameter("life", "N", 100.0, 0.01, 1e9, "Sum L of loads that leaves nothing.", log=True),),
            neutral={"life": math.inf},
            law=linear,
            constants=constants_from("life"),
            memory=2,
        ),
        Form(
            "dose",
            "f = fₑ · exp(−B/L),  Ḃ = fₑ",
            "Lemaitre and Desmorat, Engineering Damage Mechanics (2005), section 5: creep damage",
            (Parameter("life", "N·s", 100.0, 0.01, 1e9, "Load over time L that leaves 37 % of the force.", log=True),),
            neutral={"life": math.inf},
            law=dose,
            constants=_with_step,
            memory=1,
        ),
        Form(
            "archard",
            "f = fₑ · (1 − δ/d),  δ̇ = κ fₑ |v|",
            "Archard, J. Appl. Phys. 24 (1953)",
            (Parameter("rate", "1/N", 1e-3, 0.0, 10.0, "Thickness κ lost per newton and metre slid, m/(N·m)."),),
            neutral={"rate": 0.0},
            law=archard,
            constants=constants_from("rate"),
            memory=1,
        ),
        Form(
            "work",
            "f = fₑ · exp(−W/L),  Ẇ = fₑ √(v² + ḋ²)",
            "Fouvry, Kapsa and Vincent, Wear 200 (1996): what is lost goes with the energy that was dissipated",
            (Parameter("life", "J", 0.1, 1e-6, 1e9, "Load times way L that leaves 37 % of the force.", log=True),),
            neutral={"life": math.inf},
            law=work,
            constants=constants_from("life"),
            memory=2,
        ),
    ),
)
