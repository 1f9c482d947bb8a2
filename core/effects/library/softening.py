# SPDX-License-Identifier: GPL-3.0-or-later
"""The first cycles are stiffer than the later ones: what has been pressed once gives way more easily (Mullins' effect)."""

from __future__ import annotations

import math

from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, constants_from


def ogden_roxburgh(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f η``, ``η = 1 − s · erf((1 − W/Wm) / b)``, with W = f d / 2 and Wm the largest so far. Memory: Wm."""
    work = 0.5 * force * depth
    most = memory[point, at]
    if work >= most:
        if commit:
            memory[point, at] = work
        return force, slope
    x = (1.0 - work / most) / numbers[row, 1]
    eta = 1.0 - numbers[row, 0] * math.erf(x)
    rise = 0.5 * (slope * depth + force) / (most * numbers[row, 1])
    steep = numbers[row, 0] * 2.0 / math.sqrt(math.pi) * math.exp(-x * x) * rise
    return force * eta, slope * eta + force * steep


def peak(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f · (1 − s · (1 − exp(−dm/D)))`` with dm the largest depth so far. Memory: dm."""
    most = max(memory[point, at], depth)
    left = math.exp(-most / numbers[row, 1])
    factor = 1.0 - numbers[row, 0] * (1.0 - left)
    steep = -numbers[row, 0] * left / numbers[row, 1] if depth >= memory[point, at] else 0.0
    if commit:
        memory[point, at] = most
    return force * factor, slope * factor + force * steep


def path(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``f · (1 − s · (1 − exp(−p/P)))`` with p the way pressed in so far, all pressings together. Memory: p, the last depth."""
    more = max(depth - memory[point, at + 1], 0.0)
    left = math.exp(-(memory[point, at] + more) / numbers[row, 1])
    factor = 1.0 - numbers[row, 0] * (1.0 - left)
    steep = -numbers[row, 0] * left / numbers[row, 1] if more > 0.0 else 0.0
    if commit:
        memory[point, at] += more
        memory[point, at + 1] = depth
    return force * factor, slope * factor + force * steep


_SHARE = Parameter("share", "1", 0.25, 0.0, 0.9, "Share s of the force that is lost at most.")

KIND = Kind(
    name="softening",
    title="Softening",
    text="Is stiff when pressed for the first time and softer in the cycles after it.",
    site="pad",
    order=10,
    forms=(
        Form(
            "ogden-roxburgh",
            "f = fₑ · (1 − s · erf((1 − W/Wₘ) / b)),  W = fₑ d / 2, Wₘ the largest W so far",
            "Ogden and Roxburgh, Proc. R. Soc. A 455 (1999), without their constant m",
            (_SHARE, Parameter("width", "1", 0.5, 0.05, 3.0, "Width b of the way back to the first curve.")),
            neutral={"share": 0.0},
            law=ogden_roxburgh,
            constants=constants_from("share", "width"),
            memory=1,
        ),
        Form(
            "peak",
            "f = fₑ · (1 − s · (1 − exp(−dₘ/D))),  dₘ the largest depth so far",
            "Simo, Comput. Methods Appl. Mech. Eng. 60 (1987): damage by the largest strain",
            (_SHARE, Parameter("depth", "m", 0.002, 1e-5, 0.1, "Depth D that does 63 % of it.", log=True)),
            neutral={"share": 0.0},
            law=peak,
            constants=constants_from("share", "depth"),
            memory=1,
        ),
        Form(
            "path",
            "f = fₑ · (1 − s · (1 − exp(−p/P))),  p all the way pressed in so far",
            "Miehe, Eur. J. Mech. A 14 (1995): continuous damage by the arc length of the strain",
            (_SHARE, Parameter("path", "m", 0.01, 1e-5, 10.0, "Way P, over all cycles, that does 63 % of it.", log=True)),
            neutral={"share": 0.0},
            law=path,
            constants=constants_from("share", "path"),
            memory=2,
        ),
    ),
)
