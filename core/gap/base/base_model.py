# SPDX-License-Identifier: GPL-3.0-or-later
"""The base model of a rig: where its fit starts, and which of its parameters the recordings identify."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from ...model.sensor_parameters import FITTED_FRICTION_PARAMETERS
from ..dataset.rig import FORCE, Rig
from ..fitting.force_scale import at_measured_forces
from ..fitting.least_squares import FRICTION_LEVEL, RECORDING, Fit, FreeParameter, TrialView, fit, free_base_parameters
from ..fitting.noise_floor import ChannelNoise, force_noise, reading_noise, with_repeats
from ..forward.predictor import CONTACT_HEIGHT, NEUTRAL_NUMBERS, Model, Predictor, number_name
from ..forward.response_check import check_responses

FULL_STEPS, TRIAL_STEPS = 40, 6
"""Steps of the base model's fit, and of a fit from each of several starts, of which the best goes on."""
BRISTLE_STARTS = 5
"""Number of stiffnesses of the bristles from which the fit starts beside the default."""
SMALL_STEP = 0.1
"""Quantile of the distances of sliding between two samples that counts as a small one."""
LEAST_FRICTION = 0.05
"""Least friction coefficient from which the stiffnesses are estimated."""
HEIGHT_SCALE = 0.1
"""A change of the contact height that matters, as a share of the largest penetration."""
LARGEST_OWN_FACTOR = 1e3
"""Largest factor between two recordings that is fitted; its inverse is the smallest."""


def prepared(rig: Rig, predictors: Sequence[Predictor]) -> tuple[tuple[ChannelNoise, ChannelNoise], tuple[float, float]]:
    """Check the recordings, and measure noise and range of readings and of net forces.

    Parameters
    ----------
    rig : Rig
    predictors : sequence of Predictor
        Of the rig's trials, in their order.

    Returns
    -------
    noise : (ChannelNoise, ChannelNoise)
    full : (float, float)
        Largest minus smallest value over all trials and channels.

    Raises
    ------
    FileError
        The recordings do not fit their stimulus, see :func:`.check_responses`.
    """
    check_responses(rig, [predictor.stimulus for predictor in predictors])
    readings = [p.trial.reading for p in predictors if p.trial.reading is not None]
    forces = [p.trial.force for p in predictors if p.trial.force is not None]
    full = _range(readings), _range(forces)
    noise = reading_noise(predictors, full[0]), force_noise(predictors, full[1])
    return (with_repeats(noise[0], predictors, "reading"), with_repeats(noise[1], predictors, "force")), full


def _range(arrays: Sequence[np.ndarray]) -> float:
    """Largest minus smallest of all measured values; 1 if nothing was measured."""
    if not arrays:
        return 1.0
    high, low = max(float(np.nanmax(a)) for a in arrays), min(float(np.nanmin(a)) for a in arrays)
    return max(high - low, 1e-12)


def start_model(rig: Rig, predictors: Sequence[Predictor]) -> Model:
    """Return the model with the rig's own parameters; a linear fit to the readings gives gain and zero if the rig does not.

    Free numbers of recordings have the values of :func:`with_recording_numbers`.
    """
    p = rig.parameters
    recorded = [one for one in predictors if one.trial.reading is not None]
    if recorded and p.unit != "N" and "gain" not in rig.given:
        base = Model(replace(p, gain=1.0, zero=0.0))
        predicted = np.concatenate([one.predict(base).reading.ravel() for one in recorded])
        measured = np.concatenate([np.ravel(one.trial.responses[0]) for one in recorded])
        good = np.isfinite(measured)
        x, y = predicted[good], measured[good]
        from_mean = x - x.mean()
        square = float(from_mean @ from_mean)
        slope = float(from_mean @ y) / square if square > 0.0 else 0.0
        gain = slope if np.isfinite(slope) and slope != 0.0 else 1.0  # of readings that never change
        p = replace(p, gain=gain, zero=p.zero if "zero" in rig.given else float(y.mean() - gain * x.mean()))
    return with_recording_numbers(Model(p), predictors)


