# SPDX-License-Identifier: GPL-3.0-or-later
"""The first cycles are stiffer than the later ones (Mullins' effect)."""

from __future__ import annotations

import math

import numpy as np

from ...model.parameter import Parameter
from ..engine.specification import Drawing, Form, Kind, TexelInput, cycles


def ogden_roxburgh(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f η``, ``η = 1 − s · erf((1 − W/Wm) / b)``, with W = f d / 2 and Wm the largest so far. State: Wm. Constants: s, b."""
    share, width, most = constants[0], constants[1], state[0]
    work = 0.5 * texel.force * texel.depth
    if work >= most:
        if commit:
            state[0] = work
        return texel.force, texel.slope
    x = (1.0 - work / most) / width
    eta = 1.0 - share * math.erf(x)
    rise = 0.5 * (texel.slope * texel.depth + texel.force) / (most * width)
    eta_slope = share * 2.0 / math.sqrt(math.pi) * math.exp(-x * x) * rise
    return texel.force * eta, texel.slope * eta + texel.force * eta_slope


def peak(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f · (1 − s · (1 − exp(−dm/D)))`` with dm the largest depth so far. State: dm. Constants: s, D."""
    share, length = constants[0], constants[1]
    most = max(state[0], texel.depth)
    decay = math.exp(-most / length)
    factor = 1.0 - share * (1.0 - decay)
    factor_slope = -share * decay / length if texel.depth >= state[0] else 0.0
    if commit:
        state[0] = most
    return texel.force * factor, texel.slope * factor + texel.force * factor_slope


def path(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``f · (1 − s · (1 − exp(−p/P)))`` with p the path pressed in so far, over all cycles.

    State: p, the depth at the end of the last step. Constants: s, P.
    """
    share, length = constants[0], constants[1]
    more = max(texel.depth - state[1], 0.0)
    decay = math.exp(-(state[0] + more) / length)
    factor = 1.0 - share * (1.0 - decay)
    factor_slope = -share * decay / length if more > 0.0 else 0.0
    if commit:
        state[0] += more
        state[1] = texel.depth
    return texel.force * factor, texel.slope * factor + texel.force * factor_slope


_SHARE = Parameter("share", "1", 0.25, 0.0, 0.9, "Largest share s of the force that is lost.", neutral=0.0)


_TWICE = np.linspace(0, 20, 2001)
OVER_WITHIN = 0.4
"""Largest path of a softening, as a share of the path that texels are pressed in along a session: by its end 92 % of the loss
is over. What still goes on is wear."""


KIND = Kind(
    name="softening",
    title="Softening",
    text="The first press is stiffer than later ones.",
    site="pad",
    order=10,
    forms=(
        Form(
            "ogden-roxburgh",
            "f = fₑ · (1 − s · erf((1 − W/Wₘ) / b)),  W = fₑ d / 2, Wₘ the largest W so far",
            "Ogden and Roxburgh, Proc. R. Soc. A 455 (1999), without their constant m",
            (_SHARE, Parameter("width", "1", 0.5, 0.05, 3.0, "Width b of the transition back to the first curve.")),
            law=ogden_roxburgh,
            state_size=1,
        ),
        Form(
            "peak",
            "f = fₑ · (1 − s · (1 − exp(−dₘ/D))),  dₘ the largest depth so far",
            "Simo, Comput. Methods Appl. Mech. Eng. 60 (1987): damage by the largest strain",
            (_SHARE, Parameter("depth", "m", 0.002, 1e-5, 0.1, "Depth D that causes 63 % of the loss.", log=True)),
            law=peak,
            state_size=1,
            fitted_up_to={"share": 0.6},  # a softening that leaves nothing is wear
        ),
        Form(
            "path",
            "f = fₑ · (1 − s · (1 − exp(−p/P))),  p all the way pressed in so far",
            "Miehe, Eur. J. Mech. A 14 (1995): continuous damage by the arc length of the strain",
            (
                _SHARE,
                Parameter("path", "m", 0.01, 1e-5, 10.0, "Path P, over all cycles, that causes 63 % of the loss.", log=True),
            ),
            law=path,
            state_size=2,
            fitted_up_to={"share": 0.5},
            over_within={"path": OVER_WITHIN},
        ),
    ),
    experiment="press the same spot ten times equally deep, then deeper, and again after an hour",
    drawing=Drawing("depth", depth=cycles(2, _TWICE) * np.where(_TWICE < 10, 0.7, 1.0), values={"peak": {"depth": 0.001}}),
    known_from=("unloading", "cycles"),
    signature="end",
)
