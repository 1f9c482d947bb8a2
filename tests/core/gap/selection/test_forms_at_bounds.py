# SPDX-License-Identifier: GPL-3.0-or-later
"""A bound where a formula turns into a simpler one, or that only keeps kinds apart, does not stay in the model."""

from __future__ import annotations

import gap_cases as cases
import numpy as np
import pytest
from scipy.signal import lfilter

from palpate.core.effects.engine.registry import form_of, kind_of
from palpate.core.gap.fitting.least_squares import TrialView, fit, free_base_parameters, held_out_squares
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.selection.candidates import Candidate, FittedCandidate, parameters_at_bounds, scales_of
from palpate.core.gap.selection.forms_at_bounds import without_bounds_of_forms
from palpate.core.gap.selection.forward_selection import SelectionState, SelectionStep

RATE = 0.004
"""Newtons per second by which the readings drift."""


def views_of(change):
    rig = cases.rig(change, seed=2, trials=3, seconds=10.0)
    return [TrialView(Predictor(trial, rig), noise=(1e-3, 1.0), stretch_count=2) for trial in rig.of("fit")]


def fitted(views, name, form, **start):
    """A form, fitted on top of the base model from some starting values."""
    parameters = views[0].predictor.rig.parameters
    model, predictors = Model(parameters), [view.predictor for view in views]
    one, scales = Candidate(kind_of(name), form_of(name, form)), scales_of(predictors, Model(parameters))
    free = [*free_base_parameters(parameters, ("k", "cn"), 1.0), *one.free_parameters(0, scales, 1.0)]
    found = fit(views, model.with_effect(one.effect(start, scales.texels, 1.0)), free, max_steps=30)
    return FittedCandidate(one, found, held_out_squares(views, found)), scales


def settled(views, chosen, scales, others):
    """The effect of the state whose step ranked `chosen` and `others`, each with what it leaves."""
    step = SelectionStep([chosen, *(one for one, _ in others)], [1.0, *(left for _, left in others)], 100.0)
    state = SelectionState(chosen.fit, chosen.held_out, {chosen.candidate.name: step})
    after = without_bounds_of_forms(views, state, scales)
    np.testing.assert_allclose(after.held_out, held_out_squares(views, after.fit))
    assert len(after.fit.model.effects) == 1
    return after.fit


def test_a_warming_up_that_takes_for_ever_is_a_drift_at_one_rate():
    views = views_of(lambda force, time: force + RATE * time[:, None])
    warm, scales = fitted(views, "drift", "warm-up", amount=RATE * 1e5, time=1e5)
    line, _ = fitted(views, "drift", "linear", rate=RATE)
    assert parameters_at_bounds(warm.fit.model, warm.fit.free, 0)
    found = settled(views, warm, scales, [(line, 2.0)])
    assert found.model.effects[0].form == "linear"
    assert found.model.effects[0].values["rate"] == pytest.approx(RATE, rel=0.02)
    assert not parameters_at_bounds(found.model, found.free, 0)
    kept = settled(views, warm, scales, [])  # nothing simpler was judged
    assert kept.model.effects[0].form == "warm-up"


def test_a_simpler_form_that_leaves_more_does_not_take_the_place():
    views = views_of(lambda force, time: force + 0.03 * np.exp(time / 4.0)[:, None] / np.e)
    warm, scales = fitted(views, "drift", "warm-up", amount=RATE * 1e5, time=1e5)
    line, _ = fitted(views, "creep", "rising-exponential", amount=0.1, time=5.0)
    assert settled(views, warm, scales, [(line, 1.1)]).model.effects[0].form == "warm-up"


def rising(force, time):
    """Readings go on rising, to two and a half times what they were at first."""
    keeps = np.exp(-(time[1] - time[0]) / 0.8)
    return force + 1.5 * lfilter([1.0 - keeps], [1.0, -keeps], force, axis=0)


@pytest.mark.parametrize(("lead", "amount"), [(2.5, 1.5), (1.5, 1.0)])
def test_an_amount_goes_beyond_the_bound_that_keeps_kinds_apart_where_one_leads(lead, amount):
    views = views_of(rising)
    creep, scales = fitted(views, "creep", "rising-exponential", amount=0.8, time=0.8)
    lag, _ = fitted(views, "lag", "first-order", time=0.3)
    assert parameters_at_bounds(creep.fit.model, creep.fit.free, 0) == {"amount": 1.0}
    found = settled(views, creep, scales, [(lag, lead)])
    assert found.model.effects[0].values["amount"] == pytest.approx(amount, rel=0.05)