def base_fit(rig: Rig, views: Sequence[TrialView], full: float) -> Fit:
    """Fit the base model to recordings, from several stiffnesses of the bristles if the rig does not state one.

    The misfit of net forces has a local minimum where bristles are so soft that they never slip.

    Parameters
    ----------
    rig : Rig
    views : sequence of TrialView
    full : float
        Range of the readings.
    """
    predictors = [view.predictor for view in views]
    stated = start_model(rig, predictors)
    start = at_measured_forces(stated, free_parameters(rig, predictors, stated, full), views)
    free = free_parameters(rig, predictors, start, full)
    stiffness_is_open = "sigma0" not in rig.given and any(item.name == "sigma0" for item in free)
    others = _bristle_starts(views, start) if stiffness_is_open else []
    if others:
        fits = [
            fit(views, model, free_parameters(rig, predictors, model, full), TRIAL_STEPS, 1e-7, with_equations=False)
            for model in (start, *others)
        ]
        best = min(fits, key=lambda one: one.mean)
        start, free = best.model, list(best.free)
    return fit(views, start, free, FULL_STEPS, 1e-7)


def free_parameters(rig: Rig, predictors: Sequence[Predictor], model: Model, full: float) -> list[FreeParameter]:
    """Return the parameters of the base model and of recordings that are free during the search for effects.

    The predictors are of the trials that are fitted, the fit starts at `model`, and `full` is the range of the readings.
    """
    identified = identified_base_parameters(rig, predictors)
    names = [name for name in identified if name not in FITTED_FRICTION_PARAMETERS]
    if len(names) < len(identified):
        names += friction_parameters_to_search(rig)
    return [*free_base_parameters(model.parameters, names, full), *_recording_numbers(rig, predictors, full)]


def _bristle_starts(views: Sequence[TrialView], model: Model) -> list[Model]:
    """Models with stiffnesses at which bristles slip within the whole travel, within a sample, and between."""
    p, travels, steps, loads = model.parameters, [0.0], [], [0.0]
    for view in views:
        stimulus = view.predictor.stimulus
        moved = stimulus.slide_speed * np.diff(stimulus.time, prepend=stimulus.time[0])[:, None]
        force = view.predictor.normal_force(model)
        travels.append(float(moved.sum(axis=0).max(initial=0.0)))
        steps.append(moved[moved > 0])
        loads.append(float(force[force > 0].mean()) if (force > 0).any() else 0.0)
    moving = np.concatenate(steps)
    level = max(p.mus, LEAST_FRICTION) * max(loads)
    if not len(moving) or level <= 0.0:
        return []
    softest = level / max(travels)
    stiffest = max(level / float(np.quantile(moving, SMALL_STEP)), 10.0 * softest)
    stiffnesses = np.geomspace(softest, stiffest, BRISTLE_STARTS)
    return [replace(model, parameters=replace(p, sigma0=float(x))) for x in stiffnesses]


def identified_base_parameters(rig: Rig, predictors: Sequence[Predictor], with_forces: bool = True) -> list[str]:
    """Return the names of the base model's parameters that these recordings identify, or their readings alone.

    Readings at a known depth or pose identify only the product of gain and stiffness. It is fitted as `k` if the readings
    are in newtons or if the rig gives the gain, and as `gain` otherwise. Known loads identify both, if readings of a load and
    readings at a depth have a factor in common.
    """
    has_readings = any(p.trial.reading is not None for p in predictors)
    has_forces = with_forces and any(p.trial.force is not None for p in predictors)
    depths, loads = ([p.trial for p in predictors if (p.trial.stimulus == "force") is known] for known in (False, True))
    loads = [trial for trial in loads if trial.level is not None and trial.level.any()]
    depth_known, force_known = bool(depths), bool(loads)
    shared = set.intersection(*({t.factor if isinstance(t.factor, str) else "" for t in own} for own in (depths, loads)))
    slides = has_forces and any(p.trial.force is not None and p.stimulus.slide_speed.any() for p in predictors)
    own_unit, gain_given = rig.parameters.unit != "N", "gain" in rig.given
    names: list[str] = []
    if depth_known and not (own_unit and has_readings and not (gain_given or has_forces or shared)):
        names.append("k")
    if depth_known and rig.parameters.normal_law == "linear":
        names.append("cn")
    if has_readings and (force_known or (own_unit and (has_forces or not gain_given))):
        names.append("gain")
    if own_unit and any(p.trial.reading is not None and not p.trial.tared for p in predictors):
        names.append("zero")
    if slides:
        names += FITTED_FRICTION_PARAMETERS
    return names


