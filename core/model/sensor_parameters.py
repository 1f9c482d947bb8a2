# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of one texel, and the factors by which painted maps change them from texel to texel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import inf
from typing import Any

import numpy as np

from ..errors import FileError, ParameterError
from .parameter import Choice, ChoiceParameter, Parameter, TextParameter, numbers_of, specifications, specified

LINEAR, HUNT_CROSSLEY = "linear", "hunt-crossley"
NORMAL_LAWS = (
    Choice(LINEAR, "Linear", "k d + cn ḋ (Eq. 8): a spring and a damper"),
    Choice(HUNT_CROSSLEY, "Hunt–Crossley", "k dᵖ (1 + 3/2 α ḋ): no force jump at first touch; e = 1 - α v for slow impacts"),
)
"""The laws of the normal force. The second one (J. Appl. Mech. 42, 1975) has `exponent` and `dissipation`, and no `cn`."""

CONTACT_POINTS = (
    Choice(1, "1", "At the texel's vertex, as in the paper"),
    *(Choice(n * n, f"{n} × {n}", f"{n * n} points in the cell of each texel") for n in range(2, 11)),
)

DEPTH_PER_THICKNESS = 2.0
"""Maximum penetration per thickness of the foam (paper, section 3.3.3)."""
DAMPING_PER_STIFFNESS = 0.01
"""Suggested normal damping per normal stiffness, seconds (paper, section 3.4.1)."""

CONTACT, FRICTION, READOUT = "contact", "friction", "readout"
"""The groups of parameters: each is a panel."""


@dataclass(frozen=True)
class SensorParameters:
    """The parameters of one texel; names as in the paper's Tables 1 and 2, every value per texel.

    Each line below is the whole specification of a parameter. The digest of a scenario hashes these fields by name and in this
    order, so a new parameter changes the digest of every scene and goes to the end.
    """

    # fmt: off
    k: float = specified(Parameter(
        "k", "N/m", 58.5, 0.0, inf, "Normal stiffness of one texel",
        above_low=True, label="Stiffness", symbol="k", source="Eq. 8", group=CONTACT, xml_place=1,
        note="Typical: 58.5 for soft foam, 1000 for a firm pad"))
    cn: float = specified(Parameter(
        "cn", "N·s/m", 0.0583, 0.0, inf, "Normal damping of one texel",
        label="Damping", symbol="cn", source="Eq. 8", group=CONTACT, xml_place=2,
        note="Numerically about 1 % of k"))
    ct: float = specified(Parameter(
        "ct", "N·s/m", 0.01, 0.0, inf, "Viscous friction: grows with sliding speed",
        label="Viscous", symbol="ct", source="Eq. 13", group=FRICTION, xml_place=6, fit_place=5,
        note="Table 2: 0.01"))
    sigma0: float = specified(Parameter(
        "sigma0", "N/m", 1.0, 0.0, inf, "Bristle stiffness: tangential stiffness before a texel slips",
        above_low=True, label="Bristles", symbol="σ0", source="Eq. 9, 13", group=FRICTION, xml_place=3, fit_place=3,
        note="Table 2: 1"))
    sigma1: float = specified(Parameter(
        "sigma1", "N·s/m", 0.1, 0.0, inf, "Bristle damping",
        label="Bristles", symbol="σ1", source="Eq. 13", group=FRICTION, xml_place=4, note="Table 2: 0.1"))
    x0: float = specified(Parameter(
        "x0", "m/s", 0.3, 0.0, inf, "Stribeck velocity: speed at which static friction changes to dynamic",
        above_low=True, label="Stribeck", symbol="x0", source="Eq. 10", group=FRICTION, xml_place=5, fit_place=4,
        note="Table 2: 0.3"))
    mus: float = specified(Parameter(
        "mus", "1", 0.435, 0.0, inf, "Coefficient at which sliding begins",
        label="Static Friction", symbol="μs", source="Eq. 11", group=FRICTION, xml_place=7, fit_place=1,
        note="Foam on metal: 0.435"))
    mud: float = specified(Parameter(
        "mud", "1", 0.23, 0.0, inf, "Coefficient of fast sliding, at most μs",
        label="Dynamic Friction", symbol="μd", source="Eq. 12", group=FRICTION, xml_place=8, fit_place=2,
        note="Foam on metal: 0.23"))
    max_penetration: float = specified(Parameter(
        "max_penetration", "m", 0.012, 0.0, inf, "Depth beyond which a texel exerts no force",
        above_low=True, label="Max Penetration", group=CONTACT,
        note="About twice the thickness of the foam (section 3.3.3): 0.012 for 6 mm"))
    normal_law: str = specified(ChoiceParameter(
        "normal_law", LINEAR, NORMAL_LAWS, "Normal force as a function of depth and its rate",
        label="Normal Law", group=CONTACT))
    exponent: float = specified(Parameter(
        "exponent", "1", 1.5, 1.0, 4.0, "Power of the depth",
        label="Exponent", symbol="p", source="Hunt–Crossley", group=CONTACT, note="k then is in N/mᵖ. Hertz: 1.5"))
    dissipation: float = specified(Parameter(
        "dissipation", "s/m", 0.2, 0.0, inf, "Energy loss of an impact",
        label="Dissipation", symbol="α", source="Hunt–Crossley", group=CONTACT,
        note="Restitution of a slow impact at v m/s: 1 - α v"))
    points_per_texel: int = specified(ChoiceParameter(
        "points_per_texel", 1, CONTACT_POINTS,
        "Points per texel, spread over its cell; they share its stiffness. More points are slower, and make the force and "
        "contact area of small or curved objects exact on coarser pads",
        label="Contact Points", group=CONTACT))
    gain: float = specified(Parameter(
        "gain", "unit/N", 1.0, -inf, inf, "Reading = zero + gain · normal force; what one newton adds to the reading",
        label="Gain", group=READOUT))
    zero: float = specified(Parameter(
        "zero", "unit", 0.0, -inf, inf, "Reading without load",
        label="Zero", group=READOUT))
    unit: str = specified(TextParameter(
        "unit", "N", "Unit of the reading, as in N, V or counts",
        label="Unit", group=READOUT))
    # fmt: on

    def check(self, name: str) -> None:
        """Raise :class:`ParameterError` for the first value of sensor `name` that has no meaning."""
        owner = f"sensor '{name}'"
        for key, specification in SENSOR_PARAMETERS.items():
            specification.check(getattr(self, key), owner)
        if self.mud > self.mus:
            raise ParameterError(
                f"mud of {owner} ({self.mud:g}) is larger than mus ({self.mus:g}): "
                "dynamic friction cannot exceed static friction, lower mud or raise mus."
            )
        if self.gain == 0:
            raise ParameterError(f"gain of {owner} is 0: give it another value, or the sensor reports nothing.")


