# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that colours on texels can show, as one table: heat maps, insets, figures, exports and panels take an entry of it.

A place that shows values never asks which they are, and an entry knows no place. To add a quantity, append an entry to
:data:`QUANTITIES`; Blender's panels, ``palpate render --quantity`` and ``recording.show`` then offer it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import response
from ..errors import ParameterError
from ..geometry.texels import Texels
from ..io.tactile_exr import nearest_places
from ..model.recording import SensorArrays
from . import color_maps

FINER = {"N": "mN", "kPa": "Pa", "mm": "µm", "mm/s": "µm/s", "T": "mT", "V": "mV"}
"""For each unit one that is a thousand times finer."""


def three_digits(value: float) -> str:
    """Return a number with three digits: 2000 and not 2e+03."""
    return f"{float(f'{value:.3g}'):g}"


Span = Callable[[float, float], tuple[float, float]]


def from_zero(_low: float, high: float) -> tuple[float, float]:
    """Return a scale from zero to a round number above the largest value; of a load that is zero, to a number above one."""
    return 0.0, response.scale_limit(high if high > 0.0 else 1.0)


def about_zero(low: float, high: float) -> tuple[float, float]:
    """Return a scale whose middle is zero."""
    _, top = from_zero(0.0, max(-low, high))
    return -top, top


def between(low: float, high: float) -> tuple[float, float]:
    """Return a scale from a number below the least value to one above the largest: rest need be neither zero nor an end."""
    if low == 0.0 or low > high:
        return from_zero(low, high)
    least = max(high - low, 1e-6 * max(abs(low), abs(high))) / 10.0
    power = 10.0 ** math.floor(math.log10(least))
    step = power * next(step for step in (1, 2, 5, 10) if least <= step * power * (1 + 1e-9))
    first, last = math.floor(low / step), math.ceil(high / step)
    return step * first, step * max(last, first + 1)


@dataclass(frozen=True)
class Quantity:
    """A value of each texel that colours can show.

    Attributes
    ----------
    name : str
        In commands and scripts.
    title, text : str
        Name and meaning, for panels.
    label : (str, str)
        Name beside a colour bar, in two parts that may be on separate lines.
    unit : str or callable
        Of the values, or a function that returns it from the source.
    values : callable
        Returns what a source says of each texel, (F, n) or (n,) float in the unit; raises :class:`.ParameterError` if the
        source has nothing of the kind. Of a recording the source is the arrays of a sensor, of a gap the error of each texel.
    span : callable
        Returns the ends of a scale from the least and the largest value.
    channel : str
        Channel of tactile images that holds the values in this unit; empty where none does.
    limit : float
        End of the colours that a scene begins with where it sets them itself.
    """

    name: str
    title: str
    text: str
    label: tuple[str, str]
    unit: str | Callable[[Any], str]
    values: Callable[[Any, Texels], np.ndarray]
    span: Span = from_zero
    channel: str = ""
    limit: float = 1.0

    def unit_of(self, source: Any) -> str:
        """Return the unit in which a source has this quantity."""
        return self.unit if isinstance(self.unit, str) else self.unit(source)

    def is_in(self, sensor: SensorArrays) -> bool:
        """Return True if a sensor has this quantity."""
        return self.values is not _channel or sensor.channels is not None


def _channel(sensor: SensorArrays, texels: Texels) -> np.ndarray:
    if sensor.channels is None:
        raise ParameterError("A sensor without channels has none to show: choose another quantity.")
    return sensor.channels.values[..., nearest_places(texels, sensor.channels), -1]