def _recording_numbers(rig: Rig, predictors: Sequence[Predictor], full: float) -> list[FreeParameter]:
    """Free factors, zeros and contact heights of recordings (see :class:`.trial.Trial`).

    The first factor is one if all recordings have a free one, because a factor that they share is the sensor's. The same
    holds for zeros if the sensor's own is fitted.
    """
    made = []
    own_zero = "zero" in identified_base_parameters(rig, predictors)
    for word in ("factor", "zero"):
        recorded = [p.trial for p in predictors if word == "factor" or p.trial.reading is not None]
        values = [getattr(trial, word) for trial in recorded]
        names = list(dict.fromkeys(value for value in values if isinstance(value, str)))
        all_free = all(isinstance(value, str) for value in values)
        for name in names[1:] if all_free and (word == "factor" or own_zero) else names:
            called = number_name(word, name)
            if word == "factor":
                made.append(FreeParameter(RECORDING, called, 1.0 / LARGEST_OWN_FACTOR, LARGEST_OWN_FACTOR, log=True))
            else:
                made.append(FreeParameter(RECORDING, called, -100.0 * full, 100.0 * full, scale=full))
    forces = {p.trial.force_zero: p.trial.force for p in predictors if p.trial.force is not None}
    for (name, force), (column, axis) in product(forces.items(), enumerate(FORCE)):
        values = force[:, column]
        if isinstance(name, str) and np.isfinite(values).any():
            size = max(float(np.nanmax(np.abs(values))), 1e-12)
            made.append(FreeParameter(RECORDING, number_name(axis, name), -100.0 * size, 100.0 * size, scale=size))
    # Heights are between those at which the start is off by the largest penetration.
    starts = {p.trial.contact_height: p.trial.height_start for p in predictors if isinstance(p.trial.contact_height, str)}
    deep = rig.parameters.max_penetration
    for name, start in starts.items():
        called = number_name(CONTACT_HEIGHT, str(name))
        made.append(FreeParameter(RECORDING, called, start - deep, start + deep, scale=HEIGHT_SCALE * deep))
    return made


def with_recording_numbers(model: Model, predictors: Sequence[Predictor]) -> Model:
    """Return a model with free factors of one, free zeros of zero, and free contact heights where their fit starts."""
    numbers: dict[str, float] = {}
    for word, value in NEUTRAL_NUMBERS.items():
        names = [getattr(p.trial, word) for p in predictors]
        numbers |= {number_name(word, name): value for name in names if isinstance(name, str)}
    biased = [p.trial.force_zero for p in predictors if isinstance(p.trial.force_zero, str) and p.trial.force is not None]
    numbers |= {number_name(axis, name): 0.0 for name in biased for axis in FORCE}
    named = [p.trial for p in predictors if isinstance(p.trial.contact_height, str)]
    numbers |= {number_name(CONTACT_HEIGHT, str(trial.contact_height)): trial.height_start for trial in named}
    return replace(model, recordings=numbers)


def friction_parameters_to_search(rig: Rig) -> list[str]:
    """Return the names of the friction parameters that are free during the search for effects.

    `mus`, `mud` and `x0` are a Stribeck law of their own, and `ct` is viscous friction. If they were free, they would hide
    the two effects of these names. So those that the rig states are held, and only the level of friction is fitted.
    """
    p = rig.parameters
    names = list(FITTED_FRICTION_PARAMETERS)
    if {"mus", "mud", "x0"} <= rig.given and p.mus > 0:
        names = [FRICTION_LEVEL, *(name for name in names if name not in ("mus", "mud", "x0"))]
    if "ct" in rig.given:
        names.remove("ct")
    return names
