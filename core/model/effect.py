# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect of a sensor as plain data: its name, its formula and the values of its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Value = float | tuple[float, ...]
Values = Mapping[str, Value]


@dataclass(frozen=True)
class Effect:
    """An effect on a sensor: plain data that a file can hold.

    Attributes
    ----------
    name, form : str
        Which effect of the library, and which of its formulas.
    values : dict of str to float or tuple of float
        By parameter name; a tuple has one number per texel. What is absent has the form's default.
    seed : int
        Of effects with chance in them; equal seeds give equal numbers.
    """

    name: str
    form: str
    values: dict[str, Value] = field(default_factory=dict)
    seed: int = 0
