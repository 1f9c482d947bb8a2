# SPDX-License-Identifier: GPL-3.0-or-later
"""The amended sensor, and the experiment that would tell what these recordings do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...io.sensor_toml import SHAPE_WORDS, SensorModel
from ..fitting.least_squares import fit
from ..forward.predictor import Model
from ..selection.diagnosis import Diagnosis
from ..selection.screening import view_set_of


def with_mean_gain_moved(result: Diagnosis) -> Model:
    """Return the best model with the mean of its gains per texel put where it belongs: into `gain`, or `k` in newtons."""
    model = result.best.model
    touched = np.zeros(len(result.rig.texels), bool)
    for predictor in result.of("fit"):
        s = predictor.stimulus
        touched |= (s.load > 0).any(axis=0)
    for index, effect in enumerate(model.effects):
        if effect.name != "gain-mismatch" or "factor" not in effect.values or not touched.any():
            continue
        factor = np.asarray(effect.values["factor"], float)
        mean = float(factor[touched].mean())
        if mean <= 0 or any(other.name != "gain-mismatch" for other in model.effects):
            continue  # beside other effects a common factor is not the same as a stiffer sensor
        factor = np.where(touched, factor / mean, 1.0)
        p = model.parameters
        if p.unit == "N" and any(predictor.trial.stimulus != "force" for predictor in result.of("fit")):
            p = replace(p, k=p.k * mean, cn=p.cn * mean)
        else:
            p = replace(p, gain=p.gain * mean)
        effects = list(model.effects)
        effects[index] = replace(effect, values={**effect.values, "factor": tuple(factor.tolist())})
        model = Model(p, tuple(effects))
    return model


def amended_sensor(result: Diagnosis) -> SensorModel:
    """Return the sensor with fitted parameters and what was found, ready to be written or loaded."""
    model = with_mean_gain_moved(result)
    shape = {key: result.rig.words[key] for key in SHAPE_WORDS if key in result.rig.words}
    return SensorModel(result.rig.name, model.parameters, model.effects, shape)


def intermediate_models(result: Diagnosis) -> list[Model]:
    """Return the base model and then, one effect more each, the models on the way to the amended one."""
    made = [result.base.model]
    effects = result.best.model.effects
    if len(effects) > 1:
        view_set = view_set_of(result.of("fit"), (result.noise[0].deviation, result.noise[1].deviation))
        for count in range(1, len(effects)):
            free = [item for item in result.best.free if item.effect < count]
            begun = Model(result.best.model.parameters, effects[:count])
            made.append(fit(view_set.whole, begun, free, max_steps=6, tolerance=1e-4).model)
    if effects:
        made.append(result.best.model)
    return made


LOUD = 0.05
"""Noise as a share of the range from which on it hides what is sought."""

EXPERIMENTS = {
    "creep": "hold one depth for at least a minute, then release and wait as long",
    "softening": "press the same spot ten times equally deep, then deeper, and again after an hour",
    "hysteresis": "load and unload to the same depth at speeds a hundredfold apart, with partial unloadings",
    "adhesion": "retract slowly after contacts of one second and of one minute, and record until well after release",
    "wear": "repeat one cycle several hundred times on the same texels",
    "load-spreading": "press single texels with a pin that is narrower than a texel",
    "crosstalk": "press single texels with a pin, along one row and along one column, at two loads",
    "gain-mismatch": "press every texel with the same flat indenter to the same depth",
    "dead-texels": "press every texel once",
    "dead-zone": "approach slowly, with many samples at the first touch, with a flat and with a round indenter",
    "saturation": "go on to the highest load that the sensor may bear",
    "stiffening": "go on to the largest depth that the sensor may bear, slowly",
    "lag": "press and release as fast as the rig can, and record at a high rate",
    "drift": "record an hour without touching the sensor",
    "offset": "record a minute without touching the sensor, before and after a trial",
    "quantization": "raise the load very slowly through its whole range",
    "misalignment": "press at many known places, beyond the sensor's edges as well",
    "stribeck": "slide at constant speeds from a tenth of a millimetre to a hundred millimetres per second",
    "viscous-friction": "slide at constant speeds, up to the fastest that the rig can",
    "noise": "record a minute at rest, unloaded and under a constant load",
}
"""What brings out each effect most clearly."""


def _sliding_more(result: Diagnosis) -> str:
    """The same where only net forces were measured while a surface slid."""
    if result.verdict != "unexplained":
        return ""
    hint = {
        "turning": (
            "turn back after slides of several lengths, some very slowly, to see whether what is left goes with the way "
            "or with the time since the turn"
        ),
        "sliding": "slide both ways at several constant speeds",
    }.get(result.structure.strongest, "repeat one trial exactly, to see what of the difference comes again")
    return f"To find out what it is: {hint}; slide under two other loads, and record the normal force."


def next_experiment(result: Diagnosis) -> str:
    """Return what to record next, in one sentence; empty when nothing is open."""
    if result.ambiguous:
        pairs = [f"{names[0]} from {' and '.join(names[1:])}" for names in result.ambiguous]
        involved = list(dict.fromkeys(name for names in result.ambiguous for name in names))
        parts = [EXPERIMENTS[name] for name in involved if name in EXPERIMENTS]
        return f"To tell {', and '.join(pairs)}: {'; and '.join(dict.fromkeys(parts))}."
    c = result.coverage
    if c.slides and all(p.trial.reading is None for p in result.predictors):
        return _sliding_more(result)
    lacking = []
    if result.noise[0].deviation > LOUD * result.full[0]:
        lacking.append("press harder, or repeat a trial exactly and average, until the noise is below a hundredth of the range")
    if c.touched_share < 0.999:
        lacking.append(f"touch the {1.0 - c.touched_share:.0%} of the texels that no trial reaches")
    if c.cycles < 2:
        lacking.append("repeat the cycle at least three times in one trial")
    if c.longest_hold < 2.0:
        lacking.append("hold one depth for some ten seconds")
    if c.speed_ratio < 5.0:
        lacking.append("press at speeds at least tenfold apart")
    if not c.unloading:
        lacking.append("record the unloading too")
    if result.verdict == "unexplained":
        hint = {
            "common mode": "record the same seconds without touching the sensor, to see whether it is there as well",
            "shared by loaded texels": "hold one constant load for as long as a trial, to see how the reading moves by itself",
            "clock": "record as long without touching the sensor",
        }.get(result.structure.strongest, "repeat one trial exactly, to see what of the difference comes again")
        if result.line is not None:
            hint = (
                f"record the same seconds without touching the sensor, with mains, motors and fans off in turn: what hums at "
                f"{result.line.frequency:.3g} Hz (or was folded down to that by the sampling) is there without any load"
            )
        return f"To find out what it is: {'; '.join([hint, *lacking])}."
    return f"To cover what these recordings do not: {'; '.join(lacking)}." if lacking else ""
