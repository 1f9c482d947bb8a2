# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes that a sensor can have: whatever comes in is checked here, because files do not say their unit of length."""

from __future__ import annotations

import numpy as np

from ..errors import SensorError

LARGEST_SENSOR, SMALLEST_SENSOR = 3.0, 2e-4
"""Metres. The largest sensors are mats and floors of 2 m; the smallest, on tips of catheters, have 1 mm."""
LARGEST_PITCH, SMALLEST_PITCH = 0.3, 1e-6
"""Metres between neighbouring texels: cells of floors have 0.1 to 0.2 m, nanofibre arrays micrometres."""
UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "micrometres": 1e-6, "inches": 0.0254}


def require_sensor_size(points: np.ndarray, name: str, what: str = "sensor") -> None:
    """Raise SensorError if a sensor, or the distance between its texels, cannot be as large as its coordinates in metres say.

    Parameters
    ----------
    points : (n, 3) float, metres
        Places of its texels, or vertices of its surface.
    name : str
    what : str
        What is checked, for the message.
    """
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return
    span = float(np.ptp(points, axis=0).max())
    distance = cKDTree(points).query(points, 2)[0][:, 1]
    pitch = float(np.median(distance[distance > 0.0])) if (distance > 0.0).any() else 0.0
    if SMALLEST_SENSOR <= span <= LARGEST_SENSOR and pitch <= LARGEST_PITCH and (pitch >= SMALLEST_PITCH or what != "sensor"):
        return
    size = f"{span:.3g} m across" if not SMALLEST_SENSOR <= span <= LARGEST_SENSOR else f"of texels {pitch:.3g} m apart"
    possible = [word for word, metres in UNITS.items() if SMALLEST_SENSOR <= span * metres <= LARGEST_SENSOR / 3.0]
    asked = f"are its coordinates in {possible[0]}? Scale it by {UNITS[possible[0]]:g}" if possible else "give metres"
    raise SensorError(f"The {what} '{name}' would be {size}, and lengths are metres: {asked}.")
