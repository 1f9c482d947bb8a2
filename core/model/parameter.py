# SPDX-License-Identifier: GPL-3.0-or-later
"""Specifications of parameters: what one is called and means, its unit, its default and its bounds.

A dataclass with parameters states each of them once, as ``k: float = specified(Parameter("k", "N/m", …))``. Panels, files,
checks, reports and presets read :func:`specifications`. The parameters of effects are :class:`Parameter` too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ..errors import ParameterError

SPECIFICATION = "specification"
"""Key of a dataclass field's metadata under which the specification of its parameter stands."""


@dataclass(frozen=True)
class Parameter:
    """A parameter that is a number.

    Attributes
    ----------
    name : str
    unit : str
        "1", "N", "m", "s", …. In "unit", "unit/N" and the like the word ``unit`` stands for the sensor's own unit. Default and
        bounds of such a parameter of an effect are given for a gain of one unit per newton; :meth:`scaled` gives those of a
        sensor.
    default, low, high : float
        Bounds are inclusive, unless `above_low` is true. Outside them the parameter has no meaning.
    text : str
        What the parameter means, in one sentence.
    log : bool
        True when a fit looks for the parameter on a logarithmic scale.
    per_texel : bool
        True when the value may be one number per texel; a single number is then the same for all texels.
    above_low : bool
        True when `low` itself is outside the bounds.
    label, symbol : str
        Name and symbol in panels.
    source : str
        Equation of the paper, or the law that has the parameter.
    note : str
        Typical values and how to find one, for panels.
    group : str
        Panel that shows the parameter.
    xml_place : int
        Place among the elements of OpenRAVE's XML (paper, Table 2), counted from one; zero when the XML does not have it.
    fit_place : int
        Place among the parameters that the gap analysis fits to friction, counted from one; zero when it is not among them.
    neutral : float or None
        Of an effect: the value at which it vanishes, which may lie outside the bounds. Examples: strength zero, level infinity.
    """

    name: str
    unit: str
    default: float
    low: float
    high: float
    text: str
    log: bool = False
    per_texel: bool = False
    above_low: bool = False
    label: str = ""
    symbol: str = ""
    source: str = ""
    note: str = ""
    group: str = ""
    xml_place: int = 0
    fit_place: int = 0
    neutral: float | None = None

    def scaled(self, gain: float) -> Parameter:
        """Return the parameter as it is for a sensor with this gain."""
        if not self.unit.startswith("unit"):
            return self
        size = abs(gain)
        return replace(self, default=self.default * size, low=self.low * size, high=self.high * size)

    @property
    def force_dimension(self) -> int:
        """Power of force in the dimension of the parameter."""
        inverse = {"1/N": -1, "unit/N": -1, "1/N²": -2, "1/N³": -3, "1/N⁴": -4}
        return 1 if self.unit.startswith(("N", "J")) else inverse.get(self.unit, 0)

    def unit_of(self, sensor_unit: str) -> str:
        """Return the unit of the parameter on a sensor that reports in `sensor_unit`; "1" where it has none."""
        return self.unit.replace("unit", sensor_unit)

    @property
    def bounds(self) -> str:
        """The numbers that are allowed, as in "a value above zero"."""
        number = "zero" if self.low == 0.0 else f"{self.low:g}"
        if math.isinf(self.high):
            if math.isinf(self.low):
                return "a finite value"
            return f"a value above {number}" if self.above_low else f"a value of {number} or more"
        return f"a value from {self.low:g} to {self.high:g}"

    def check(self, value: Any, owner: str) -> None:
        """Raise :class:`ParameterError` for a value outside the bounds; `owner` is who has it, as in "sensor 'tip'"."""
        inside = self.low < value <= self.high if self.above_low else self.low <= value <= self.high
        if not (math.isfinite(value) and inside):
            raise ParameterError(f"{self.name} of {owner} is {value:g}: give it {self.bounds}.")

    def read(self, word: Any) -> float | None:
        """Return the value that a word of a file means, None when it means none."""
        if not isinstance(word, int | float) or isinstance(word, bool):
            return None
        try:
            return float(word)
        except OverflowError:  # a whole number of hundreds of digits
            return None

    wanted = "a number"
    """Expected value in a file, in words."""


@dataclass(frozen=True)
class Choice:
    """One of the values of a :class:`ChoiceParameter`: the value, its label and what it means."""

    value: str | int
    label: str
    text: str


@dataclass(frozen=True)
class ChoiceParameter:
    """A parameter that has one of a few values; attributes as those of :class:`Parameter`."""

    name: str
    default: str | int
    choices: tuple[Choice, ...]
    text: str
    label: str = ""
    group: str = ""

    def check(self, value: Any, owner: str) -> None:
        """Raise :class:`ParameterError` for a value that is not among the choices."""
        values = [choice.value for choice in self.choices]
        if value not in values:
            raise ParameterError(
                f"{self.name} of {owner} is {value!r}: use one of {', '.join(str(value) for value in values)}."
            )

    def read(self, word: Any) -> str | int | None:
        """Return the value that a word of a file means, None when it means none."""
        return word if type(word) is type(self.default) else None

    @property
    def wanted(self) -> str:
        """Expected value in a file, in words."""
        return "a text" if isinstance(self.default, str) else "a whole number"


@dataclass(frozen=True)
class TextParameter:
    """A parameter that is any text; attributes as those of :class:`Parameter`."""

    name: str
    default: str
    text: str
    label: str = ""
    group: str = ""

    def check(self, value: Any, owner: str) -> None:
        """Accept every text."""

    def read(self, word: Any) -> str | None:
        """Return the value that a word of a file means, None when it means none."""
        return word if isinstance(word, str) else None

    wanted = "a text"
    """Expected value in a file, in words."""


Specification = Parameter | ChoiceParameter | TextParameter


def specified(specification: Specification) -> Any:
    """Return the dataclass field of a parameter, with its default."""
    return field(default=specification.default, metadata={SPECIFICATION: specification})


def specifications(owner: type) -> Mapping[str, Specification]:
    """Return the specifications of a dataclass by field name, in the order of its fields; other fields are left out.

    Parameters
    ----------
    owner : type
        A dataclass whose parameters are :func:`specified`.
    """
    return {item.name: item.metadata[SPECIFICATION] for item in fields(owner) if SPECIFICATION in item.metadata}


def numbers_of(specified_parameters: Mapping[str, Specification]) -> list[Parameter]:
    """Return the specifications of those parameters that are numbers."""
    return [specification for specification in specified_parameters.values() if isinstance(specification, Parameter)]
