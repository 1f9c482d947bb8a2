# SPDX-License-Identifier: GPL-3.0-or-later
"""The elastic force grows faster than the depth.

Each law multiplies the force by a factor ≥ 1 that depends only on the depth.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.parameter import Parameter
from ..engine.specification import Drawing, Form, Kind, TexelInput


def polynomial(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``1 + (d/D)^p``. Constants: D, p."""
    length, exponent = constants[0], constants[1]
    if texel.depth <= 0.0:
        return texel.force, texel.slope
    share = (texel.depth / length) ** exponent
    return texel.force * (1.0 + share), texel.slope * (1.0 + share) + texel.force * share * exponent / texel.depth


def exponential(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``(exp(x) − 1) / x`` with ``x = d/D``; past x = 30 the factor continues along its tangent. Constants: D."""
    length = constants[0]
    x = texel.depth / length
    if x < 1e-4:
        factor, factor_slope = 1.0 + 0.5 * x, 0.5 + x / 3.0
    else:
        y = min(x, 30.0)
        factor = math.expm1(y) / y
        factor_slope = (math.exp(y) - factor) / y
        factor += factor_slope * (x - y)
    return texel.force * factor, texel.slope * factor + texel.force * factor_slope / length


def foam(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``1 / (1 − x^p)`` with ``x = d/L``; past x = 0.95 the factor continues along its tangent. Constants: L, p."""
    length, exponent = constants[0], constants[1]
    x = texel.depth / length
    if x <= 0.0:
        return texel.force, texel.slope
    y = min(x, 0.95)
    share = y**exponent
    factor = 1.0 / (1.0 - share)
    factor_slope = factor * factor * exponent * share / y
    factor += factor_slope * (x - y)
    return texel.force * factor, texel.slope * factor + texel.force * factor_slope / length


def bilinear(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """``1 + g w (s((d−D)/w) − s(−D/w)) / d`` with ``s(x) = ln(1 + exp x)`` and ``w = D/p``. Constants: D, g, p."""
    knee, growth, sharpness = constants[0], constants[1], constants[2]
    depth = texel.depth
    if depth <= 0.0:
        return texel.force, texel.slope
    width = knee / sharpness
    x = (depth - knee) / width
    risen = max(x, 0.0) + math.log1p(math.exp(-abs(x))) - math.log1p(math.exp(-sharpness))
    share = growth * width * risen / depth
    factor_slope = (growth * 0.5 * (1.0 + math.tanh(0.5 * x)) - share) / depth
    return texel.force * (1.0 + share), texel.slope * (1.0 + share) + texel.force * factor_slope


_DOUBLE = Parameter(
    "depth", "m", 0.004, 1e-4, 0.1, "Depth D at which the force is twice the linear one.", log=True, neutral=math.inf
)
_POWER = Parameter("exponent", "1", 1.0, 0.5, 4.0, "Exponent p: 1 adds a quadratic force, 2 a cubic one.")


KIND = Kind(
    name="stiffening",
    title="Stiffening",
    text="The stiffness grows with the depth.",
    site="contact",
    order=10,
    forms=(
        Form(
            "polynomial",
            "f = k d · (1 + (d/D)ᵖ)",
            "Rusch, J. Appl. Polym. Sci. 13 (1969): load of flexible foams with a power of the compression",
            (_DOUBLE, _POWER),
            law=polynomial,
        ),
        Form(
            "exponential",
            "f = k D · (exp(d/D) − 1)",
            "Fung, Biomechanics (1993), section 7.5: exponential stress-strain law of soft tissue",
            (
                Parameter(
                    "depth", "m", 0.004, 1e-4, 0.1, "Depth D by which the stiffness grows e-fold.", log=True, neutral=math.inf
                ),
            ),
            law=exponential,
        ),
        Form(
            "foam",
            "f = k d / (1 − (d/L)ᵖ)",
            "Gibson and Ashby, Cellular Solids (1997), chapter 5: densification",
            (
                Parameter("depth", "m", 0.01, 2e-4, 0.1, "Depth L at which the cells are closed.", log=True, neutral=math.inf),
                Parameter("exponent", "1", 2.0, 0.1, 8.0, "Exponent p of the densification."),
            ),
            law=foam,
        ),
        Form(
            "bilinear",
            "f = k (d + g w (s((d − D)/w) − s(−D/w))),  s(x) = ln(1 + eˣ),  w = D/p",
            "Shaw and Holmes, J. Sound Vib. 90 (1983): piecewise linear spring, with a rounded knee",
            (
                Parameter("depth", "m", 0.002, 1e-4, 0.1, "Depth D of the knee.", log=True),
                Parameter("growth", "1", 1.0, 0.0, 10.0, "Growth g of the stiffness beyond the knee, as a share.", neutral=0.0),
                Parameter("sharpness", "1", 3.0, 0.2, 60.0, "Sharpness p of the knee.", log=True),
            ),
            law=bilinear,
            error=0.005,  # of other formulas it leaves 0.001 in the middle, 0.009 at most (benchmarks/RESULTS.md)
        ),
    ),
    experiment="press slowly to the largest permitted depth",
    drawing=Drawing("depth", depth=np.linspace(0, 0.004, 400)),
    families=("nonlinear",),
)
