# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect of a sensor as plain data: its name, its formula and the values of its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Value = float | tuple[float, ...]
"""The value of a parameter: one number, or one number per texel."""
Values = Mapping[str, Value]
"""Values by parameter name."""


@dataclass(frozen=True)
class Effect:
    """An effect of a sensor: plain data that a file can hold.

    Attributes
    ----------
    name, form : str
        Names of an effect of the library and of one of its formulas.
    values : dict of str to float or tuple of float
        By parameter name. A tuple has one number per texel. A parameter without a value has the default of the form.
    seed : int
        Seed of the random numbers of an effect; equal seeds give equal numbers.
    """

    name: str
    form: str
    values: dict[str, Value] = field(default_factory=dict)
    seed: int = 0
