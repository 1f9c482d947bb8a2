# SPDX-License-Identifier: GPL-3.0-or-later
"""The style that all figures of a recording share: text sizes, colours and their scale, width of the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError
from ..geometry.texels import Texels
from ..model.recording import Recording, SensorFrame, SensorRecording
from ..response import metrics
from . import color_maps

FONT, SMALL = 8.5, 8.0
"""Sizes of the text, points: nothing is smaller than 8 pt at the size of the written figure."""
WIDTHS = {"single": 3.5, "middle": 5.5, "double": 7.2}
"""Widths of a journal's columns, inches (89, 140 and 183 mm)."""
LIMITS = (1e-12, 1e39)
"""Least and largest end of a colour scale, N or kPa; more than any 32-bit property holds."""
DPI = (1, 2400)
"""Least and highest resolution; a page of the highest fills a gigabyte."""
INK, GREY, RULE = "#1c2430", "#68727f", "#e4e7eb"
NORMAL_COLOUR, SHEAR_COLOUR = "#1f5fa8", "#c8501e"
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4d4d4d")
"""Colours of curves that the colour-blind can tell apart (Okabe and Ito 2008, without the yellow)."""


@dataclass(frozen=True)
class FigureStyle:
    """How the figures of one recording style, so that all of them agree.

    Attributes
    ----------
    colour_map : str
        Key of :data:`.color_maps.STOPS`.
    quantity : {"force", "pressure"}
        What the colours show: normal force per texel (N) or normal force over the texel's area (kPa).
    limit : float or None, N or kPa
        Upper end of the colour scale, common to all sensors. None: a round number above the largest value.
    width : {"single", "middle", "double"}
        Column width, see :data:`WIDTHS`.
    dpi : int
        Of a PNG.
    """

    colour_map: str = "VIRIDIS"
    quantity: str = "force"
    limit: float | None = None
    width: str = "double"
    dpi: int = 300

    def __post_init__(self) -> None:
        for what, value, known in (
            ("colour map", self.colour_map, color_maps.STOPS),
            ("quantity", self.quantity, ("force", "pressure")),
            ("width", self.width, WIDTHS),
        ):
            if value not in known:
                raise ParameterError(f"There is no {what} '{value}': choose from {', '.join(known)}.")
        if self.limit is not None and not LIMITS[0] <= self.limit <= LIMITS[1]:
            raise ParameterError(f"The end of the colour scale is {self.limit:g}: choose {LIMITS[0]:g} to {LIMITS[1]:g}.")
        if not DPI[0] <= self.dpi <= DPI[1]:
            raise ParameterError(f"The resolution is {self.dpi} dpi: choose {DPI[0]} to {DPI[1]}.")

    @property
    def width_inches(self) -> float:
        """Width of the figure."""
        return WIDTHS[self.width]

    @property
    def quantity_label(self) -> tuple[str, str]:
        """Label of the colour bar, in two parts that may be on separate lines."""
        return ("normal force", "per texel (N)") if self.quantity == "force" else ("pressure", "on each texel (kPa)")

    def values(self, sensor: SensorRecording | SensorFrame, texels: Texels) -> np.ndarray:
        """Return what the colours show, (F, n) or (n,) float, N or kPa."""
        force = sensor.normal_force
        return force if self.quantity == "force" else metrics.pressure(force, texels) / 1e3

    def scale_limit(self, recording: Recording, texels: Mapping[str, Texels]) -> float:
        """Return the end of the colour scale for a recording."""
        if self.limit is not None:
            return self.limit
        if self.quantity == "force":
            return metrics.scale_limit(metrics.peak_force(recording))
        return metrics.scale_limit(metrics.peak_pressure(recording, texels) / 1e3)

    def matplotlib_colormap(self) -> Any:
        """Return the colour map as an object of matplotlib."""
        from matplotlib.colors import LinearSegmentedColormap

        stops = [tuple(color) for color in color_maps.STOPS[self.colour_map]]
        return LinearSegmentedColormap.from_list(self.colour_map, stops, N=1024)


def force_label(value: float) -> str:
    """Return a force with its unit as text, small ones in millinewtons."""
    return f"{value * 1e3:g} mN" if value < 0.1 else f"{value:g} N"
