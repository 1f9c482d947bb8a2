# SPDX-License-Identifier: GPL-3.0-or-later
"""The library's forms of kinds that were chosen before: for parameters and intervals, not for the choice."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import replace

from ..kinds.decision import Decision
from ..kinds.decision_numbers import LEAST_SUPPORT
from .candidates import DIRECTLY_ESTIMATED
from .confidence import EXPLAINED, UNSURE_CONFIDENCE
from .findings import Diagnosis, Finding
from .forward_selection import ForwardSelection, SelectionState, means_of

SUPPORT_SCALE = 0.15
"""Support above the least that multiplies the odds of a name by e. By eye."""


def with_forms(
    selection: ForwardSelection, base: SelectionState, decision: Decision
) -> Generator[tuple[str, float], None, SelectionState]:
    """Add the best form of each chosen kind, in the order of their support; then what is read off readings, and friction."""
    state = base
    order = sorted(decision.named, key=lambda one: -one.support)
    for number, one in enumerate(order):
        selection.kinds = {one.kind}
        step = yield from selection.best_next(state, 0.5 + 0.4 * number / len(order), 0.4 / len(order), first=True)
        if state is base:
            base.first = step
        if step.ranked:
            best = selection.simplest(step)
            improvement = selection.gap_sizes.improvement(
                state.means, means_of(best.held_out, best.fit), selection.gap_sizes.quantity_for(one.kind)
            )
            steps, gained = {**state.steps, one.kind: step}, {**state.improvements, one.kind: improvement}
            state = SelectionState(best.fit, best.held_out, steps, gained, base.first)
    selection.kinds = set(DIRECTLY_ESTIMATED)
    for _ in DIRECTLY_ESTIMATED:
        step = yield from selection.best_next(state, 0.9, 0.05, first=True)
        longer = selection.extended(state, step, first=state is base)
        if longer is state:
            break
        state = replace(longer, first=base.first)
    selection.kinds = None
    if selection.gap_sizes.both:
        state = yield from selection.friction(state)
    return state


def supported(result: Diagnosis, decision: Decision) -> None:
    """Replace confidences by those that follow from the support of kinds, and the verdict by what the set leaves."""
    named = {one.kind: one for one in decision.named}
    before = decision.without_kinds
    closes = 1.0 - decision.chosen.solution.excess / max(before, 1e-9)
    found: list[Finding] = []
    result.ambiguous = []
    for one in result.findings:
        kind = named.get(one.name)
        if kind is None:
            found.append(one)
            continue
        sure = 1.0 / (1.0 + math.exp(-(kind.support - LEAST_SUPPORT) / SUPPORT_SCALE))
        if kind.support < LEAST_SUPPORT or closes < EXPLAINED or result.check.is_refuted or result.misleading_faults:
            sure = min(sure, UNSURE_CONFIDENCE)
        rivals = kind.rivals if kind.support < LEAST_SUPPORT else ()
        if rivals:
            result.ambiguous.append((one.name, *rivals))
        found.append(replace(one, confidence=round(sure, 3), rivals=rivals, doubts=()))
    result.findings = found
    if result.verdict == "explained" and closes < EXPLAINED and named:
        result.verdict = "unexplained"
