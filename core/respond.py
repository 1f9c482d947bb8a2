# SPDX-License-Identifier: GPL-3.0-or-later
"""Forces → readings: what the sensor would report (paper, section 4: a linear conversion; effects join here)."""

from __future__ import annotations

import numpy as np

from .scenario import Sensor


def respond(sensor: Sensor, normal_force: np.ndarray) -> np.ndarray:
    """Return the texels' readings in the sensor's unit.

    Parameters
    ----------
    sensor : Sensor
    normal_force : (n,) float, N
    """
    gain = sensor.parameters.gain if sensor.painted.gain is None else sensor.parameters.gain * sensor.painted.gain
    return sensor.parameters.zero + gain * normal_force
