# SPDX-License-Identifier: GPL-3.0-or-later
"""What computes several channels from what happens at a sensor's texels (:mod:`..skins.channel_readouts`)."""

from __future__ import annotations

from typing import Protocol

from .recording import SensorArrays
from .vector_readings import VectorReadings


class ChannelReadout(Protocol):
    """Computes several signed channels from what happens at a sensor's texels. It is a dataclass of plain data."""

    def no_frames(self) -> VectorReadings:
        """Return the channels of a recording without frames: their number, unit, names and places."""

    def channels(self, recorded: SensorArrays) -> VectorReadings:
        """Return the channels at the frames of a recording; a frame has the same bits in a recording of any length."""
