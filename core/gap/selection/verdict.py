# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict on a rig: names with their confidences, rivals in their places, and whether the recordings are explained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.engine.registry import form_of, library
from ...jobs import run_job
from ..candidates.candidates import NOT_FITTED, parameters_at_bounds
from ..fitting.identifiability import curvature_ratio, indistinguishable, unidentifiable
from .findings import ClosedShares, Diagnosis, Finding
from .rule_numbers import LEAST_WEIGHT, SIGNIFICANT_ERRORS, SURE
from .score import Hypothesis, Score
from .search import Search

JUST_UNSURE = SURE - 0.01
"""Highest confidence of a name that has rivals, that a smaller model does without, or that faults of the data may have brought
about."""
FAULTY = "the data have faults that were not put right"
NEARLY_WITHOUT = "the model without it does nearly as well, for one name less"
"""Why a name is not sure, in words."""


def with_best_forms(search: Search, best: Hypothesis) -> Hypothesis:
    """Return the model with that form of each kind which describes the recordings best; the names stay."""
    for name in best.names:
        _, others = run_job(search.in_place_of(best, best.names.index(name)))
        forms = [search.refined(one) if one.number_count < best.number_count else one for one in others[name]]
        best = search.score.best_form(forms)
    return best


def _contains(other: Hypothesis, best: Hypothesis, index: int) -> bool:
    """True if the last effect of `other` can do whatever one of `best` does: bent to a bound, or a number for each texel."""
    per_texel = other.has_texel_numbers(len(other.names) - 1) and not best.has_texel_numbers(index)
    return other.is_bent or per_texel


def judge(search: Search, named: Hypothesis, best: Hypothesis, result: Diagnosis) -> None:
    """Write verdict, findings, ambiguous groups and ruled-out kinds into a result that has its models.

    Findings are in the order in which effects act.

    Parameters
    ----------
    search : Search
    named : Hypothesis
        The model that the rule chose.
    best : Hypothesis
        The amended model: the same kinds, and those that help it predict and do not pay for their names.
    result : Diagnosis
    """
    result.closed, order = closed_shares(search, best), list(library())
    for index in sorted(range(len(best.names)), key=lambda index: order.index(best.names[index])):
        name, form = best.forms[index].split("/")
        if name in named.names:
            found = _judged(search, named, named.names.index(name), result)
        else:
            found = _judged_by_prediction(search, named, best)
        unsettled = _at_bounds(best, index, result.rig.parameters.unit)
        result.findings.append(replace(found, effect=index, name=name, form=form, unsettled=unsettled))
        if found.rivals:
            result.ambiguous.append((name, *found.rivals))
    if result.misleading_faults:
        result.findings = [
            replace(one, confidence=min(one.confidence, JUST_UNSURE), doubts=(*one.doubts, FAULTY)) for one in result.findings
        ]
    result.verdict = _verdict(search, named, best, result)
    _rule_out(search, result)


def _verdict(search: Search, named: Hypothesis, best: Hypothesis, result: Diagnosis) -> str:
    """Explained needs a name that is sure, and a remainder that noise and the error of formulas account for."""
    everywhere = np.ones((1, len(best.sums.count)))  # check recordings, too: they decide the verdict
    is_open = search.score.leaves_gap(best, everywhere) or len(best.names) > len(named.names) or result.line is not None
    if not best.components:
        return "unexplained" if is_open else "no gap"
    is_sure = any(one.confidence >= SURE for one in result.findings) or (not named.names and named.price_count > 0)
    return "explained" if is_sure and not is_open and not result.check.is_refuted else "unexplained"


def weighed_kinds(search: Search, best: Hypothesis, index: int) -> tuple[float, list[str]]:
    """Return the confidence of an effect's kind, and its rivals in its place: kinds with a weight of :data:`LEAST_WEIGHT`.

    Two sorts of kinds have no weight: those that leave more than noise and their own error account for where this one does not,
    and those that can do whatever this one does (see :func:`_contains`) and do no better.
    """
    score, name = search.score, best.names[index]
    parent, others = run_job(search.in_place_of(best, index))
    values = {other: score.values_of_kind(forms, search.library[other]) for other, forms in others.items()}
    is_enough = not score.leaves_gap(best)

    def has_weight(other: str) -> bool:
        ahead = values[other] - values[name]
        is_better = float(ahead[0]) > max(float(ahead[1:].std()), score.resolution)
        is_refuted = is_enough and score.is_refuted(others[other])
        return not is_refuted and (is_better or not _contains(max(others[other], key=score.value), best, index))

    kinds = [other for other in values if other == name or has_weight(other)]
    weights = score.weights_of([*(values[other] for other in kinds), score.values(parent)])
    rivals = [other for other, weight in zip(kinds, weights, strict=False) if other != name and weight > LEAST_WEIGHT]
    return float(weights[kinds.index(name)]), rivals


