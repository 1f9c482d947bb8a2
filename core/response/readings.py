# SPDX-License-Identifier: GPL-3.0-or-later
"""Forces to readings: the linear conversion of the paper (section 4) and the effects that act on readings."""

from __future__ import annotations

import numpy as np

from ..effects.engine.readout_chain import ReadoutChain, readings, transducers_of
from ..model.sensor import Sensor

__all__ = ["ReadoutChain", "respond"]


def respond(sensor: Sensor, time: np.ndarray, normal_force: np.ndarray) -> np.ndarray:
    """Return the texels' readings over a whole signal, (t, n) float in the sensor's unit.

    Parameters
    ----------
    sensor : Sensor
    time : (t,) float, s, increasing
    normal_force : (t, n) float, N
    """
    return readings(sensor.effects, transducers_of(sensor), time, normal_force)
