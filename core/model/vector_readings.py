# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings of several signed channels, for each place where something is measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import counted

AXES = ("x", "y", "z")
VALUES, CLIPPED = "channels/values", "channels/clipped"
"""Names of both arrays of a sensor in files."""


@dataclass(frozen=True)
class VectorReadings:
    """Readings of several channels for each place where something is measured.

    Attributes
    ----------
    values : (T, k, c) float
        At one frame (k, c).
    clipped : (T, k, c) bool
        Channels beyond their range.
    unit : str
    names : (c,) tuple of str
        Of the channels of each place.
    place : (k, 3) float, m, or None
        In the frame of the sensor's body.
    """

    values: np.ndarray
    clipped: np.ndarray
    unit: str = "T"
    names: tuple[str, ...] = AXES
    place: np.ndarray | None = None

    def part(self, frames: int | slice) -> VectorReadings:
        """Return some of the frames, or one, by their indices; the arrays are views."""
        return replace(self, values=self.values[frames], clipped=self.clipped[frames])

    def said(self) -> str:
        """Return a sentence about clipped channels, empty if there are none."""
        places = np.argwhere(self.clipped.any(axis=0))
        if not len(places):
            return ""
        frames = int(self.clipped.any(axis=(1, 2)).sum())
        first = f"channel {self.names[places[0][1]]} of magnetometer {places[0][0]}"
        more = f" and {counted(len(places) - 1, 'other channel')}" if len(places) > 1 else ""
        return f"{first}{more}: beyond the range in {counted(frames, 'frame')}, and clipped there."
