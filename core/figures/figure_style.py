# SPDX-License-Identifier: GPL-3.0-or-later
"""The style that all figures of a recording share: text sizes, colours and their scale, width of the page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import ParameterError
from ..geometry.texels import Texels
from ..model.recording import Recording
from . import color_maps
from .quantities import QUANTITIES, Extent, Quantity, Scale

FONT, SMALL = 8.5, 8.0
"""Sizes of the text, points: nothing is smaller than 8 pt at the size of the written figure."""
WIDTHS = {"single": 3.5, "middle": 5.5, "double": 7.2}
"""Widths of a journal's columns, inches (89, 140 and 183 mm)."""
LIMITS = (1e-12, 1e39)
"""Least and largest end of a colour scale that begins at zero; more than any 32-bit property holds."""
DPI = (1, 2400)
"""Least and highest resolution; a page of the highest fills a gigabyte."""
INK, GREY, RULE = "#1c2430", "#68727f", "#e4e7eb"
NORMAL_COLOUR, SHEAR_COLOUR = "#1f5fa8", "#c8501e"
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4d4d4d")
"""Colours of curves that the colour-blind can tell apart (Okabe and Ito 2008, without the yellow)."""
LIGHT_ANGLES = (25.0, 85.0)
"""Least and largest angle of the lamps, degrees. From 20.5° on no slope is brighter than white; at 90° none would show."""
MARKERS_ALONG = 18
"""Markers along the longer side, about, where no distance is given."""


def width_below(curves: int) -> float:
    """Return the width of a curve with this many curves drawn over it: it is wider, so that equal ones do not hide it.

    There are four widths, 1.4 points apart; no experiment set these numbers.
    """
    return 1.2 + min(1.4 * curves, 4.2)


@dataclass(frozen=True)
class FigureStyle:
    """Style of one recording's figures, so that all of them agree.

    Attributes
    ----------
    colour_map : str
        Key of :data:`.color_maps.STOPS`.
    quantity : str
        Key of :data:`.quantities.QUANTITIES`, which the colours show.
    limit, lowest : float or None, unit of the quantity
        Ends of the colour scale, common to all sensors. None: round numbers about the values of the recording; with a limit the
        scale begins at zero.
    width : {"single", "middle", "double"}
        Column width, see :data:`WIDTHS`.
    dpi : int
        Of a PNG.
    """

    colour_map: str = "VIRIDIS"
    quantity: str = "force"
    limit: float | None = None
    lowest: float | None = None
    width: str = "double"
    dpi: int = 300

    def __post_init__(self) -> None:
        for what, value, known in (
            ("colour map", self.colour_map, color_maps.STOPS),
            ("quantity", self.quantity, QUANTITIES),
            ("width", self.width, WIDTHS),
        ):
            if value not in known:
                raise ParameterError(f"There is no {what} '{value}': choose from {', '.join(known)}.")
        if self.lowest is None and self.limit is not None and not LIMITS[0] <= self.limit <= LIMITS[1]:
            raise ParameterError(f"The end of the colour scale is {self.limit:g}: choose {LIMITS[0]:g} to {LIMITS[1]:g}.")
        if not DPI[0] <= self.dpi <= DPI[1]:
            raise ParameterError(f"The resolution is {self.dpi} dpi: choose {DPI[0]} to {DPI[1]}.")

    @property
    def width_inches(self) -> float:
        """Width of the figure."""
        return WIDTHS[self.width]

    @property
    def shown(self) -> Quantity:
        """The quantity that the colours show."""
        return QUANTITIES[self.quantity]

    def scale(self, recording: Recording, texels: Mapping[str, Texels]) -> Scale:
        """Return the colour scale of a recording."""
        sources = ((part.sensors[name], own) for part in recording.blocks() for name, own in texels.items())
        return self.scale_of(Extent.of(self.shown, sources))

    def scale_of(self, extent: Extent) -> Scale:
        """Return the colour scale of a run in which the quantity has an extent."""
        return Scale.of(self.shown, extent, self.colour_map, self.limit, self.lowest)


@dataclass(frozen=True)
class GelStyle:
    """How images of a gel are lit and what is printed on it.

    Attributes
    ----------
    light_angle : float, degrees
        Of the lamps above the surface; flat light makes slopes strong, and shadows.
    markers : bool
        Print markers, which the shear carries along.
    marker_pitch : float or None, metres
        Distance between markers. None: a round one, at which there are about :data:`MARKERS_ALONG` along the longer side.
    size : (2,) int, pixels
        Width and height into which an image fits.
    """

    light_angle: float = 60.0
    markers: bool = True
    marker_pitch: float | None = None
    size: tuple[int, int] = (1280, 960)

    def __post_init__(self) -> None:
        low, high = LIGHT_ANGLES
        if not low <= self.light_angle <= high:
            raise ParameterError(f"The light angle of the gel is {self.light_angle:g}°: choose {low:g}° to {high:g}°.")
        if self.marker_pitch is not None and not 0.0 < self.marker_pitch < math.inf:
            raise ParameterError(f"The marker pitch of the gel is {self.marker_pitch:g} m: choose more than zero.")
