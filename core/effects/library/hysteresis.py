# SPDX-License-Identifier: GPL-3.0-or-later
"""Loading and unloading follow different curves, however slowly they happen.

Laws on the force dissipate energy: the unloading curve lies below the loading curve. Their state is reset when the contact is
released. Laws on the reading describe transducers that trail behind the load: the reading is too low while the load rises and
too high while it falls.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TexelInput, cycles, scalar

ELEMENTS = 4
"""Number of elements of the operators; their thresholds are spread evenly around the given one."""


def duhem(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f (1 + h z)`` with ``dz/dd = (±1 − z) / D``, plus on the way in.

    State: z, the depth at the end of the last step. Constants: h, D.
    """
    width, length = constants[0], constants[1]
    z, change = state[0], texel.depth - state[1]
    aim = 1.0 if change >= 0.0 else -1.0
    decay = math.exp(-abs(change) / length)
    z = aim + (z - aim) * decay
    if commit:
        state[0] = z if texel.depth > 0.0 else 0.0
        state[1] = texel.depth
    factor = 1.0 + width * z
    return texel.force * factor, texel.slope * factor + texel.force * width * (1.0 - aim * z) / length


def bouc_wen(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``(1 − a) f + a z`` with ``dz = df − (β |df| z + γ df |z|) / Y``, β + γ = 1; piecewise exponential, hence exact.

    Let u = ±z along the direction in which the force changes. It grows by 1 − u/Y above zero and by 1 − (β − γ) u/Y below.
    State: z, the force at the end of the last step. Constants: a, Y, β.
    """
    share, yield_force, below = constants[0], constants[1], 2.0 * constants[2] - 1.0
    change = texel.force - state[1]
    direction = 1.0 if change >= 0.0 else -1.0
    u, path = direction * state[0], abs(change)
    if u < 0.0:
        to_zero = -u
        if below * -u > 1e-9 * yield_force:
            to_zero = yield_force / below * math.log1p(-below * u / yield_force)
        if path < to_zero:
            if below * -u > 1e-9 * yield_force:
                top = yield_force / below
                u = top + (u - top) * math.exp(-path / top)
            else:
                u += path
            path = 0.0
        else:
            u, path = 0.0, path - to_zero
    if u >= 0.0:
        u = yield_force + (u - yield_force) * math.exp(-path / yield_force)
        u_slope = 1.0 - u / yield_force
    else:
        u_slope = 1.0 - below * u / yield_force
    if commit:
        state[0] = direction * u if texel.depth > 0.0 else 0.0
        state[1] = texel.force
    return (1.0 - share) * texel.force + share * direction * u, texel.slope * (1.0 - share + share * u_slope)


def maxwell_slip(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``(1 − a) f + a · mean of s_j``, where s_j follows f until it slips at ±r_j.

    State: the force at the end of the last step, then the s_j. Constants: a, how many elements, then the r_j.
    """
    share, count = constants[0], int(constants[1])
    change = texel.force - state[0]
    total, sticking = 0.0, 0.0
    for j in range(count):
        threshold = constants[2 + j]
        s = state[1 + j] + change
        if abs(s) <= threshold:
            sticking += 1.0
        s = min(max(s, -threshold), threshold)
        total += s
        if commit:
            state[1 + j] = s if texel.depth > 0.0 else 0.0
    if commit:
        state[0] = texel.force
    return (1.0 - share) * texel.force + share * total / count, texel.slope * (1.0 - share + share * sticking / count)


def play(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``(1 − a) x + a · mean of p_j``, where x drags p_j along once it is r_j ahead.

    State: the p_j. Constants: a, how many elements, then the r_j.
    """
    share, count = constants[0], int(constants[1])
    total, moving = 0.0, 0.0
    for j in range(count):
        threshold, before = constants[2 + j], state[j]
        p = min(max(before, texel.force - threshold), texel.force + threshold)
        if p != before:
            moving += 1.0
        total += p
        if commit:
            state[j] = p
    return (1.0 - share) * texel.force + share * total / count, texel.slope * (1.0 - share + share * moving / count)


def preisach(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``(1 − a) x + a · mean of p_j``, where p_j stays between x − w_j and x, and above zero.

    Relays that switch on at b + w and off at b, with b spread evenly from zero on, add up to p: it is max(x − w, 0) while x
    rises for the first time. State: the p_j. Constants: a, how many elements, then the w_j.
    """
    share, count = constants[0], int(constants[1])
    total, moving = 0.0, 0.0
    for j in range(count):
        before = state[j]
        p = min(max(before, texel.force - constants[2 + j], 0.0), max(texel.force, 0.0))
        if p != before:
            moving += 1.0
        total += p
        if commit:
            state[j] = p
    return (1.0 - share) * texel.force + share * total / count, texel.slope * (1.0 - share + share * moving / count)


def trailing(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``x (1 − h z)`` with ``dz/dx = (±1 − z) / F``, plus on the way up.

    State: z, the reading x of the last step. Constants: h, F.
    """
    width, scale = constants[0], constants[1]
    change = texel.force - state[1]
    aim = 1.0 if change >= 0.0 else -1.0
    z = aim + (state[0] - aim) * math.exp(-abs(change) / scale)
    if commit:
        state[0] = z
        state[1] = texel.force
    factor = 1.0 - width * z
    return texel.force * factor, texel.slope * (factor - texel.force * width * (1.0 - aim * z) / scale)


def _operators(values: Values, dt: np.ndarray) -> np.ndarray:
    """Return the share, the number of elements, and their thresholds, whose mean is the given one."""
    spread = 2.0 * np.arange(1, ELEMENTS + 1) / (ELEMENTS + 1)
    row = np.concatenate([[scalar(values, "share"), ELEMENTS], scalar(values, "force") * spread])
    return np.tile(row, (len(dt), 1))


def _relays(values: Values, dt: np.ndarray) -> np.ndarray:
    """Return the share, the number of elements, and their widths: quantiles of an exponential distribution of given mean."""
    widths = -np.log1p(-(np.arange(ELEMENTS) + 0.5) / ELEMENTS)
    row = np.concatenate([[scalar(values, "share"), ELEMENTS], scalar(values, "force") * widths / widths.mean()])
    return np.tile(row, (len(dt), 1))


_SHARE = Parameter("share", "1", 0.4, 0.0, 0.95, "Share a of the force in the slip elements.", neutral=0.0)
_FORCE = Parameter("force", "N", 0.05, 1e-6, 1e3, "Force Y at which they slip.", log=True)
_WIDTH = Parameter("width", "1", 0.15, 0.0, 0.9, "Half width h of the loop, as a share of the force.", neutral=0.0)


KIND = Kind(
    name="hysteresis",
    title="Hysteresis",
    text="Loading and unloading differ at the same depth, at any speed.",
    site="pad",
    order=20,
    forms=(
        Form(
            "duhem",
            "f = fₑ · (1 + h z),  dz/dd = (sgn ḋ − z) / D",
            "Visintin, Differential Models of Hysteresis (1994): Duhem; Coleman and Hodgdon, Int. J. Eng. Sci. 24 (1986)",
            (_WIDTH, Parameter("depth", "m", 3e-4, 1e-6, 0.05, "Depth D over which 63 % of the transition happens.", log=True)),
            law=duhem,
            state_size=2,
            fitted_up_to={"width": 0.5},
        ),
        Form(
            "bouc-wen",
            "f = (1 − a) fₑ + a z,  ż = ḟₑ − (β |ḟₑ| z + (1 − β) ḟₑ |z|) / Y",
            "Bouc (1967); Wen, J. Eng. Mech. Div. 102 (1976), with n = 1",
            (
                _SHARE,
                _FORCE,
                Parameter("beta", "1", 0.75, 0.5, 1.0, "Shape β of the loop: share of the yielding on unloading."),
            ),
            law=bouc_wen,
            state_size=2,
        ),
        Form(
            "maxwell-slip",
            "f = (1 − a) fₑ + a · mean of sⱼ,  sⱼ follows fₑ within ±rⱼ",
            "Iwan, J. Appl. Mech. 33 (1966); Al-Bender et al., IEEE Trans. Autom. Control 50 (2005)",
            (_SHARE, _FORCE),
            law=maxwell_slip,
            constants=_operators,
            state_size=1 + ELEMENTS,
        ),
        Form(
            "play",
            "r = (1 − a) f + a · mean of pⱼ,  pⱼ is dragged along rⱼ behind f",
            "Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989); Kuhnen, Eur. J. Control 9 (2003): play operators",
            (
                Parameter("share", "1", 0.4, 0.0, 1.0, "Share a of the reading in the play elements.", neutral=0.0),
                Parameter("force", "N", 0.05, 1e-6, 1e3, "Mean force Y by which they trail.", log=True),
            ),
            law=play,
            constants=_operators,
            state_size=ELEMENTS,
            site="readout",
        ),
        Form(
            "preisach",
            "r = (1 − a) f + a · mean of pⱼ,  pⱼ between f − wⱼ and f, and never below zero",
            "Preisach, Z. Phys. 94 (1935); Mayergoyz, Mathematical Models of Hysteresis (1991): relays of exponential widths",
            (
                Parameter("share", "1", 0.4, 0.0, 1.0, "Share a of the reading in the relays.", neutral=0.0),
                Parameter("force", "N", 0.1, 1e-6, 1e3, "Mean width w between switching on and off.", log=True),
            ),
            law=preisach,
            constants=_relays,
            state_size=ELEMENTS,
            site="readout",
        ),
        Form(
            "trailing",
            "r = f · (1 − h z),  dz/df = (sgn ḟ − z) / F",
            "Visintin, Differential Models of Hysteresis (1994): Duhem's model",
            (_WIDTH, Parameter("force", "N", 0.02, 1e-6, 1e3, "Force F over which 63 % of the transition happens.", log=True)),
            law=trailing,
            state_size=2,
            site="readout",
            fitted_up_to={"width": 0.5},
        ),
    ),
    experiment="load and unload to the same depth at very different speeds (1:100), with partial unloadings",
    drawing=Drawing(
        "depth",
        depth=cycles(1, np.linspace(0, 20, 2001)),
        values={
            "bouc-wen": {"force": 0.6, "share": 0.3},
            "maxwell-slip": {"force": 0.3, "share": 0.6},
            "play": {"force": 0.4},
            "preisach": {"force": 0.5, "share": 0.8},
        },
    ),
    known_from=("unloading", "cycles"),
    families=("loop",),
)
