# SPDX-License-Identifier: GPL-3.0-or-later
"""Further effects that make the check recordings worse are dropped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..fitting.least_squares import TrialView, fit, held_out_squares
from ..forward.predictor import Model
from .check_recordings import checked_recording
from .forward_selection import SelectionState
from .gap_sizes import GapSizes


def without_harmful_effects(
    whole: Sequence[TrialView], check: Sequence[TrialView], state: SelectionState, gap_sizes: GapSizes
) -> SelectionState:
    """Drop further effects that make the check recordings worse.

    The effect that closes most stays: the verdict says whether it passes the check recordings.

    Parameters
    ----------
    whole, check : sequence of TrialView
        Fitted recordings and check recordings.
    state : SelectionState
    gap_sizes : GapSizes
    """
    while check and len(state.fit.model.effects) > 1:
        shares = [state.improvements[e.name].of_gap if e.name in state.improvements else 0.0 for e in state.fit.model.effects]
        extras = [index for index in np.argsort(shares)[:-1] if index != int(np.argmax(shares))]
        for index in map(int, extras):
            without = _without(whole, state, index)
            quantity = gap_sizes.quantity_for(state.fit.model.effects[index].name)
            if _is_worse_in_all(check, without.fit.model, state.fit.model, gap_sizes, quantity):
                state = without
                break
        else:
            break
    return state


def _is_worse_in_all(check: Sequence[TrialView], without: Model, beside: Model, gap_sizes: GapSizes, quantity: int) -> bool:
    """True if an effect raises the mean square of all check recordings together by more than their noise."""
    outcomes = [checked_recording(view, without, beside, gap_sizes, (1.0, 1.0)) for view in check]
    count = np.array([one.count[quantity] for one in outcomes])
    if not count.any():
        return False
    rises = np.array([one.after[quantity] - one.before[quantity] for one in outcomes])
    noise = np.array([one.rise[quantity] for one in outcomes])
    return bool(rises @ count > noise @ count)


def _without(whole: Sequence[TrialView], state: SelectionState, index: int) -> SelectionState:
    """The state without one of its effects, fitted again."""
    name = state.fit.model.effects[index].name
    free = [
        replace(item, effect=item.effect - 1) if item.effect > index else item
        for item in state.fit.free
        if item.effect != index
    ]
    found = fit(whole, state.fit.model.without(index), free, max_steps=10, tolerance=1e-5)
    steps = {key: step for key, step in state.steps.items() if key != name}
    improvements = {key: value for key, value in state.improvements.items() if key != name}
    return replace(
        state,
        fit=found,
        held_out=held_out_squares(whole, found),
        steps=steps,
        improvements=improvements,
        dropped=(*state.dropped, name),
    )
