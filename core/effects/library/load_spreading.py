# SPDX-License-Identifier: GPL-3.0-or-later
"""A cover spreads the load of each texel among its neighbours. The sum is preserved unless the cover goes on beyond the rim."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.coupling_matrix import Weights, balancing_scale, coupling_matrix, divided
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar


def gaussian(values: Values, transducers: TransducerArray) -> Weights:
    """Weights ``exp(−r²/2s²)``."""
    width = max(scalar(values, "width"), 1e-9)
    return _spread(transducers, lambda r: np.exp(-0.5 * (r / width) ** 2), 5.0 * width)


def exponential(values: Values, transducers: TransducerArray) -> Weights:
    """Weights ``exp(−r/s)``."""
    width = max(scalar(values, "width"), 1e-9)
    return _spread(transducers, lambda r: np.exp(-r / width), 12.0 * width)


def half_space(values: Values, transducers: TransducerArray) -> Weights:
    """Weights ``(1 + r²/h²)^(−5/2)``."""
    thickness = max(scalar(values, "thickness"), 1e-9)
    return _spread(transducers, lambda r: (1.0 + (r / thickness) ** 2) ** -2.5, 12.0 * thickness)


def open_rim(values: Values, transducers: TransducerArray) -> Weights:
    """Weights ``exp(−r²/2s²)`` over their sum on a square lattice that goes on beyond the texels, as their cover does.

    What would fall on texels outside is lost. The pitch of the lattice is the root of a texel's median area.
    """
    width = 2.0**0.5 * scalar(values, "width")
    return stretched_exponential({"width": width, "shape": 2.0, "lost": 1.0, "reflected": 0.0}, transducers)


def stretched_exponential(values: Values, transducers: TransducerArray) -> Weights:
    """Weights ``exp(−(r/s)^q)`` under a cover that ends at the rim, or goes on beyond it.

    What falls beyond the rim of a cover that goes on is lost: the weights are divided by their sum on a square lattice that
    contains the texels. A cover that ends keeps its load. Where its rim reflects, texels give each other the same share, and
    what a texel gives and what it receives sum to one, as in diffusion inside a boundary without flux. Where it does not, the
    weights of each texel are divided by their sum, so that texels at the rim receive less than they give. The shares `lost` and
    `reflected` mix the three. Weights end at :data:`LATTICE_REACH` pitches.
    """
    width, shape = max(scalar(values, "width"), 1e-9), scalar(values, "shape")
    lost, reflected = scalar(values, "lost"), scalar(values, "reflected")
    pitch = float(np.sqrt(np.median(transducers.area)))
    rounding = -np.log(np.finfo(float).eps)  # weights with larger exponents are lost beside the largest one
    reach = min(width * rounding ** (1.0 / shape), LATTICE_REACH * pitch)

    def weight(distance: np.ndarray) -> np.ndarray:
        return np.where(distance <= reach, np.exp(-((distance / width) ** shape)), 0.0)

    weights = coupling_matrix(transducers.position, weight, reach, None)
    distance, count = _lattice()
    whole, own = count @ weight(distance * pitch), weights.sum(axis=0)
    one_way, both_ways = lost / whole + (1.0 - lost) * (1.0 - reflected) / own, (1.0 - lost) * reflected
    if both_ways == 0.0:
        return divided(weights, lambda _, source: 1.0 / one_way[source])
    scale = balancing_scale(weights)
    return divided(weights, lambda target, source: 1.0 / (one_way[source] + both_ways * scale[target] * scale[source]))


@cache
def _lattice() -> tuple[np.ndarray, np.ndarray]:
    """Distances that occur on a square lattice of pitch 1 up to :data:`LATTICE_REACH`, and how many points have them."""
    near = np.arange(-LATTICE_REACH, LATTICE_REACH + 1.0)
    square = (near[:, None] ** 2 + near[None] ** 2).ravel()
    found, count = np.unique(square[square <= LATTICE_REACH**2], return_counts=True)
    return np.sqrt(found), count.astype(float)


def _spread(transducers: TransducerArray, weight: Callable[[np.ndarray], np.ndarray], reach: float) -> Weights:
    """Weights that preserve the sum, with which all texels count alike.

    They are equally stiff, so the smaller area of a vertex at the rim of a mesh takes no smaller share. As one number for all
    it changes nothing.
    """
    return coupling_matrix(transducers.position, weight, reach, np.full_like(transducers.area, np.median(transducers.area)))


LATTICE_REACH = 40
"""Distance, in pitches, at which a stretched exponential ends."""
_WIDTH = Parameter("width", "m", 0.003, 0.0, 0.1, "Spread s of a point load.", neutral=0.0)


KIND = Kind(
    name="load-spreading",
    title="Load Spreading",
    text="A cover shares the load of a texel with its neighbours.",
    site="readout",
    order=10,
    forms=(
        Form(
            "gaussian",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  w ∝ exp(−r²/2s²), Σᵢ wᵢⱼ = 1",
            "Shimojo, IEEE Trans. Robot. Autom. 13 (1997): a cover as a spatial low-pass filter",
            (_WIDTH,),
            coupling=gaussian,
        ),
        Form(
            "exponential",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  w ∝ exp(−r/s), Σᵢ wᵢⱼ = 1",
            "Kerr, J. Appl. Mech. 31 (1964): foundation under a shear layer, whose influence fades exponentially",
            (_WIDTH,),
            coupling=exponential,
        ),
        Form(
            "half-space",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  w ∝ (1 + r²/h²)^(−5/2), Σᵢ wᵢⱼ = 1",
            "Johnson, Contact Mechanics (1985), section 3.2: Boussinesq's stress at depth h under a point load",
            (Parameter("thickness", "m", 0.003, 0.0, 0.1, "Thickness h of the cover above the texels.", neutral=0.0),),
            coupling=half_space,
        ),
        Form(
            "open",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  wᵢⱼ = exp(−r²/2s²) / Σ exp(−r²/2s²) over all lattice points",
            "Shimojo, IEEE Trans. Robot. Autom. 13 (1997): under a cover that is wider than the array: loads leave at the rim",
            (_WIDTH,),
            coupling=open_rim,
        ),
        Form(
            "stretched-exponential",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  w ∝ exp(−(r/s)^q),  Σᵢ wᵢⱼ = 1 over the texels, in part with Σⱼ wᵢⱼ = 1, or over a lattice",
            "Diggle and Ribeiro, Model-based Geostatistics (2007), section 3.4: the powered exponential family; Sinkhorn and "
            "Knopp, Pacific J. Math. 21 (1967)",
            (
                _WIDTH,
                Parameter("shape", "1", 1.5, 0.4, 8.0, "Exponent q of the distance: 1 has a cusp, 2 is a Gaussian, 8 is flat."),
                Parameter(
                    "lost", "1", 1.0, 0.0, 1.0, "Share that is lost of the load which falls beyond the rim.", neutral=0.0
                ),
                Parameter(
                    "reflected", "1", 0.0, 0.0, 1.0, "Share of what is kept that texels give each other alike.", neutral=0.0
                ),
            ),
            coupling=stretched_exponential,
            error=0.005,  # at most, of five kernels of 0.5 to 1.2 pitches on two pads, kept or lost (benchmarks/RESULTS.md)
        ),
    ),
    experiment="press single texels with a pin narrower than a texel",
    drawing=Drawing("row"),
    known_from=("places",),
)
