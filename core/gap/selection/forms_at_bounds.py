# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects with a number at its bound, once the selection is over: bounds that say nothing about the kind of the effect go.

A number at its bound carries no sure name. But a bound may be where a formula turns into a simpler one of its kind, as a
warming-up that takes for ever is a drift at one rate. Or it may be one that only keeps one kind from standing for another
(:attr:`.specification.Form.fitted_up_to`), and all other kinds leave far more. Neither changes which effects are in the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.engine.registry import form_of
from ..fitting.least_squares import Fit, FreeParameter, TrialView, fit, held_out_squares
from .candidates import FittedCandidate, Scales, parameters_at_bounds
from .confidence import CLEAR_LEAD
from .forward_selection import SelectionState, SelectionStep, means_of

SAME_FORMULA = 1.01
"""Two formulas that leave mean squares within this ratio in the fitted recordings are the same there. Chosen by eye."""
MAX_STEPS, TOLERANCE = 20, 1e-5
"""Of the fits with another form or bound."""


def without_bounds_of_forms(whole: Sequence[TrialView], state: SelectionState, scales: Scales) -> SelectionState:
    """Return the state with simpler forms, or with the effects' own bounds, in place of those that hold a number.

    Parameters
    ----------
    whole : sequence of TrialView
        All fitted recordings.
    state : SelectionState
    scales : Scales
    """
    for index, effect in enumerate(state.fit.model.effects):
        step = state.steps.get(effect.name)
        if step is None or not parameters_at_bounds(state.fit.model, state.fit.free, index):
            continue
        found = _with_simpler_form(whole, state, index, step, scales) or _with_own_bounds(whole, state, index, step)
        if found is not None:
            state = replace(state, fit=found, held_out=held_out_squares(whole, found))
    return state


def _with_simpler_form(
    whole: Sequence[TrialView], state: SelectionState, index: int, step: SelectionStep, scales: Scales
) -> Fit | None:
    """The fit with a simpler form of an effect that leaves the same in the fitted recordings; None if there is none."""
    model, old = state.fit.model, state.fit.model.effects[index]
    forms = [one for one in step.ranked if one.candidate.name == old.name and one.candidate.form.name != old.form]
    for one in forms:
        effect = one.fit.model.effects[-1]
        if len(effect.values) >= len(old.values) or one.candidate.has_texel_parameters:
            continue
        start = replace(model, effects=(*model.effects[:index], effect, *model.effects[index + 1 :]))
        free = _free_with(state.fit, one, index, scales)
        found = fit(whole, start, free, max_steps=MAX_STEPS, tolerance=TOLERANCE)
        if found.mean <= SAME_FORMULA * state.fit.mean and not parameters_at_bounds(found.model, found.free, index):
            return found
    return None


def _free_with(found: Fit, one: FittedCandidate, index: int, scales: Scales) -> list[FreeParameter]:
    """Free parameters of a fit with those of another form of one of its effects."""
    own = one.candidate.free_parameters(index, scales, abs(found.model.parameters.gain))
    return [*(item for item in found.free if item.effect != index), *own]


def _with_own_bounds(whole: Sequence[TrialView], state: SelectionState, index: int, step: SelectionStep) -> Fit | None:
    """The fit up to an effect's own bound, where it is at a tighter one and leads clearly; None if that is no better."""
    model, effect = state.fit.model, state.fit.model.effects[index]
    taken = {one.name for one in model.effects}
    others = [left for one, left in zip(step.ranked, step.remaining, strict=True) if one.candidate.name not in taken]
    if min(others, default=np.inf) < CLEAR_LEAD * step.of(effect.name):
        return None
    at = parameters_at_bounds(model, state.fit.free, index)
    gain = abs(model.parameters.gain)
    form = form_of(effect.name, effect.form)
    own = {p.name: p.scaled(gain).high for p in form.parameters}
    free = [
        replace(item, high=own[item.name])
        if item.effect == index and item.name in form.fitted_up_to and at.get(item.name) == item.high
        else item
        for item in state.fit.free
    ]
    if free == list(state.fit.free):
        return None
    found = fit(whole, model, free, max_steps=MAX_STEPS, tolerance=TOLERANCE)
    better = float(means_of(held_out_squares(whole, found), found).sum()) < float(state.means.sum())
    return found if better else None
