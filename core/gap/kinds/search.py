# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for the set of kinds that explains recordings best.

All kinds alone; then, about each of the best, every partner by one linearised solution, and the most promising partners
fitted; then triples from the best pairs. The score of a set is ``log(excess + u) + Σ cost``: what it leaves above the noise,
and a price for each of its kinds.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence, Set
from dataclasses import dataclass, field

import numpy as np

from ...effects.engine.registry import kind_of
from .cascade import POSE_SCALE, TEXEL, Cascade, Point
from .decision_numbers import (
    BEST_PAIRS,
    BEST_SINGLES,
    COST_OF_SECOND_CURVE,
    DEFAULT_COST,
    DISPLACED,
    FLOOR,
    FLOOR_DEVIATIONS,
    HOPELESS,
    LARGE_SHIFT,
    MOST_TURNS,
    PARTNERS,
    RIVAL_MARGIN,
    SETTLED,
    STARTING_SHIFTS,
)
from .dictionaries import MISALIGNMENT, VARIANTS, Variant
from .normal_equations import CascadeEquations, Solution, normal_equations
from .recorded import Recorded

KNOWN_KINDS = frozenset({MISALIGNMENT.kind, *(variant.kind for variant in VARIANTS)})
"""Kinds that have a dictionary, so that a search by kinds can name them."""


@dataclass(frozen=True)
class ScoredSet:
    """A set of kinds with its best fit.

    Attributes
    ----------
    members : tuple of Variant
    solution : Solution
    score : float
        The less, the better.
    is_fitted : bool
        Whether it was fitted; else it is a linearised estimate.
    """

    members: tuple[Variant, ...]
    solution: Solution
    score: float
    is_fitted: bool

    @property
    def kinds(self) -> frozenset[str]:
        """Names of its kinds."""
        return frozenset(member.kind for member in self.members)


@dataclass
class KindSearch:
    """All sets of kinds that were scored, the best of each set of names.

    Attributes
    ----------
    recorded : Recorded
    scored : dict of frozenset of str to ScoredSet
    """

    recorded: Recorded
    scored: dict[frozenset[str], ScoredSet] = field(default_factory=dict)

    @property
    def best(self) -> ScoredSet:
        """The set with the best score."""
        return self.fitted[0]

    @property
    def none(self) -> ScoredSet:
        """The empty set: the base model alone."""
        return self.scored[frozenset()]

    @property
    def fitted(self) -> list[ScoredSet]:
        """All sets that were fitted, best first."""
        return sorted((one for one in self.scored.values() if one.is_fitted), key=lambda one: one.score)

    def support(self, kind: str) -> float:
        """Return by how much the best set without a kind is worse than the best one with it."""
        without = [one.score for one in self.fitted if kind not in one.kinds]
        having = [one.score for one in self.fitted if kind in one.kinds]
        return min(without, default=np.inf) - min(having, default=np.inf)

    def add(self, one: ScoredSet) -> None:
        """Keep a set if it is the best of its names; what was fitted counts more than an estimate."""
        before = self.scored.get(one.kinds)
        if before is None or (one.is_fitted, -one.score) > (before.is_fitted, -before.score):
            self.scored[one.kinds] = one


def score_of(recorded: Recorded, members: Sequence[Variant], solution: Solution) -> float:
    """Return ``log(excess + u) + Σ cost`` of a set of kinds."""
    return float(np.log(solution.excess + floor_of(recorded)) + price_of(members))


def price_of(members: Sequence[Variant]) -> float:
    """Return the sum of the costs of a set of kinds."""
    costs = [kind_of(member.kind).cost for member in members]
    price = sum(DEFAULT_COST if cost is None else cost for cost in costs)
    return price + COST_OF_SECOND_CURVE * max(sum(member.is_static for member in members) - 1, 0)


def floor_of(recorded: Recorded) -> float:
    """Return u: what no fit resolves, a share of the noise and the scatter of its mean square over the recordings."""
    return floor_for(recorded.count, recorded.correlation[0])


def floor_for(count: float, correlation: float) -> float:
    """Return the same for so many measured values whose noise has a memory of `correlation` samples."""
    independent = count / correlation
    return FLOOR + FLOOR_DEVIATIONS * float(np.sqrt(2.0 / max(independent, 1.0)))


def search_kinds(recorded: Recorded, possible: Set[str]) -> Generator[tuple[str, float], None, KindSearch]:
    """Look for the best set of kinds.

    Parameters
    ----------
    recorded : Recorded
    possible : set of str
        Names of the kinds that these recordings could show.

    Yields
    ------
    what : str
    share : float
        How much of the work is done.

    Returns
    -------
    KindSearch
    """
    cascade, search = Cascade(recorded), KindSearch(recorded)
    variants = possible_variants(recorded, possible)
    yield "kinds alone", 0.0
    singles = _singles(cascade, search, variants)
    order = sorted(singles, key=lambda one: one.score)[:BEST_SINGLES]
    tried: set[frozenset[str]] = set()
    for number, one in enumerate(order):
        yield f"kinds beside {one.members[0].kind}", 0.1 + 0.6 * number / len(order)
        _extend(cascade, search, one, variants, tried)
    pairs = [one for one in search.fitted if len(one.kinds) == 2]
    for number, one in enumerate(pairs[:BEST_PAIRS]):
        yield "three kinds", 0.7 + 0.3 * number / BEST_PAIRS
        _extend(cascade, search, one, variants, tried)
    return search


