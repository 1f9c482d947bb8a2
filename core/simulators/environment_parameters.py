# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor whose parameters and effects differ from environment to environment: a column of numbers for each name.

Names are those of a study without the sensor: ``k`` and every other number of :class:`.SensorParameters`, and
``effect.KIND.PARAMETER`` for effects that the sensor has, or their ``seed``. What decides where contacts are looked for, which
all environments share, stays the same everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..effects.engine import registry
from ..errors import ParameterError, did_you_mean
from ..model.parameter import numbers_of
from ..model.sensor import Sensor
from ..model.sensor_parameters import SENSOR_PARAMETERS

SHARED = ("max_penetration", "points_per_texel")
"""Parameters of contact detection."""
Columns = Mapping[str, ArrayLike]
"""Numbers (E,) by name."""


def sensors_of(sensor: Sensor, columns: Columns, environments: int) -> list[Sensor]:
    """Return the sensor of each environment.

    Raises
    ------
    ParameterError
        A name is unknown, or a column has another shape or a value that is not allowed.
    """
    known = _names(sensor)
    values = {name: np.asarray(column) for name, column in columns.items()}
    for name, column in values.items():
        if column.shape != (environments,) or column.dtype.kind not in "fiu":
            raise ParameterError(
                f"'{name:.80}' is {column.dtype} of shape {column.shape}: "
                f"give a number for each environment, ({environments},)."
            )
    for name in values:
        if name not in known:
            advice = did_you_mean(name, known, f"give {', '.join(known)}.")
            raise ParameterError(f"There is no parameter '{name:.80}' that may differ between environments: {advice}")
    rows = ({name: column[number] for name, column in values.items()} for number in range(environments))
    return [_varied(sensor, number, row) for number, row in enumerate(rows)]


def _names(sensor: Sensor) -> list[str]:
    """Parameters that may differ between environments, by name."""
    names = [p.name for p in numbers_of(SENSOR_PARAMETERS) if p.name not in SHARED]
    for item in sensor.effects:
        form = registry.form_of(item.name, item.form)
        if form.placement is not None:  # where texels are is the same everywhere
            continue
        names += [f"effect.{item.name}.{key}" for key in (*(p.name for p in form.parameters), "seed")]
    return list(dict.fromkeys(names))


def _varied(sensor: Sensor, number: int, values: Mapping[str, float]) -> Sensor:
    """Return the sensor of one environment, checked."""
    own: dict[str, Any] = {name: float(value) for name, value in values.items() if name in SENSOR_PARAMETERS}
    effects = list(sensor.effects)
    for name, value in values.items():
        if name not in own:
            _, kind, key = name.split(".")
            at = next(i for i, item in enumerate(effects) if item.name == kind)
            if key == "seed":
                effects[at] = replace(effects[at], seed=int(value))
            else:
                effects[at] = replace(effects[at], values={**effects[at].values, key: float(value)})
    made = replace(sensor, parameters=replace(sensor.parameters, **own), effects=tuple(effects))
    whose = f"{sensor.name} in environment {number}"
    made.parameters.check(whose)
    registry.check(made.effects, whose, len(made.texels), made.parameters.gain)
    return made
