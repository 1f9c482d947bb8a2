# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensor against sensor: two soft skins share the overlap as springs in series.

A texel's segment meets the other sensor's undeformed surface. With moduli m = k / (area of a texel) of the two skins, its own
skin takes the part m' / (m + m') of the overlap, so that both feel the same pressure. Where each feels the other, the force
between them is found twice, once by the texels of either; each finding moves the bodies with half its force.
"""

from __future__ import annotations

from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..model.sensor_parameters import HUNT_CROSSLEY


def stiffness_per_area(sensor: Sensor) -> float:
    """Stiffness of a sensor's skin per area, N/m³ (for Hunt and Crossley's law N/m²⁺ᵖ)."""
    return sensor.parameters.k * len(sensor.texels) / float(sensor.texels.area.sum())


def overlap_share(sensor: Sensor, other: Sensor) -> float:
    """Part of the overlap with another sensor that is taken by the sensor's own skin."""
    power = 1.0 / sensor.parameters.exponent if sensor.parameters.normal_law == HUNT_CROSSLEY else 1.0
    mine, theirs = stiffness_per_area(sensor) ** power, stiffness_per_area(other) ** power
    return theirs / (mine + theirs)


def coupling(scenario: Scenario, sensor: int, target: int) -> tuple[float, float]:
    """Return how a sensor feels a target.

    Returns
    -------
    part : float
        Of the overlap that is the sensor's own; 1 for a hard target.
    weight : float
        With which what it feels moves the bodies: 1/2 when the target is a sensor that feels this one as well, else 1.
    """
    other = scenario.targets[target].sensor
    if other is None:
        return 1.0, 1.0
    felt = any(candidate.sensor == sensor and candidate.body != scenario.sensors[other].body for candidate in scenario.targets)
    return overlap_share(scenario.sensors[sensor], scenario.sensors[other]), 0.5 if felt else 1.0