# fmt: off
QUANTITIES = {quantity.name: quantity for quantity in (
    # In the order of panels. A .blend stores a choice by its place in the order: append new ones.
    Quantity(
        "force", "Force", "Normal force of the texel", ("normal force", "per texel"), "N",
        lambda sensor, _: sensor.normal_force, channel="R", limit=0.1),
    Quantity(
        "pressure", "Pressure", "Normal force over the area of the texel", ("pressure", "on each texel"), "kPa",
        lambda sensor, texels: sensor.normal_force / texels.area / 1e3, limit=10.0),
    Quantity(
        "reading", "Reading", "Value that the sensor reports of the texel, with its effects, gain and zero",
        ("reading", "of each texel"), lambda sensor: sensor.unit,
        lambda sensor, _: sensor.reading, between, channel="reading"),
    Quantity(
        "shear", "Shear", "Magnitude of the tangential force on the texel", ("shear force", "per texel"), "N",
        lambda sensor, _: np.linalg.norm(sensor.shear, axis=-1), limit=0.1),
    Quantity(
        "depth", "Depth", "Penetration of the texel", ("depth", "of each texel"), "mm",
        lambda sensor, _: 1e3 * sensor.depth),
    Quantity(
        "slip", "Slip Speed", "Tangential speed of the texel relative to the object", ("slip speed", "of each texel"), "mm/s",
        lambda sensor, _: 1e3 * sensor.slip, limit=10.0),
    Quantity(
        "channels", "Channels", "Last channel of the place nearest to the texel; of magnetometers it is z",
        ("last channel", "nearest to each texel"), lambda sensor: sensor.channels.unit if sensor.channels else "",
        _channel, about_zero),
)}
"""Quantities of a recording by name."""

ERROR = Quantity(
    "error", "Error", "Error of the predicted reading, root mean square", ("error", "of each texel"), "% of range",
    lambda share, _: 100.0 * share)
"""Of a gap: the error of its base model, or of its amended sensor, both on the scale of the base model."""
# fmt: on


def error_scale(largest: float) -> Scale:
    """Return the colours of errors up to the largest one, in the unit of :data:`ERROR`."""
    return Scale.of(ERROR, Extent(0.0, largest, (ERROR.unit_of(None),)), "INFERNO")


@dataclass(frozen=True)
class Extent:
    """Least and largest value of a quantity in a run, and its units; without any value the least is the larger one."""

    low: float = math.inf
    high: float = -math.inf
    units: tuple[str, ...] = ()

    @classmethod
    def of(cls, quantity: Quantity, sources: Iterable[tuple[Any, Texels]], known: Extent | None = None) -> Extent:
        """Return the extent of sources and their texels, and of what is `known` already."""
        found = known or cls()
        for source, texels in sources:
            values, units = quantity.values(source, texels), dict.fromkeys((*found.units, quantity.unit_of(source)))
            values = values[~np.isnan(values)]
            low, high = float(values.min(initial=math.inf)), float(values.max(initial=-math.inf))
            found = cls(min(found.low, low), max(found.high, high), tuple(units))
        return found


@dataclass(frozen=True)
class Scale:
    """Colour scale: a quantity between two values, in the colours of one map.

    Attributes
    ----------
    quantity : Quantity
    unit : str
    low, high : float
        Values, in the unit, of the first and the last colour.
    colour_map : str
        Key of :data:`.color_maps.ALL`.
    """

    quantity: Quantity
    unit: str
    low: float
    high: float
    colour_map: str

    @classmethod
    def of(
        cls, quantity: Quantity, extent: Extent, colour_map: str, limit: float | None = None, lowest: float | None = None
    ) -> Scale:
        """Return the scale of a run: round numbers about its extent, or from `lowest` (default: zero) to a `limit`."""
        low, high = quantity.span(extent.low, extent.high)
        is_signed = quantity.span is about_zero
        if limit is not None:
            low, high = (-limit if is_signed else 0.0), limit
        if lowest is not None:
            low = lowest
        if low >= high:
            raise ParameterError(f"The colour scale of the {quantity.name} goes from {low:g} to {high:g}: let it go up.")
        return cls(quantity, " or ".join(extent.units), low, high, color_maps.SIGNED if is_signed else colour_map)

    def values(self, source: Any, texels: Texels) -> np.ndarray:
        """Return the values that the colours show, (F, n) or (n,) float."""
        return self.quantity.values(source, texels)

    def colors(self, values: np.ndarray) -> np.ndarray:
        """(n, 3) sRGB colours of (n,) values."""
        return color_maps.colors(self.colour_map, (values - self.low) / (self.high - self.low))

    @property
    def label(self) -> tuple[str, str]:
        """Label of a colour bar, in two parts that may be on separate lines."""
        first, second = self.quantity.label
        return first, f"{second} ({self.unit})"

    def words(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{three_digits(value)} {self.unit}"

    def in_finer_unit(self, peak: float) -> tuple[Scale, float]:
        """Return the scale in a finer unit, if there is one and a `peak` is below one, and the factor of values."""
        if peak >= 1.0 or self.unit not in FINER:
            return self, 1.0
        return replace(self, unit=FINER[self.unit], low=1e3 * self.low, high=1e3 * self.high), 1e3
