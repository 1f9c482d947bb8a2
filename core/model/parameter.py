# SPDX-License-Identifier: GPL-3.0-or-later
"""The specification of a parameter."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """One number of a form.

    Attributes
    ----------
    name : str
    unit : str
        "1", "N", "m", "s", … and "unit" for the sensor's own unit: default and bounds are then given for a gain of one unit
        per newton; :meth:`scaled` gives those of a sensor.
    default, low, high : float
        Bounds are inclusive: outside them the formula means nothing or nothing real is like that.
    text : str
        One sentence for people.
    log : bool
        Looked for on a logarithmic scale.
    per_texel : bool
        One number per texel; a single number stands for all texels.
    """

    name: str
    unit: str
    default: float
    low: float
    high: float
    text: str
    log: bool = False
    per_texel: bool = False

    def scaled(self, gain: float) -> Parameter:
        """Return the parameter as it is for a sensor with this gain."""
        if not self.unit.startswith("unit"):
            return self
        size = abs(gain)
        return Parameter(
            self.name, self.unit, self.default * size, self.low * size, self.high * size, self.text, self.log, self.per_texel
        )
