# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of the contact law of one contact point, as the compiled formulas take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiled.kernels import kernel
from ..model.sensor_parameters import HUNT_CROSSLEY, SensorParameters

LINEAR_EXPONENT = 0.0
"""Exponent that stands for the linear normal law (Eq. 8). Any other exponent is that of Hunt and Crossley's law."""


class ContactLaw(NamedTuple):
    """Parameters of the normal law and of LuGre friction at one contact point.

    Attributes
    ----------
    k : float, N/m (N/mᵖ with Hunt and Crossley's law)
        Stiffness.
    cn, ct : float, N·s/m
        Damping along the normal, and viscous friction.
    sigma0, sigma1 : float, N/m and N·s/m
        Stiffness and damping of the bristles.
    x0 : float, m/s
        Stribeck speed.
    mus, mud : float
        Coefficients of static and of kinetic friction.
    exponent : float
        Exponent p of Hunt and Crossley's law; :data:`LINEAR_EXPONENT` for Eq. 8.
    dissipation : float, s/m
        Coefficient α of Hunt and Crossley's law.
    """

    k: float
    cn: float
    ct: float
    sigma0: float
    sigma1: float
    x0: float
    mus: float
    mud: float
    exponent: float
    dissipation: float


def contact_law(parameters: SensorParameters, force_share: float = 1.0, overlap_share: float = 1.0) -> ContactLaw:
    """Return the law of one contact point of a sensor.

    Parameters
    ----------
    parameters : SensorParameters
        Of a whole texel.
    force_share : float
        Share of the texel's force that this contact point contributes.
    overlap_share : float
        Share of the overlap, its rate and the tangential displacement that the sensor's own skin takes
        (see :mod:`.series_compliance`).
    """
    p, part = parameters, float(overlap_share)
    scale = force_share * part
    exponent = float(p.exponent) if p.normal_law == HUNT_CROSSLEY else LINEAR_EXPONENT
    k, dissipation = p.k * scale, float(p.dissipation)
    if exponent != LINEAR_EXPONENT:
        k *= part ** (exponent - 1.0)
        dissipation *= part
    return ContactLaw(
        k=float(k),
        cn=float(p.cn * scale),
        ct=float(p.ct * scale),
        sigma0=float(p.sigma0 * scale),
        sigma1=float(p.sigma1 * scale),
        x0=p.x0 / part,
        mus=float(p.mus),
        mud=float(p.mud),
        exponent=exponent,
        dissipation=dissipation,
    )


@kernel
def read_law(table: np.ndarray, row: int) -> ContactLaw:
    """Return the law in a row of a table whose columns are the fields of :class:`ContactLaw`."""
    return ContactLaw(
        table[row, 0], table[row, 1], table[row, 2], table[row, 3], table[row, 4],
        table[row, 5], table[row, 6], table[row, 7], table[row, 8], table[row, 9],
    )  # fmt: skip


@kernel
def scaled_law(law: ContactLaw, stiffness: float, friction: float) -> ContactLaw:
    """Return a law whose normal stiffness and damping, and whose friction coefficients, are multiplied by a factor each."""
    return ContactLaw(
        law.k * stiffness, law.cn * stiffness, law.ct, law.sigma0, law.sigma1, law.x0,
        law.mus * friction, law.mud * friction, law.exponent, law.dissipation,
    )  # fmt: skip


@kernel
def with_friction(law: ContactLaw, factor: float, extra_viscosity: float) -> ContactLaw:
    """Return a law whose friction coefficients are multiplied by `factor`, with `extra_viscosity` (N·s/m) added to `ct`."""
    return ContactLaw(
        law.k, law.cn, law.ct + extra_viscosity, law.sigma0, law.sigma1, law.x0,
        factor * law.mus, factor * law.mud, law.exponent, law.dissipation,
    )  # fmt: skip


@kernel
def whole_texel_law(law: ContactLaw, force_share: float, overlap_share: float) -> ContactLaw:
    """Return the normal law of a whole texel, given that of one contact point and its shares (see :func:`contact_law`)."""
    stiff = overlap_share if law.exponent == LINEAR_EXPONENT else overlap_share**law.exponent
    return ContactLaw(
        law.k / (force_share * stiff), law.cn / (force_share * overlap_share), law.ct, law.sigma0, law.sigma1, law.x0,
        law.mus, law.mud, law.exponent, law.dissipation / overlap_share,
    )  # fmt: skip
