# SPDX-License-Identifier: GPL-3.0-or-later
"""The amended sensor: fitted parameters and the effects that were found, ready to be written or loaded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.engine.registry import kind_of
from ...io.sensor_toml import SHAPE_WORDS, SensorModel
from ..forward.predictor import Model
from ..selection.findings import Diagnosis


def with_mean_gain_moved(result: Diagnosis) -> Model:
    """Return the amended model with the mean gain of its texels moved into the base model.

    It moves into `k` if the sensor reads newtons, and into `gain` otherwise.
    The gains of the touched texels then have mean one.
    """
    model = result.best.model
    touched = np.zeros(len(result.rig.texels), bool)
    for predictor in result.of("fit"):
        touched |= (predictor.stimulus.load > 0).any(axis=0)
    for index, effect in enumerate(model.effects):
        if not kind_of(effect.name).is_gain_of_texels or "factor" not in effect.values or not touched.any():
            continue
        factor = np.asarray(effect.values["factor"], float)
        mean = float(factor[touched].mean())
        if mean <= 0 or any(other.name != effect.name for other in model.effects):
            continue  # beside other effects a common factor is not the same as a stiffer sensor
        factor = np.where(touched, factor / mean, 1.0)
        p = model.parameters
        if p.unit == "N" and any(predictor.trial.stimulus != "force" for predictor in result.of("fit")):
            p = replace(p, k=p.k * mean, cn=p.cn * mean)
        else:
            p = replace(p, gain=p.gain * mean)
        effects = list(model.effects)
        effects[index] = replace(effect, values={**effect.values, "factor": tuple(factor.tolist())})
        model = replace(model, parameters=p, effects=tuple(effects))
    return model


def amended_sensor(result: Diagnosis) -> SensorModel:
    """Return the sensor with fitted parameters and the effects that were found."""
    model = with_mean_gain_moved(result)
    shape = {key: result.rig.words[key] for key in SHAPE_WORDS if key in result.rig.words}
    return SensorModel(result.rig.name, model.parameters, model.effects, shape)
