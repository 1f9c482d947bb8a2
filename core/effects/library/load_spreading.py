# SPDX-License-Identifier: GPL-3.0-or-later
"""A cover spreads the load: each texel's force is shared with its neighbours, and the sum stays what it was."""

from __future__ import annotations

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.mixing import Mixing, mixing
from ..engine.specification import Form, Kind, Site, number


def gaussian(values: Values, site: Site) -> Mixing:
    """Weights ``exp(−r²/2s²)``."""
    width = max(number(values, "width"), 1e-9)
    return mixing(site.position, lambda r: np.exp(-0.5 * (r / width) ** 2), 5.0 * width, site.area)


def exponential(values: Values, site: Site) -> Mixing:
    """Weights ``exp(−r/s)``."""
    width = max(number(values, "width"), 1e-9)
    return mixing(site.position, lambda r: np.exp(-r / width), 12.0 * width, site.area)


def half_space(values: Values, site: Site) -> Mixing:
    """Weights ``(1 + r²/h²)^(−5/2)``."""
    thickness = max(number(values, "thickness"), 1e-9)
    return mixing(site.position, lambda r: (1.0 + (r / thickness) ** 2) ** -2.5, 12.0 * thickness, site.area)


_WIDTH = Parameter("width", "m", 0.003, 0.0, 0.1, "How far a point load spreads, s.")

KIND = Kind(
    name="load-spreading",
    title="Load Spreading",
    text="A cover shares the load of a texel with its neighbours, so that small things look wider.",
    stage="readout",
    order=10,
    forms=(
        Form(
            "gaussian",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  w ∝ exp(−r²/2s²), Σᵢ wᵢⱼ = 1",
            "Shimojo, IEEE Trans. Robot. Autom. 13 (1997): a cover as a spatial low-pass filter",
            (_WIDTH,),
            off={"width": 0.0},
            mix=gaussian,
        ),
        Form(
            "exponential",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  w ∝ exp(−r/s), Σᵢ wᵢⱼ = 1",
            "Kerr, J. Appl. Mech. 31 (1964): foundation under a shear layer, whose influence fades exponentially",
            (_WIDTH,),
            off={"width": 0.0},
            mix=exponential,
        ),
        Form(
            "half-space",
            "rᵢ = Σⱼ wᵢⱼ fⱼ,  w ∝ (1 + r²/h²)^(−5/2), Σᵢ wᵢⱼ = 1",
            "Johnson, Contact Mechanics (1985), section 3.2: Boussinesq's stress at depth h under a point load",
            (Parameter("thickness", "m", 0.003, 0.0, 0.1, "Thickness h of the cover above the texels."),),
            off={"thickness": 0.0},
            mix=half_space,
        ),
    ),
)
