# SPDX-License-Identifier: GPL-3.0-or-later
"""What all figures of a recording have in common: colours, their scale, the width of the page."""

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
from .figure_style import WIDTHS


@dataclass(frozen=True)
class Look:
    """How the figures of one recording look, so that all of them agree.

    Attributes
    ----------
    colour_map : str
        Key of :data:`.color_maps.STOPS`.
    quantity : {"force", "pressure"}
        What the colours show: normal force per texel (N) or normal force over the texel's area (kPa).
    limit : float or None, N or kPa
        Upper end of the colour scale, common to all sensors. None: a round number above the largest value.
    width : {"single", "middle", "double"}
        Column width, see :data:`.figure_style.WIDTHS`.
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

    @property
    def inches(self) -> float:
        """Width of the figure."""
        return WIDTHS[self.width]

    @property
    def words(self) -> tuple[str, str]:
        """Label of the colour bar, in two parts that may stand on lines of their own."""
        return ("normal force", "per texel (N)") if self.quantity == "force" else ("pressure", "on each texel (kPa)")

    def values(self, sensor: SensorRecording | SensorFrame, texels: Texels) -> np.ndarray:
        """Return what the colours show, (F, n) or (n,) float, N or kPa."""
        force = sensor.normal_force
        return force if self.quantity == "force" else metrics.pressure(force, texels) / 1e3

    def top(self, recording: Recording, texels: Mapping[str, Texels]) -> float:
        """Return the end of the colour scale for a recording."""
        if self.limit is not None:
            return self.limit
        if self.quantity == "force":
            return metrics.scale_limit(metrics.peak_force(recording))
        return metrics.scale_limit(metrics.peak_pressure(recording, texels) / 1e3)

    def colours(self) -> Any:
        """Return the colour map as matplotlib has them."""
        from matplotlib.colors import LinearSegmentedColormap

        stops = [tuple(color) for color in color_maps.STOPS[self.colour_map]]
        return LinearSegmentedColormap.from_list(self.colour_map, stops, N=1024)


def newtons(value: float) -> str:
    """Return a force in words, small ones in millinewtons."""
    return f"{value * 1e3:g} mN" if value < 0.1 else f"{value:g} N"
