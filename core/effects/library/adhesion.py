# SPDX-License-Identifier: GPL-3.0-or-later
"""The surfaces stick: the force at small depth is less than the spring's and may pull.

A texel knows nothing of an object that no longer reaches into it, so the pull ends where the contact does: abruptly, or
with the traction of a cohesive zone, which rises and fades while the last of the depth is given back.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, constants_from, scalar


def constant(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f − F · (1 − exp(−d/D))``."""
    if depth <= 0.0:
        return force, slope
    left = math.exp(-depth / numbers[row, 1])
    return force - numbers[row, 0] * (1.0 - left), slope - numbers[row, 0] * left / numbers[row, 1]


def unloading(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f − F u c``: u goes to 1 on the way back and to 0 on the way in, c grows with the time of contact (or is 1).

    Memory: u, the last depth, c. Constants: F, D, how much of 1 − c is left after the step, least c.
    """
    if depth <= 0.0:
        if commit:
            memory[point, at], memory[point, at + 1], memory[point, at + 2] = 0.0, 0.0, 0.0
        return force, slope
    change = depth - memory[point, at + 1]
    aim = 0.0 if change >= 0.0 else 1.0
    u = aim + (memory[point, at] - aim) * math.exp(-abs(change) / numbers[row, 1])
    old = 1.0 - (1.0 - memory[point, at + 2]) * numbers[row, 2]
    c = max(old, numbers[row, 3])
    if commit:
        memory[point, at], memory[point, at + 1], memory[point, at + 2] = u, depth, old
    pull = numbers[row, 0] * c
    return force - pull * u, slope + pull * abs(aim - u) / numbers[row, 1]


def cohesive(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f − F u x exp(1 − x)``, x = d/D: on the way back the last of the depth is a layer that parts.

    ``du/dt = (aim − u) |ḋ|/D − u/τ``, exact over a step: u goes to 1 on the way back, to 0 on the way in, and fades in time.
    Memory: u and the last depth. Constants: F, D, the length of the step by τ.
    """
    if depth <= 0.0:
        if commit:
            memory[point, at], memory[point, at + 1] = 0.0, 0.0
        return force, slope
    change, x = depth - memory[point, at + 1], depth / numbers[row, 1]
    aim, way = 0.0 if change >= 0.0 else 1.0, abs(change) / numbers[row, 1]
    rate = way + numbers[row, 2]
    end, lags = (aim * way / rate, aim * numbers[row, 2] / (rate * rate)) if rate > 0.0 else (0.0, 0.0)
    u = end + (memory[point, at] - end) * math.exp(-rate)
    if commit:
        memory[point, at], memory[point, at + 1] = u, depth
    traction = x * math.exp(1.0 - x)
    further = end - u - lags * math.expm1(-rate)  # du by the way over D; back is against the depth
    bend = u * (1.0 - x) * math.exp(1.0 - x) + (1.0 - 2.0 * aim) * further * traction
    return force - numbers[row, 0] * u * traction, slope - numbers[row, 0] * bend / numbers[row, 1]


def _at_once(values: Values, dt: np.ndarray) -> np.ndarray:
    return np.tile([scalar(values, "pull"), scalar(values, "depth"), 1.0, 1.0], (len(dt), 1))


def _with_time(values: Values, dt: np.ndarray) -> np.ndarray:
    left = np.exp(-np.asarray(dt) / scalar(values, "time"))
    same = np.tile([scalar(values, "pull"), scalar(values, "depth")], (len(dt), 1))
    return np.column_stack([same, left, np.zeros(len(dt))])


def _held(values: Values, dt: np.ndarray) -> np.ndarray:
    return np.tile([scalar(values, "pull"), scalar(values, "depth"), 0.0], (len(dt), 1))


def _relaxing(values: Values, dt: np.ndarray) -> np.ndarray:
    same = np.tile([scalar(values, "pull"), scalar(values, "depth")], (len(dt), 1))
    return np.column_stack([same, np.asarray(dt) / scalar(values, "time")])


_PULL = Parameter("pull", "N", 0.02, 0.0, 100.0, "Largest pull F of one texel.")
_ZONE = Parameter("depth", "m", 2e-4, 1e-6, 0.02, "Depth D, before contact ends, at which it pulls most.", log=True)
_WAY = Parameter("depth", "m", 2e-4, 1e-6, 0.02, "Way back D after which the pull has come to 63 %.", log=True)

KIND = Kind(
    name="adhesion",
    title="Adhesion",
    text="Sticks: the force goes below that of the spring when the object comes off, and may pull.",
    site="pad",
    order=50,
    forms=(
        Form(
            "unloading",
            "f = f₀ − F u,  u → 1 on the way back, → 0 on the way in, within D",
            "Johnson, Kendall and Roberts, Proc. R. Soc. A 324 (1971): contact is held longer than it was made",
            (_PULL, _WAY),
            neutral={"pull": 0.0},
            law=unloading,
            constants=_at_once,
            memory=3,
            after_clip=True,
        ),
        Form(
            "constant",
            "f = f₀ − F · (1 − exp(−d/D))",
            "Derjaguin, Muller and Toporov, J. Colloid Interface Sci. 53 (1975)",
            (_PULL, Parameter("depth", "m", 1e-4, 1e-6, 0.02, "Depth D at which 63 % of the pull is there.", log=True)),
            neutral={"pull": 0.0},
            law=constant,
            constants=constants_from("pull", "depth"),
            after_clip=True,
        ),
        Form(
            "dwell",
            "f = f₀ − F u c,  c = 1 − exp(−t/τ) after the time t of contact",
            "Chaudhury and Whitesides, Langmuir 7 (1991): hysteresis of adhesion",
            (
                _PULL,
                _WAY,
                Parameter("time", "s", 2.0, 0.01, 1000.0, "Time of contact τ that makes 63 % of the pull.", log=True),
            ),
            neutral={"pull": 0.0},
            law=unloading,
            constants=_with_time,
            memory=3,
            after_clip=True,
        ),
        Form(
            "cohesive",
            "f = f₀ − F u x exp(1 − x),  x = d/D;  u → 1 on the way back, → 0 on the way in, within D",
            "Rose, Ferrante and Smith, Phys. Rev. Lett. 47 (1981); Xu and Needleman, Model. Simul. Mater. Sci. Eng. 1 (1993): "
            "traction over separation",
            (_PULL, _ZONE),
            neutral={"pull": 0.0},
            law=cohesive,
            constants=_held,
            memory=2,
            after_clip=True,
        ),
        Form(
            "relaxing",
            "f = f₀ − F u x exp(1 − x) as cohesive, but u fades within the time τ when it rests",
            "Maugis and Barquins, J. Phys. D 11 (1978): the faster surfaces part, the more adhesion takes",
            (
                _PULL,
                _ZONE,
                Parameter("time", "s", 0.1, 1e-3, 1000.0, "Time τ after which 37 % of the pull are left at rest.", log=True),
            ),
            neutral={"pull": 0.0},
            law=cohesive,
            constants=_relaxing,
            memory=2,
            after_clip=True,
        ),
    ),
)
