# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensor against sensor: two soft skins share the overlap as springs in series.

A texel's segment meets the other sensor's undeformed surface. With the stiffness per area m = k / (area of a texel) of the two
skins, a sensor's own skin takes the share m' / (m + m') of the overlap, so that both measure the same pressure. Where each
sensor has the other as a target, the force between them is computed twice, once by the texels of either; each computation then
moves the bodies with half its force.
"""

from __future__ import annotations

from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..model.sensor_parameters import HUNT_CROSSLEY


def stiffness_per_area(sensor: Sensor) -> float:
    """Stiffness of a sensor's skin per area, N/m³ (for Hunt and Crossley's law N/m²⁺ᵖ)."""
    return sensor.parameters.k * len(sensor.texels) / float(sensor.texels.area.sum())


def overlap_share(sensor: Sensor, other: Sensor) -> float:
    """Share of the overlap with another sensor that the sensor's own skin takes."""
    power = 1.0 / sensor.parameters.exponent if sensor.parameters.normal_law == HUNT_CROSSLEY else 1.0
    own, others = stiffness_per_area(sensor) ** power, stiffness_per_area(other) ** power
    return others / (own + others)


def coupling(scenario: Scenario, sensor: int, target: int) -> tuple[float, float]:
    """Return how a sensor and one of its targets share overlap and force.

    Returns
    -------
    overlap_share : float
        Share of the overlap that the sensor's own skin takes; 1 for a hard target.
    force_weight : float
        Factor with which the sensor's force moves the bodies: 1/2 when the target is a sensor that has this one as its
        target too, else 1.
    """
    other = scenario.targets[target].sensor
    if other is None:
        return 1.0, 1.0
    mutual = any(
        candidate.sensor == sensor and candidate.body != scenario.sensors[other].body for candidate in scenario.targets
    )
    return overlap_share(scenario.sensors[sensor], scenario.sensors[other]), 0.5 if mutual else 1.0
