# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of the contact law of one contact point, as the compiled formulas take them."""

from __future__ import annotations

from collections import namedtuple
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..compiled.kernels import kernel
from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..model.sensor_parameters import HUNT_CROSSLEY, LAW_PARAMETERS, SensorParameters

if TYPE_CHECKING:
    from typing import Self

LINEAR_EXPONENT = 0.0
"""Exponent that stands for the linear normal law (Eq. 8). Any other exponent is that of Hunt and Crossley's law."""


if TYPE_CHECKING:

    class ContactLaw(tuple[float, ...]):
        """Parameters of the normal law and of LuGre friction at one contact point.

        The fields are :data:`.LAW_PARAMETERS`, in their order and with the units and meanings that
        :class:`.SensorParameters` specifies, but for one contact point of a texel. `exponent` is :data:`LINEAR_EXPONENT`
        for Eq. 8.
        """

        _fields: ClassVar[tuple[str, ...]]

        def __new__(cls, *values: float, **named: float) -> Self: ...  # noqa: D102
        def __getattr__(self, parameter: str) -> float: ...

else:
    ContactLaw = namedtuple("ContactLaw", LAW_PARAMETERS)


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
        (see :mod:`.contact_law`).
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


# Sensor against sensor: two soft skins share the overlap as springs in series.
#
# A texel's segment meets the other sensor's undeformed surface. With the stiffness per area m = k / (area of a texel) of the
# two skins, a sensor's own skin takes the share m' / (m + m') of the overlap, so that both measure the same pressure. Where
# each sensor has the other as a target, the force between them is computed twice, once by the texels of either; each
# computation then moves the bodies with half its force.


def stiffness_per_area(sensor: Sensor) -> float:
    """Stiffness of a sensor's skin per area, N/m³ (for Hunt and Crossley's law N/m²⁺ᵖ)."""
    return sensor.parameters.k * len(sensor.texels) / float(sensor.texels.area.sum())


def overlap_share(sensor: Sensor, other: Sensor) -> float:
    """Share of the overlap with another sensor that the sensor's own skin takes."""
    power = 1.0 / sensor.parameters.exponent if sensor.parameters.normal_law == HUNT_CROSSLEY else 1.0
    own, others = stiffness_per_area(sensor) ** power, stiffness_per_area(other) ** power
    return others / (own + others)


def coupling(scenario: Scenario, sensor: int, target: int) -> tuple[float, float]:
    """Return how a sensor and one of its targets share overlap and force.

    Returns
    -------
    overlap_share : float
        Share of the overlap that the sensor's own skin takes; 1 for a hard target.
    force_weight : float
        Factor with which the sensor's force moves the bodies: 1/2 when the target is a sensor that has this one as its
        target too, else 1.
    """
    other = scenario.targets[target].sensor
    if other is None:
        return 1.0, 1.0
    mutual = any(
        candidate.sensor == sensor and candidate.body != scenario.sensors[other].body for candidate in scenario.targets
    )
    return overlap_share(scenario.sensors[sensor], scenario.sensors[other]), 0.5 if mutual else 1.0
