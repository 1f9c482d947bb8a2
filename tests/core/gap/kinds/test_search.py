# SPDX-License-Identifier: GPL-3.0-or-later
"""Which kinds are named, and which kinds recordings can tell apart."""

from __future__ import annotations

import gap_cases as cases
import numpy as np
import pytest

from palpate.benchmarks._hidden import cases as hidden
from palpate.core.effects.engine.registry import library
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.fitting.noise_floor import ChannelNoise, force_noise, reading_noise
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.kinds.decision import decided
from palpate.core.gap.kinds.dictionaries import MISALIGNMENT, VARIANTS
from palpate.core.gap.kinds.distinguishability import distinctions
from palpate.core.gap.kinds.recorded import recorded
from palpate.core.gap.kinds.search import ScoredSet, score_of, search_kinds

BY_LABEL = {variant.label: variant for variant in VARIANTS}


def _searched(rig, possible):
    predictors = [p for p in predictors_of(rig.trials, rig) if p.trial.use == "fit"]
    noise = reading_noise(predictors, max(float(np.ptp(p.trial.reading)) for p in predictors)), force_noise(predictors, 1.0)
    seen = recorded(predictors, Model(rig.parameters), {"cn"}, noise)
    return run_generator(search_kinds(seen, set(possible)))


def run_generator(steps):
    """Return what a generator returns; its shares of the work grow."""
    shares = [0.0]
    while True:
        try:
            shares.append(next(steps)[1])
        except StopIteration as stop:
            assert shares == sorted(shares) and shares[-1] <= 1.0
            return stop.value


POSSIBLE = ("stiffening", "creep", "hysteresis", "crosstalk", "saturation", "lag", "drift")


def test_every_kind_is_one_of_the_library():
    assert {variant.kind for variant in (*VARIANTS, MISALIGNMENT)} <= set(library())
    assert len({variant.label for variant in VARIANTS}) == len(VARIANTS)


def test_two_kinds_are_named_together_and_nothing_beside_noise():
    both = _searched(
        cases.rig(contact=cases.relaxing(0.3), change=lambda r, t: r - 0.4 * np.maximum(r - 0.05, 0.0), trials=3, seconds=8.0),
        POSSIBLE,
    )
    said = decided(both)
    assert said.kinds == {"creep", "saturation"} and all(one.support > 0.5 for one in said.named)
    assert both.none.solution.excess > 10.0 * said.chosen.solution.excess
    nothing = decided(_searched(cases.rig(trials=3, seconds=8.0), POSSIBLE))
    assert nothing.kinds == frozenset() and nothing.named == () and nothing.is_clear


def test_a_set_with_more_kinds_or_more_curves_must_leave_less():
    search = _searched(cases.rig(trials=2, seconds=6.0), ("stiffening", "saturation"))
    seen, solution = search.recorded, search.none.solution
    none, one, two = ((), (BY_LABEL["stiffening"],), (BY_LABEL["stiffening"], BY_LABEL["saturation"]))
    prices = [score_of(seen, members, solution) for members in (none, one, two)]
    assert prices[0] < prices[1] and prices[2] - prices[1] > 2.0 * (prices[1] - prices[0])


def test_kinds_that_do_as_well_are_rivals_of_each_other():
    search = _searched(cases.rig(trials=2, seconds=6.0), ("stiffening", "creep", "lag"))
    solution = search.none.solution
    search.scored = {
        frozenset(kinds): ScoredSet(tuple(BY_LABEL[kind] for kind in kinds), solution, score, fitted)
        for kinds, score, fitted in (
            ((), 5.0, True), (("creep",), 1.0, True), (("lag",), 1.2, True), (("stiffening",), 1.1, False),
            (("creep", "stiffening"), 0.95, True),
        )
    }  # fmt: skip
    said = decided(search)
    assert said.kinds == {"creep"}  # the pair is hardly better
    assert said.named[0].rivals == ("lag",) and not said.is_clear  # an estimate is no rival
    assert search.support("creep") == pytest.approx(0.25) and search.support("stiffening") == pytest.approx(0.05)


def _told(kind, number, folder):
    """Shares of what the recordings of a hidden case tell, of the effect in the first by that in the second name."""
    rig = read_rig(hidden.write(hidden.draw(kind, number), folder))
    predictors = [p for p in predictors_of(rig.trials, rig) if p.trial.use == "fit"]
    noise = ChannelNoise(0.005 * np.ptp(predictors[0].trial.reading), 1.0, "given"), ChannelNoise(0.05, 1.0, "given")
    seen = recorded(predictors, Model(rig.parameters), {"cn"}, noise)
    kinds = {"misalignment", "dead-zone", "saturation", "creep", "hysteresis", "load-spreading", "crosstalk"}
    return {(one.signal, one.other): one for one in distinctions(seen, kinds)}


@pytest.mark.long("a whole search among pairs of kinds")
def test_a_flat_indenter_cannot_tell_a_height_error_from_a_dead_zone_and_holds_tell_creep_from_hysteresis(tmp_path):
    flat = _told("two", 601, tmp_path)
    assert flat["misalignment/height", "dead-zone"].share < 0.1
    assert flat["creep", "hysteresis"].share > 0.6 and flat["creep", "hysteresis"].is_told
    assert flat["creep", "hysteresis"].smallest < flat["misalignment/height", "dead-zone"].smallest
    assert all(0.0 <= one.share <= 1.0 for one in flat.values())


@pytest.mark.long("a whole search among pairs of kinds")
def test_a_ball_can_hardly_tell_load_spreading_from_crosstalk(tmp_path):
    ball = _told("two", 600, tmp_path)
    assert ball["load-spreading", "crosstalk"].share < 0.2 < ball["load-spreading", "saturation"].share


def test_recordings_of_which_no_reading_is_left_name_nothing():
    rig = cases.rig(trials=2, seconds=4.0)
    predictors = predictors_of(rig.trials[:1], rig)
    noise = ChannelNoise(0.004, 1.0, "given"), ChannelNoise(0.02, 1.0, "given")
    seen = recorded(predictors, Model(rig.parameters), {"cn"}, noise, np.ones(len(rig.texels), bool))
    assert seen.count == 0 and decided(run_generator(search_kinds(seen, {"creep", "lag"}))).kinds == frozenset()
