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
    if len(model.effects) != 1:  # beside other effects a common factor is not the same as a stiffer sensor
        return model
    (effect,), p = model.effects, model.parameters
    touched = np.any([(predictor.stimulus.load > 0).any(axis=0) for predictor in result.of("fit")], axis=0)
    if not kind_of(effect.name).is_gain_of_texels or "factor" not in effect.values or not touched.any():
        return model
    factor = np.asarray(effect.values["factor"], float)
    mean = float(factor[touched].mean())
    if mean <= 0:
        return model
    if p.unit == "N" and any(predictor.trial.stimulus != "force" for predictor in result.of("fit")):
        p = replace(p, k=p.k * mean, cn=p.cn * mean)
    else:
        p = replace(p, gain=p.gain * mean)
    values = {**effect.values, "factor": tuple(np.where(touched, factor / mean, 1.0).tolist())}
    return replace(model, parameters=p, effects=(replace(effect, values=values),))


def amended_sensor(result: Diagnosis) -> SensorModel:
    """Return the sensor with fitted parameters and the effects that were found."""
    model = with_mean_gain_moved(result)
    shape = {key: result.rig.words[key] for key in SHAPE_WORDS if key in result.rig.words}
    return SensorModel(result.rig.name, model.parameters, model.effects, shape)