def _judged(search: Search, best: Hypothesis, index: int, result: Diagnosis) -> Finding:
    """An effect that the rule chose, with its confidence and its rivals."""
    score, name, form = search.score, best.names[index], best.forms[index].split("/")[1]
    parent, others = run_job(search.in_place_of(best, index))
    confidence, rivals = weighed_kinds(search, best, index)
    curvature = curvature_ratio(result.of("fit"), best.fit.model)
    fitted = tuple(max(others[other], key=score.value).fit.model.effects[-1] for other in rivals)
    known = set(best.names) | set(rivals)
    rivals += [one for one in indistinguishable(result.coverage, name, curvature) if one not in known]
    doubts = () if confidence >= SURE or rivals else (NEARLY_WITHOUT,)
    confidence = min(confidence, JUST_UNSURE) if rivals else confidence
    left = {other: min(_excess(score, one) for one in forms) for other, forms in others.items() if other != name}
    nearest = min(left, key=lambda other: left[other], default="")
    leaves = left[nearest] / max(_excess(score, best), float(score.noise.error[score.measured].sum())) if nearest else np.inf
    closes = _share_of_gap(search, parent, best)
    return Finding(index, name, form, round(confidence, 3), tuple(rivals), nearest, leaves, closes, (), doubts, fitted)


def _judged_by_prediction(search: Search, named: Hypothesis, best: Hypothesis) -> Finding:
    """One of the effects that help to predict and do not pay for their names; together they have one weight."""
    closes = _share_of_gap(search, named, best)
    confidence = min(search.score.weight(best, named), JUST_UNSURE)
    return Finding(0, "", "", round(confidence, 3), (), closes=closes, doubts=(NEARLY_WITHOUT,))


def _share_of_gap(search: Search, without: Hypothesis, best: Hypothesis) -> float:
    """Share of the whole gap that is open without an effect and not with it."""
    whole = max(_excess(search.score, search.under(best.assumed)[1]), 1e-12)
    return round(float(np.clip((_excess(search.score, without) - _excess(search.score, best)) / whole, 0.0, 1.0)), 4)


def _excess(score: Score, one: Hypothesis) -> float:
    """Mean square beyond the noise on unseen blocks, summed over readings and forces."""
    return float(score.parts(one)[0][0][score.measured].sum())


def _at_bounds(best: Hypothesis, index: int, unit: str) -> tuple[str, ...]:
    """Which parameters of an effect are at a bound, in words."""
    effect = best.fit.model.effects[index]
    units = {parameter.name: parameter.unit_of(unit) for parameter in form_of(effect.name, effect.form).parameters}
    at = parameters_at_bounds(best.fit.model, best.fit.free, index)
    return tuple(f"{name} is at its bound of {end:.3g} {units[name]}".removesuffix(" 1") for name, end in at.items())


def closed_shares(search: Search, best: Hypothesis) -> ClosedShares:
    """Return how much of the gaps a model closes."""
    if not best.components:
        return ClosedShares()
    blocks = search.under("")[0].blocks
    is_fitted = blocks.recording < len(blocks.views.fitted)
    seen = [one.fit.sse.sum(axis=0) / np.maximum(one.fit.count.sum(axis=0), 1e-9) for one in (search.base, best)]
    unseen, check = (
        [one.sums.left[own].sum(axis=0) / np.maximum(blocks.count[own].sum(axis=0), 1e-9) for one in (search.base, best)]
        for own in (is_fitted, ~is_fitted)
    )
    return ClosedShares(*(_closed(search.score, before, after) for before, after in (seen, unseen, check)))


def _closed(score: Score, before: np.ndarray, after: np.ndarray) -> tuple[float | None, float | None]:
    """Share of the gap between mean squares that closes, for readings and forces; None without one beyond the noise's error."""
    gap = before - score.noise.under(score.weights[0])
    shares = [
        float(min((before[q] - after[q]) / gap[q], 1.0)) if gap[q] > SIGNIFICANT_ERRORS * score.noise.error[q] else None
        for q in (0, 1)
    ]
    return shares[0], shares[1]


def _rule_out(search: Search, result: Diagnosis) -> None:
    """Write for each kind that was not found why."""
    named = {name for group in result.ambiguous for name in group} | {one.name for one in result.findings}
    possible, cannot = set(search.library), unidentifiable(result.coverage)
    before = max(_excess(search.score, search.base), 1e-12)
    for kind in library().values():
        if kind.name in named:
            continue
        alone = [one for one in search.tried if one.names == (kind.name,) and not one.assumed]
        if kind.name in NOT_FITTED:
            why = "the residual noise does not grow with the reading"
        elif kind.name not in possible:
            why = cannot.get(kind.name, "these recordings cannot show it")
        elif result.verdict == "no gap":
            why = "no gap remains for it to explain"
        elif alone:
            closes = 1.0 - min(_excess(search.score, one) for one in alone) / before
            why = f"alone it closes {max(closes, 0.0):.0%} of the squared gap on unseen stretches"
        else:
            why = "fitted to a part of the recordings it closes none of the gap, or its signature is not there"
        result.ruled_out.append((kind.name, why))
