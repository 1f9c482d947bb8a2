# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect that the recordings refute where it is its own is not taken, however well its formula fits elsewhere."""

from dataclasses import replace
from types import SimpleNamespace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.gap.base.base_model import prepared
from palpate.core.gap.candidates.candidates import Candidate, scales_of
from palpate.core.gap.candidates.plausibility import is_plausible
from palpate.core.gap.candidates.view_set import view_set_of
from palpate.core.gap.fitting.least_squares import fit, free_base_parameters
from palpate.core.gap.forward.predictor import Model, predictors_of

SPREAD = 0.02 * np.random.default_rng(1).normal(size=cases.ROWS * cases.COLUMNS)
"""N, of each texel."""


def offset_each(rig):
    """An offset for each texel, fitted on top of the base model."""
    predictors = predictors_of(rig.trials, rig)
    noise, full = prepared(rig, predictors)
    view_set, none = view_set_of(predictors, (noise[0].deviation, 1.0)), tuple([0.0] * len(SPREAD))
    candidate = Candidate(kind_of("offset"), form_of("offset", "listed"))
    free = free_base_parameters(rig.parameters, ("k", "cn"), full[0])
    free += candidate.free_parameters(0, scales_of(predictors, Model(rig.parameters)), 1.0)
    found = fit(view_set.whole, Model(rig.parameters, (effect("offset", "listed", offset=none),)), free)
    return candidate, found, view_set.whole


def always(reading, _time):
    return reading + SPREAD


def only_under_load(reading, _time):
    return reading + SPREAD * (reading > 0.01)


def later(reading, time):
    return reading + SPREAD * (time[:, None] / time[-1]) ** 0.7


def growing():
    """A spread that grows from recording to recording."""
    count = iter(range(6))
    return lambda reading, _time: reading + SPREAD * 0.4 * next(count)


@pytest.mark.parametrize(("change", "is_one"), [(always, True), (only_under_load, False), (later, False), (growing(), False)])
def test_an_offset_is_there_without_load_from_the_beginning(change, is_one):
    candidate, found, views = offset_each(cases.rig(change=change, seed=4, trials=6))
    touched = np.any([(s.predictor.stimulus.depth > 0).any(axis=0) for s in views], axis=0)
    values = np.array(found.model.effects[0].values["offset"])[touched]
    assert np.corrcoef(values, SPREAD[touched])[0, 1] > 0.6  # it fits either way
    assert is_plausible(candidate, found, views) == is_one


@pytest.mark.parametrize(("share_of_way", "is_one"), [(0.1, True), (2.0, False)])
def test_a_softening_comes_to_its_end_within_its_session(share_of_way, is_one):
    """What still goes on when the session ends is wear."""
    rig = cases.rig(change=lambda force, _time: force, seed=4, trials=4)
    rig = replace(rig, trials=tuple(replace(one, time=one.time + 20.0 * i, session="s") for i, one in enumerate(rig.trials)))
    predictors = predictors_of(rig.trials, rig)
    noise, full = prepared(rig, predictors)
    scales = scales_of(predictors, Model(rig.parameters))
    assert np.isfinite(scales.travel) and 1e-3 < scales.travel < 0.1
    candidate = Candidate(kind_of("softening"), form_of("softening", "path"))
    free = candidate.free_parameters(0, scales, 1.0)
    start = effect("softening", "path", share=0.3, path=share_of_way * scales.travel)
    view_set = view_set_of(predictors, (noise[0].deviation, 1.0))
    found = fit(view_set.whole, Model(rig.parameters, (start,)), free, max_steps=0)
    assert is_plausible(candidate, found, view_set.whole) == is_one


@pytest.mark.parametrize(("is_read", "is_weighed"), [(True, True), (False, True), (True, False), (False, False)])
def test_a_pull_shows_in_readings_or_in_net_forces(is_read, is_weighed):
    """A dead zone hides a pull from the readings; where a model says so, the net force has to show it."""
    pull, dead = effect("adhesion", "constant", pull=0.3, depth=1e-3), effect("dead-zone", "hard", threshold=0.5)
    rig = cases.rig(seed=4, trials=4)
    model = Model(rig.parameters, (pull,) if is_read else (dead, pull))
    trials = []
    for predictor in predictors_of([replace(one, force=np.zeros((len(one.time), 3))) for one in rig.trials], rig):
        true = predictor.predict(model if is_weighed else model.without(len(model.effects) - 1))
        trials.append(replace(predictor.trial, reading=predictor.predict(model).reading, force=true.force))
    views = view_set_of(predictors_of(trials, replace(rig, trials=tuple(trials))), (0.004, 0.01)).whole
    candidate = Candidate(kind_of("adhesion"), form_of("adhesion", "constant"))
    assert is_plausible(candidate, SimpleNamespace(model=model), views) == (is_read or is_weighed)
