# SPDX-License-Identifier: GPL-3.0-or-later
"""The surfaces stick: at small depth the force is less than that of the spring, and may pull.

A texel has no information about an object that no longer penetrates it, so the pull ends where the contact ends: abruptly, or
with the traction of a cohesive zone, which rises and falls while the depth goes to zero.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TexelInput, constants_from, scalar


def constant(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f − F · (1 − exp(−d/D))``. Constants: F, D."""
    pull, length = constants[0], constants[1]
    if texel.depth <= 0.0:
        return texel.force, texel.slope
    decay = math.exp(-texel.depth / length)
    return texel.force - pull * (1.0 - decay), texel.slope - pull * decay / length


def unloading(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f − F u c``: u goes to 1 on the way out and to 0 on the way in, c grows with the time of contact (or is 1).

    State: u, the depth at the end of the last step, c. Constants: F, D, the share of 1 − c that is left after the step, lower
    bound of c.
    """
    pull, length = constants[0], constants[1]
    if texel.depth <= 0.0:
        if commit:
            state[0], state[1], state[2] = 0.0, 0.0, 0.0
        return texel.force, texel.slope
    change = texel.depth - state[1]
    aim = 0.0 if change >= 0.0 else 1.0
    u = aim + (state[0] - aim) * math.exp(-abs(change) / length)
    aged = 1.0 - (1.0 - state[2]) * constants[2]
    c = max(aged, constants[3])
    if commit:
        state[0], state[1], state[2] = u, texel.depth, aged
    pull = pull * c
    return texel.force - pull * u, texel.slope + pull * abs(aim - u) / length


def cohesive(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f − F u x exp(1 − x)``, x = d/D: on the way out the last of the depth is a cohesive zone that opens.

    ``du/dt = (aim − u) |ḋ|/D − u/τ`` is solved exactly over a step: u goes to 1 on the way out, to 0 on the way in, and fades
    in time. State: u, the depth at the end of the last step. Constants: F, D, the length of the step divided by τ.
    """
    pull, length, fading = constants[0], constants[1], constants[2]
    if texel.depth <= 0.0:
        if commit:
            state[0], state[1] = 0.0, 0.0
        return texel.force, texel.slope
    change, x = texel.depth - state[1], texel.depth / length
    aim, path = 0.0 if change >= 0.0 else 1.0, abs(change) / length
    rate = path + fading
    end, end_slope = (aim * path / rate, aim * fading / (rate * rate)) if rate > 0.0 else (0.0, 0.0)
    u = end + (state[0] - end) * math.exp(-rate)
    if commit:
        state[0], state[1] = u, texel.depth
    traction = x * math.exp(1.0 - x)
    u_slope = end - u - end_slope * math.expm1(-rate)  # du by the path; on the way out the path grows as the depth shrinks
    bend = u * (1.0 - x) * math.exp(1.0 - x) + (1.0 - 2.0 * aim) * u_slope * traction
    return texel.force - pull * u * traction, texel.slope - pull * bend / length


def _with_time(values: Values, dt: np.ndarray) -> np.ndarray:
    same = constants_from("pull", "depth")(values, dt)
    return np.column_stack([same, np.exp(-np.asarray(dt) / scalar(values, "time")), np.zeros(len(dt))])


def _relaxing(values: Values, dt: np.ndarray) -> np.ndarray:
    return np.column_stack([constants_from("pull", "depth")(values, dt), np.asarray(dt) / scalar(values, "time")])


_PULL = Parameter("pull", "N", 0.02, 0.0, 100.0, "Largest pull F of one texel.", neutral=0.0)
_ZONE = Parameter("depth", "m", 2e-4, 1e-6, 0.02, "Depth D of the largest pull, before contact ends.", log=True)
_WAY = Parameter("depth", "m", 2e-4, 1e-6, 0.02, "Retraction D after which the pull has reached 63 %.", log=True)


KIND = Kind(
    name="adhesion",
    title="Adhesion",
    text="The surfaces stick: the force falls below the spring's, and may pull.",
    site="pad",
    order=50,
    forms=(
        Form(
            "unloading",
            "f = f₀ − F u,  u → 1 during unloading, → 0 during loading, within D",
            "Johnson, Kendall and Roberts, Proc. R. Soc. A 324 (1971): contact is held longer than it was made",
            (_PULL, _WAY),
            law=unloading,
            constants=constants_from("pull", "depth", 1.0, 1.0),
            state_size=3,
            after_clip=True,
        ),
        Form(
            "constant",
            "f = f₀ − F · (1 − exp(−d/D))",
            "Derjaguin, Muller and Toporov, J. Colloid Interface Sci. 53 (1975)",
            (_PULL, Parameter("depth", "m", 1e-4, 1e-6, 0.02, "Depth D at which the pull has reached 63 %.", log=True)),
            law=constant,
            after_clip=True,
        ),
        Form(
            "dwell",
            "f = f₀ − F u c,  c = 1 − exp(−t/τ) after the time t of contact",
            "Chaudhury and Whitesides, Langmuir 7 (1991): hysteresis of adhesion",
            (
                _PULL,
                _WAY,
                Parameter("time", "s", 2.0, 0.01, 1000.0, "Contact time τ after which the pull has reached 63 %.", log=True),
            ),
            law=unloading,
            constants=_with_time,
            state_size=3,
            after_clip=True,
        ),
        Form(
            "cohesive",
            "f = f₀ − F u x exp(1 − x),  x = d/D,  u as in unloading",
            "Rose, Ferrante and Smith, Phys. Rev. Lett. 47 (1981); Xu and Needleman, Model. Simul. Mater. Sci. Eng. 1 (1993): "
            "traction over separation",
            (_PULL, _ZONE),
            law=cohesive,
            constants=constants_from("pull", "depth", 0.0),
            state_size=2,
            after_clip=True,
        ),
        Form(
            "relaxing",
            "as cohesive, but u fades within τ at rest",
            "Maugis and Barquins, J. Phys. D 11 (1978): the faster surfaces part, the more adhesion takes",
            (_PULL, _ZONE, Parameter("time", "s", 0.1, 1e-3, 1000.0, "Time constant τ of the decay at rest.", log=True)),
            law=cohesive,
            constants=_relaxing,
            state_size=2,
            after_clip=True,
        ),
    ),
    experiment="retract slowly after contacts of one second and one minute, and record beyond the release",
    drawing=Drawing(
        "depth",
        depth=0.0002 * np.interp(np.linspace(0, 20, 2001), [0, 10, 20], [0.0, 1.0, 0.0]),
        values={
            "unloading": {"depth": 3e-5},
            "constant": {"depth": 3e-5},
            "dwell": {"depth": 3e-5, "time": 30.0},
            "cohesive": {"pull": 0.06, "depth": 4e-5},
            "relaxing": {"pull": 0.06, "depth": 4e-5, "time": 2.0},
        },
    ),
    known_from=("unloading",),
    signature="pull",
)
