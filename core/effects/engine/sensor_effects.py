# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects of a whole sensor or scenario: whether they are valid, and where they put the texels."""

from __future__ import annotations

from dataclasses import replace

from ...geometry.texels import Texels
from ...model.scenario import Scenario
from ...model.sensor import Sensor
from .registry import actual_placement, check


def check_scenario(scenario: Scenario) -> None:
    """Raise a :class:`PalpateError` when a scenario cannot be run or an effect of a sensor is not valid.

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    PalpateError
        See :meth:`.Scenario.check` and :func:`.registry.check`.
    """
    scenario.check()
    for sensor in scenario.sensors:
        check(sensor.effects, sensor.name, len(sensor.texels), sensor.parameters.gain)


def mounted_texels(sensor: Sensor) -> Texels:
    """Return the texels of a sensor where its effects put them, in the frame of its body.

    Effects such as misalignment move texels. Without such an effect the sensor's own texels are returned.
    """
    texels = sensor.texels
    position, normal, tangent = actual_placement(sensor.effects, texels.position, texels.normal, texels.tangent)
    return texels if position is texels.position else replace(texels, position=position, normal=normal, tangent=tangent)
