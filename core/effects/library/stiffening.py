# SPDX-License-Identifier: GPL-3.0-or-later
"""The deeper, the stiffer: an elastic force that grows faster than the depth.

Each law multiplies the force that comes in by a factor ≥ 1 of the depth alone.
"""

from __future__ import annotations

import math

from ...model.parameter import Parameter
from ..engine.specification import Form, Kind, constants_from


def polynomial(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``1 + (d/D)^p``."""
    if depth <= 0.0:
        return force, slope
    share = (depth / numbers[row, 0]) ** numbers[row, 1]
    return force * (1.0 + share), slope * (1.0 + share) + force * share * numbers[row, 1] / depth


def exponential(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``(exp(x) − 1) / x`` with ``x = d/D``; past x = 30 the factor goes on along its tangent."""
    x = depth / numbers[row, 0]
    if x < 1e-4:
        factor, steep = 1.0 + 0.5 * x, 0.5 + x / 3.0
    else:
        y = min(x, 30.0)
        factor = math.expm1(y) / y
        steep = (math.exp(y) - factor) / y
        factor += steep * (x - y)
    return force * factor, slope * factor + force * steep / numbers[row, 0]


def foam(force, slope, depth, slide, numbers, row, memory, point, at, commit):
    """``1 / (1 − x^p)`` with ``x = d/L``; past x = 0.95 the factor goes on along its tangent."""
    x = depth / numbers[row, 0]
    if x <= 0.0:
        return force, slope
    y = min(x, 0.95)
    share = y ** numbers[row, 1]
    factor = 1.0 / (1.0 - share)
    steep = factor * factor * numbers[row, 1] * share / y
    factor += steep * (x - y)
    return force * factor, slope * factor + force * steep / numbers[row, 0]


_DOUBLE = Parameter("depth", "m", 0.004, 1e-4, 0.1, "Depth D at which the force is twice that of the linear spring.", log=True)
_POWER = Parameter("exponent", "1", 1.0, 0.5, 4.0, "How suddenly it sets in: 1 is a quadratic force, 2 a cubic one.")

KIND = Kind(
    name="stiffening",
    title="Stiffening",
    text="Gets stiffer the deeper it is pressed.",
    site="contact",
    order=10,
    forms=(
        Form(
            "polynomial",
            "f = k d · (1 + (d/D)ᵖ)",
            "Rusch, J. Appl. Polym. Sci. 13 (1969): load of flexible foams with a power of the compression",
            (_DOUBLE, _POWER),
            neutral={"depth": math.inf},
            law=polynomial,
            constants=constants_from("depth", "exponent"),
        ),
        Form(
            "exponential",
            "f = k D · (exp(d/D) − 1)",
            "Fung, Biomechanics (1993), section 7.5: exponential stress-strain law of soft tissue",
            (Parameter("depth", "m", 0.004, 1e-4, 0.1, "Depth D by which the stiffness grows e-fold.", log=True),),
            neutral={"depth": math.inf},
            law=exponential,
            constants=constants_from("depth"),
        ),
        Form(
            "foam",
            "f = k d / (1 − (d/L)ᵖ)",
            "Gibson and Ashby, Cellular Solids (1997), chapter 5: densification",
            (
                Parameter("depth", "m", 0.01, 2e-4, 0.1, "Depth L at which the foam's cells are closed.", log=True),
                Parameter("exponent", "1", 2.0, 0.5, 8.0, "How suddenly it densifies."),
            ),
            neutral={"depth": math.inf},
            law=foam,
            constants=constants_from("depth", "exponent"),
        ),
    ),
)