SENSOR_PARAMETERS = specifications(SensorParameters)
"""The specifications of a sensor's parameters by name."""
LAW_PARAMETERS = tuple(p.name for p in numbers_of(SENSOR_PARAMETERS) if p.source)
"""The numbers of the contact law: those that stand in an equation."""
FRICTION_LAW_PARAMETERS = tuple(p.name for p in numbers_of(SENSOR_PARAMETERS) if p.source and p.group == FRICTION)
NORMAL_LAW_PARAMETERS = tuple(p.name for p in numbers_of(SENSOR_PARAMETERS) if p.source and p.group == CONTACT)
FITTED_FRICTION_PARAMETERS = tuple(
    p.name for p in sorted(numbers_of(SENSOR_PARAMETERS), key=lambda p: p.fit_place) if p.fit_place
)
"""Those that the gap analysis fits; they show only in net forces."""


def with_dependent_defaults(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return given parameters with those that follow from them: damping from stiffness, friction of one kind from the other.

    Parameters
    ----------
    values : mapping
        Values by the names of parameters.
    """
    found = dict(values)
    if "k" in found:
        found.setdefault("cn", DAMPING_PER_STIFFNESS * found["k"])
    if "mus" in found:
        found.setdefault("mud", min(SensorParameters.mud, found["mus"]))
    elif "mud" in found:
        found["mus"] = max(SensorParameters.mus, found["mud"])
    return found


@dataclass(frozen=True)
class Painted:
    """Factors by which parameters of a sensor differ from texel to texel; None means a factor of one everywhere.

    Attributes
    ----------
    k : (n,) float or None
        Factor of `k` and `cn`, as for more or less of the same foam.
    friction : (n,) float or None
        Factor of `mus` and `mud`.
    gain : (n,) float or None
        Factor of `gain`.
    """

    k: np.ndarray | None = None
    friction: np.ndarray | None = None
    gain: np.ndarray | None = None

    def check(self, name: str, count: int) -> None:
        """Raise :class:`ParameterError` for factors of sensor `name` that have no meaning; `count` is the number of texels."""
        for item in fields(self):
            values = getattr(self, item.name)
            if values is None:
                continue
            if values.shape != (count,):
                raise ParameterError(
                    f"The painted {item.name} of sensor '{name}' has {len(values)} values for {count} texels: paint it again."
                )
            lowest = 0.0 if item.name == "friction" else np.nextafter(0.0, 1.0)
            if not (np.isfinite(values).all() and values.min(initial=1.0) >= lowest):
                raise ParameterError(
                    f"The painted {item.name} of sensor '{name}' is {values.min():g} at texel {values.argmin()}: "
                    "give every texel a factor above zero."
                )


def unit_of(name: str, sensor_unit: str) -> str:
    """Return the unit of a parameter on a sensor that reports in `sensor_unit`; "1" where it has none."""
    specification = SENSOR_PARAMETERS[name]
    return specification.unit_of(sensor_unit) if isinstance(specification, Parameter) else "1"


def stated_parameters(words: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the values of those parameters of a sensor that the words of a [sensor] state.

    Every file with a [sensor] is read here. What a parameter may be is in :class:`.SensorParameters`.

    Parameters
    ----------
    words : mapping
        The table as it was written; words that are no parameters are left out.
    where : str
        Which table of which file this is, for the message.

    Raises
    ------
    FileError
        A word is of another kind than its parameter, such as a text where a number belongs.
    """
    values = {}
    for name, specification in SENSOR_PARAMETERS.items():
        if name in words:
            values[name] = specification.read(words[name])
            if values[name] is None:
                raise FileError(f"{name} of {where} is {words[name]!r}: give {specification.wanted}.")
    return values
