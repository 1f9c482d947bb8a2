# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of one texel, and the factors by which painted maps change them from texel to texel."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from ..errors import ParameterError

HUNT_CROSSLEY = "hunt-crossley"
NORMAL_LAWS = ("linear", HUNT_CROSSLEY)
"""What the normal force may be: Eq. 8 of the paper, or ``k dᵖ (1 + 3/2 α ḋ)``."""


MOST_POINTS = 100
"""Contact points that a texel may have."""


@dataclass(frozen=True)
class SensorParameters:
    """What one texel is made of; names as in the paper's Tables 1 and 2, every value per texel.

    Attributes
    ----------
    k : float, N/m
        Normal stiffness (Eq. 8, 18).
    cn : float, N·s/m
        Normal damping (Eq. 8); about 1 % of `k` in number.
    ct : float, N·s/m
        Tangential viscous damping (Eq. 13).
    sigma0 : float, N/m
        Bristle stiffness (Eq. 9, 13).
    sigma1 : float, N·s/m
        Bristle damping (Eq. 13).
    x0 : float, m/s
        Stribeck velocity (Eq. 10).
    mus, mud : float
        Static and dynamic friction coefficients (Eq. 11, 12).
    max_penetration : float, m
        Depth past which a texel no longer acts (section 3.3.3: about twice the foam's thickness).
    normal_law : str
        One of :data:`NORMAL_LAWS`.
    exponent : float
        `p` in the law of Hunt and Crossley (J. Appl. Mech. 42, 1975), whose `k` then is in N/mᵖ; 3/2 is Hertz's.
    dissipation : float, s/m
        `α` in that law, which has no `cn`: slow impacts at speed v leave with ``(1 - α v) v``.
    points_per_texel : int
        Contact points in the cell of each texel, a square number; they share out all that the texel's spring, damper and
        bristles do.
    gain, zero : float
        Linear conversion to what the sensor reports: ``reading = zero + gain · force``, in `unit`.
    unit : str
    """

    k: float = 58.5
    cn: float = 0.0583
    ct: float = 0.01
    sigma0: float = 1.0
    sigma1: float = 0.1
    x0: float = 0.3
    mus: float = 0.435
    mud: float = 0.23
    max_penetration: float = 0.012
    normal_law: str = "linear"
    exponent: float = 1.5
    dissipation: float = 0.2
    points_per_texel: int = 1
    gain: float = 1.0
    zero: float = 0.0
    unit: str = "N"

    def check(self, name: str) -> None:
        """Raise :class:`ParameterError` for the first value that means nothing."""
        for key in ("k", "sigma0", "x0", "max_penetration"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value > 0):
                raise ParameterError(f"{key} of sensor '{name}' is {value:g}: give it a value above zero.")
        for key in ("cn", "ct", "sigma1", "mus", "mud"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value >= 0):
                raise ParameterError(f"{key} of sensor '{name}' is {value:g}: give it a value of zero or more.")
        if not 1 <= self.points_per_texel <= MOST_POINTS or math.isqrt(self.points_per_texel) ** 2 != self.points_per_texel:
            raise ParameterError(
                f"points_per_texel of sensor '{name}' is {self.points_per_texel}: "
                f"give it a square number, as 1, 4 or 9, of at most {MOST_POINTS}."
            )
        if self.normal_law not in NORMAL_LAWS:
            raise ParameterError(
                f"The normal law of sensor '{name}' is '{self.normal_law}': use one of {', '.join(NORMAL_LAWS)}."
            )
        if not 1.0 <= self.exponent <= 4.0:
            raise ParameterError(f"exponent of sensor '{name}' is {self.exponent:g}: give it a value from 1 to 4.")
        if not (np.isfinite(self.dissipation) and self.dissipation >= 0):
            raise ParameterError(f"dissipation of sensor '{name}' is {self.dissipation:g}: give it a value of zero or more.")
        if self.mud > self.mus:
            raise ParameterError(
                f"mud of sensor '{name}' ({self.mud:g}) is larger than mus ({self.mus:g}): "
                "dynamic friction cannot exceed static friction, lower mud or raise mus."
            )
        if not (np.isfinite(self.gain) and np.isfinite(self.zero) and self.gain != 0):
            raise ParameterError(f"gain and zero of sensor '{name}' must be finite and gain not zero.")


@dataclass(frozen=True)
class Painted:
    """Multipliers of a sensor's parameters, texel by texel; None is one everywhere.

    Attributes
    ----------
    k : (n,) float or None
        Of `k` and `cn`, as for more or less of the same foam.
    friction : (n,) float or None
        Of `mus` and `mud`.
    gain : (n,) float or None
        Of `gain`.
    """

    k: np.ndarray | None = None
    friction: np.ndarray | None = None
    gain: np.ndarray | None = None

    def check(self, name: str, count: int) -> None:
        """Raise :class:`ParameterError` for multipliers that mean nothing; `count` is the number of texels."""
        for item in fields(self):
            values = getattr(self, item.name)
            if values is None:
                continue
            if values.shape != (count,):
                raise ParameterError(
                    f"The painted {item.name} of sensor '{name}' has {len(values)} values for {count} texels: paint it anew."
                )
            lowest = 0.0 if item.name == "friction" else np.nextafter(0.0, 1.0)
            if not (np.isfinite(values).all() and values.min(initial=1.0) >= lowest):
                raise ParameterError(
                    f"The painted {item.name} of sensor '{name}' is {values.min():g} at texel {values.argmin()}: "
                    "give every texel a factor above zero."
                )