def possible_variants(recorded: Recorded, possible: Set[str]) -> list[Variant]:
    """Return the variants of the kinds that recordings could show."""
    several = recorded.texel_count > 1
    found = [
        v
        for v in VARIANTS
        if v.kind in possible and (several or not v.needs_neighbours) and (recorded.has_readings or v.in_contact)
    ]
    if recorded.source.can_move and MISALIGNMENT.kind in possible:
        found.append(MISALIGNMENT)
    return found


def refined(cascade: Cascade, point: Point, turns: int = MOST_TURNS) -> Solution:
    """Fit the members of a point by Gauss–Newton steps from it, each with bounds; return the best solution that was met."""
    best: Solution | None = None
    for turn in range(turns):
        equations = normal_equations(cascade, point, point.members)
        here = _as_it_is(equations, point)
        if best is not None and here > best.fitted * (1.0 + SETTLED) and turn > 1:
            break  # the last step led up
        solution = equations.solve(point.members)
        if best is None or solution.fitted < best.fitted or turn == turns - 1:
            best = solution
        if abs(here - solution.fitted) < SETTLED * (max(solution.fitted - 1.0, 0.0) + FLOOR):
            best = solution
            break
        point = solution.point
    assert best is not None
    return best


def _as_it_is(equations: CascadeEquations, point: Point) -> float:
    """Mean square of the residual at the point itself."""
    x = np.zeros(equations.gram.shape[1])
    for name, value in [*((k, np.array([v])) for k, v in point.base.items()), *point.coefficients.items()]:
        if name in equations.at:
            x[equations.at[name]] = value
    gram, right = equations.gram.sum(axis=0), equations.right.sum(axis=0)
    total = float(equations.square.sum() - 2.0 * x @ right + x @ gram @ x)
    for index, name in enumerate(TEXEL):
        if name in point.texel:
            own = point.texel[name]
            coupling = np.einsum("pn,p->n", equations.coupling.sum(axis=0)[index], x)
            total += float(2.0 * own @ (coupling - equations.texel_right.sum(axis=0)[index]))
            total += float(own @ (equations.texel_gram.sum(axis=0)[index, index] * own))
            for other, other_name in enumerate(TEXEL[:index]):
                if other_name in point.texel:
                    total += float(2.0 * own @ (equations.texel_gram.sum(axis=0)[index, other] * point.texel[other_name]))
    return total / max(float(equations.count.sum()), 1.0)


def _singles(cascade: Cascade, search: KindSearch, variants: Sequence[Variant]) -> list[ScoredSet]:
    """The empty set and each variant alone, fitted."""
    recorded, empty = cascade.recorded, Point()
    equations = normal_equations(cascade, empty, variants)
    nothing = equations.solve(())
    search.add(ScoredSet((), nothing, score_of(recorded, (), nothing), True))
    least = float(np.log(floor_of(recorded)))  # the score of a set that leaves nothing, without its price
    if all(least + price_of((variant,)) > search.none.score for variant in variants):
        return []
    found = []
    for variant in variants:
        solution = equations.solve((variant,))
        if variant is MISALIGNMENT and solution.excess < DISPLACED * nothing.excess:
            solution = _displaced(cascade)
        found.append(ScoredSet((variant,), solution, score_of(recorded, (variant,), solution), True))
    found.sort(key=lambda one: one.score)
    for number, one in enumerate(found):
        near = one.score < found[0].score + HOPELESS
        if number < BEST_SINGLES and near and one.members[0] is not MISALIGNMENT:
            solution = refined(cascade, one.solution.point)
            found[number] = ScoredSet(one.members, solution, score_of(recorded, one.members, solution), True)
        search.add(found[number])
    return found


def _displaced(cascade: Cascade) -> Solution:
    """The best displacement from several starts: a contact that moves by a pitch is not linear in the shift."""
    zero = Point((MISALIGNMENT,))
    best = refined(cascade, zero, turns=2)
    pitch = float(np.sqrt(np.median(cascade.recorded.source.rig.texels.area)))
    sideways = float(np.abs(best.point.coefficients[MISALIGNMENT.label][:2]).max()) * POSE_SCALE[0]
    if best.fitted > 1.0 + FLOOR and sideways > LARGE_SHIFT * pitch:
        for shift in STARTING_SHIFTS:
            own = np.array([*(np.array(shift) * pitch / POSE_SCALE[:2]), 0.0, 0.0, 0.0, 0.0])
            tried = refined(cascade, Point((MISALIGNMENT,), {MISALIGNMENT.label: own}), turns=2)
            best = min(best, tried, key=lambda one: one.fitted)
    return refined(cascade, best.point)


def _extend(
    cascade: Cascade, search: KindSearch, one: ScoredSet, variants: Sequence[Variant], tried: set[frozenset[str]]
) -> None:
    """Screen every partner of a set about its fit, and fit the best of them."""
    least = float(np.log(floor_of(cascade.recorded)))  # the score of a set that leaves nothing, without its price
    worst = search.best.score + RIVAL_MARGIN
    others = [v for v in variants if v.kind not in one.kinds and least + price_of((*one.members, v)) < worst]
    if not others:
        return
    point = one.solution.point
    equations = normal_equations(cascade, point, (*one.members, *others))
    screened = []
    for variant in others:
        members = (*one.members, variant)
        solution = equations.solve(members, with_left_out=False)
        screened.append(ScoredSet(members, solution, score_of(cascade.recorded, members, solution), False))
    screened.sort(key=lambda pair: pair.score)
    for number, pair in enumerate(screened):
        labels = frozenset(member.label for member in pair.members)
        if number < PARTNERS and labels not in tried and pair.score < search.best.score + HOPELESS:
            tried.add(labels)
            solution = refined(cascade, pair.solution.point)
            pair = ScoredSet(pair.members, solution, score_of(cascade.recorded, pair.members, solution), True)
        search.add(pair)
