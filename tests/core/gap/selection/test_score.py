# SPDX-License-Identifier: GPL-3.0-or-later
"""The rule that names what is missing, held against closed forms, and each of its numbers against models of three sensors."""

import contextlib
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect, library
from palpate.core.gap.base.base_model import with_recording_numbers
from palpate.core.gap.base.recording_differences import with_own_numbers
from palpate.core.gap.candidates.view_set import view_set_of
from palpate.core.gap.fitting.least_squares import Fit, FreeParameter, fit
from palpate.core.gap.forward.predictor import Model, number_name, predictors_of
from palpate.core.gap.selection import blocks, diagnosis, noise_level, rule_numbers, score, search, verdict
from palpate.core.gap.selection.noise_level import NoiseLevel, Sums
from palpate.core.gap.selection.score import OWN_NUMBERS, Hypothesis, Score, drawn_weights
from palpate.core.jobs import run_job
from palpate.core.model.sensor import Effect

BLOCKS, COUNT = 16, 100.0
MEASURED = np.array([True, False])
PRICE = 3.0


def sums(left, changes=()):
    """Sums of a model that leaves these mean squares of readings in every block, a number or one each."""
    count = np.tile([COUNT, 0.0], (BLOCKS, 1))
    return Sums(
        count * np.broadcast_to(left, BLOCKS)[:, None],
        count,
        np.stack([count, count]),
        np.stack([count, count]),
        np.array([count * change for change in changes]).reshape(len(changes), BLOCKS, 2),
    )


def model(left, *labels, changes=None, assumed="", numbers=1):
    """A model of some forms that leaves this much; its effects change the prediction by `changes`."""
    effects = tuple(Effect(*label.split("/"), {}) for label in labels)
    free = tuple(FreeParameter(0, f"number {i}", 0.0, 1.0) for i in range(numbers)) if labels else ()
    fit = SimpleNamespace(free=free, model=SimpleNamespace(effects=effects))
    one = Hypothesis(fit, sums(left, (0.0,) * len(labels) if changes is None else changes), assumed)
    one.__dict__["is_bent"] = False
    return one


def rule(error=0.01):
    """A rule for white noise of mean square one."""
    count = np.tile([COUNT, 0.0], (BLOCKS, 1))
    return Score(NoiseLevel(count, count, np.full(2, error)), MEASURED, PRICE, drawn_weights(BLOCKS))


def done(value):
    """A job that is finished."""
    return value
    yield


def test_the_score_is_the_logarithm_of_what_is_left_and_allowed():
    one = model(3.0, "creep/power", changes=(4.0,))
    expected = -0.5 * rule_numbers.STRETCHES * np.log(2.0 + rule_numbers.FORMULA_ERROR * 4.0 + 0.01) - PRICE
    assert rule().value(one) == pytest.approx(expected)
    own = model(3.0, assumed=OWN_NUMBERS, changes=(4.0,))
    allowed = rule_numbers.FREE_FORM_ERROR * 4.0  # numbers of recordings cost a name, and follow any gain and level
    assert rule().value(own) == pytest.approx(-0.5 * rule_numbers.STRETCHES * np.log(2.0 + allowed + 0.01) - PRICE)
    assert rule().value(model(0.5)) == pytest.approx(-0.5 * rule_numbers.STRETCHES * np.log(0.01))  # never below the noise


def test_displacements_that_a_scan_has_found_are_numbers():
    free = (FreeParameter(0, "z", 0.0, 1.0),)
    moved = effect("misalignment", "rigid", x=0.001, y=0.0, z=0.0, about_x=0.0, about_y=0.0, about_z=0.02)
    one = Hypothesis(SimpleNamespace(free=free, model=SimpleNamespace(effects=(moved,))), None)
    assert one.number_count == 3  # the height, and two of the motion along the skin


@pytest.mark.parametrize(("left", "joins"), [(1.01, False), (1.2, True)])
def test_an_effect_joins_if_it_pays_its_name(left, joins):
    """A gap of 0.2 closes; one of 0.01 is no more than the error of the noise."""
    base, one = model(left), model(1.0, "creep/power")
    assert (rule().value(one) > rule().value(base)) is joins
    assert (rule().most_to_gain(base) > 0.0) is joins


@pytest.mark.parametrize(("left", "is_open"), [(1.015, False), (1.025, True)])
def test_no_effect_is_looked_for_where_no_gap_is_significant(left, is_open):
    """The error of the noise is 0.01, and two of it are significant; an effect that closed either would pay its name."""
    found = search.Search({})
    found.score = rule()
    assert found.score.most_to_gain(model(left)) > 0.0 and found.is_open(model(left)) is is_open


@pytest.mark.parametrize("least", [-5.0, -1.0, 1.0])
def test_an_effect_more_reaches_a_score_where_it_leaves_no_more_than_this(least):
    base, share = model(3.0), rule().most_left(model(3.0), least)
    assert rule().value(model(1.0 + 2.0 * share, "creep/power")) == pytest.approx(least)
    assert rule().most_left(base, 1e3) < 0.0 and rule().most_left(base, -1e3) == 1.0


@pytest.mark.parametrize(("left", "rivals"), [(1.15, ["lag"]), (1.4, [])])
def test_a_kind_with_a_tenth_of_the_weight_is_a_rival(left, rivals):
    """It may leave 0.05 of a change of four variances; the other kind leaves nothing. Its odds are one to eight, or seventy."""
    best, other = model(1.0, "creep/power", changes=(4.0,)), model(left, "lag/first-order", changes=(4.0,))
    found = search.Search({})
    found.score, found.library = rule(), Counter(creep=4, lag=4)
    found.in_place_of = lambda *_: done((model(4.0), {"creep": [best], "lag": [other]}))
    assert verdict.weighed_kinds(found, best, 0)[1] == rivals


def test_of_models_within_a_standard_error_the_smallest_wins():
    rng = np.random.default_rng(0)
    one, other = 1.0 + rng.gamma(1.0, 0.2, size=(2, BLOCKS))
    found = search.Search({})
    found.score = rule()
    small, large = model(one, "creep/power"), model(other - other.mean() + 0.98 * one.mean(), "creep/power", "lag/first-order")
    found.tried = [model(3.0), small, large]
    found.score.price = 0.0
    assert found.score.value(large) > found.score.value(small) and found.best() is small
    few, many = model(one, "creep/power"), model(other - other.mean() + 0.99 * one.mean(), "drift/listed", numbers=84)
    found.tried = [model(3.0), few, many]
    assert found.best() is few
    bent = model(other - other.mean() + 0.99 * one.mean(), "stiffening/foam")
    bent.__dict__["is_bent"] = True
    found.tried = [model(3.0), few, bent]
    assert found.best() is few


def test_a_kind_that_leaves_more_than_its_error_is_refuted_where_another_does_not():
    """Half the score between them is the allowance of the kind that fits: the other leaves 0.6 where it may leave 0.2."""
    best, other = model(1.0, "hysteresis/play", changes=(20.0,)), model(1.6, "softening/peak", changes=(4.0,))
    found = search.Search({})
    found.score, found.library = rule(), Counter(hysteresis=1, softening=1)
    found.in_place_of = lambda *_: done((model(4.0), {"hysteresis": [best], "softening": [other]}))
    assert found.score.value(other) > found.score.value(best)
    weight, rivals = verdict.weighed_kinds(found, best, 0)
    assert weight == pytest.approx(found.score.weight(best, model(4.0))) and not rivals


@pytest.mark.parametrize(("left", "gives_way"), [(1.015, True), (1.1, False)])
def test_a_kind_that_leaves_a_gap_gives_way_to_one_that_reaches_the_noise(left, gives_way):
    """The kind that fits may leave 3.8, so that its score is lower than that of one which leaves 0.3 and may leave nothing."""
    best, other = model(1.3, "misalignment/tilt"), model(left, "adhesion/constant", changes=(75.0,))
    found = search.Search({})
    found.score, found.tried = rule(), [model(9.0), best, other]
    assert found.score.value(best) > found.score.value(other)
    assert found.best() is (other if gives_way else best)


@pytest.mark.parametrize(("left", "helps"), [(2.9, False), (1.8, True)])
def test_an_effect_may_help_to_predict_without_paying_for_its_name(left, helps):
    """A gap of two variances shrinks to 0.8, or hardly; the allowance of the first effect hides either."""
    named = model(3.0, "lag/first-order", changes=(20.0,))
    more = model(left, "lag/first-order", "drift/sensitivity", changes=(20.0, 1.0))
    twice = model(1.0, "lag/first-order", "drift/sensitivity", "creep/power", changes=(20.0, 1.0, 1.0))
    found, asked = search.Search({}), {}

    def with_one_more(parent, most_left):
        asked[parent] = most_left
        return []
        yield

    found._screening = lambda _: SimpleNamespace(with_one_more=with_one_more)
    found.score, found.tried = rule(), [named, more, twice]
    assert found.score.value(more) < found.score.value(named)
    assert run_job(found.predicting(named)) is ((twice if found.score.leaves_gap(more) else more) if helps else named)
    least = model(1.0 + 2.0 * asked[named], "lag/first-order", "drift/sensitivity", changes=(20.0, 0.0))
    assert found.score.weight(least, named) == pytest.approx(rule_numbers.LEAST_WEIGHT)


def test_alternatives_to_an_effect_are_all_fitted_models_with_the_same_other_effects():
    """Of two fits of one form the better is kept. Models with different other effects are ignored."""
    parent, one = model(3.0, "creep/power"), model(1.0, "creep/power", "lag/first-order")
    worse, better = model(1.5, "creep/power", "hysteresis/play"), model(1.2, "creep/power", "hysteresis/play")
    found = search.Search({})
    found.score, found.library = rule(), Counter(creep=1, lag=1, hysteresis=1)
    found.tried = [parent, one, better, model(1.1, "stiffening/foam", "hysteresis/play"), worse]
    found._at_end = set(found.tried)
    assert found._in_place(one, 1, parent) == {"lag": [one], "hysteresis": [better]}


def test_a_form_left_out_shows_the_error_of_formulas():
    """The second best form leaves a tenth of the change more, which is allowed, unless the best leaves less than that.

    A form of its own statement keeps that.
    """
    found = rule()
    for left, error in ((2.0, 0.1), (1.7, 0.07 + 0.1 * found.noise.error[0]), (1.0, rule_numbers.FORMULA_ERROR)):
        singles = [model(left, "hysteresis/play", changes=(10.0,)), model(left + 1.0, "hysteresis/duhem", changes=(9.0,))]
        found.measure_formula_errors(model(20.0), singles)
        assert found.formula_error("hysteresis/play")[0] == pytest.approx(error)
    assert found.formula_error("creep/power")[0] == rule_numbers.FORMULA_ERROR
    stated = {f"{kind.name}/{form.name}": form.error for kind in library().values() for form in kind.forms if form.error}
    assert stated and all(
        found.formula_error(label)[0] == error < rule_numbers.FORMULA_ERROR for label, error in stated.items()
    )


def test_a_kind_counts_by_all_its_forms_and_confidence_is_a_weight():
    found = rule()
    good, poor = model(1.1, "creep/power"), model(3.0, "creep/exponential")
    alone = found.values_of_kind([good], 1)
    assert found.values_of_kind([good, poor], 4)[0] == pytest.approx(
        np.log(np.mean([*np.exp([found.value(good), found.value(poor)]), 0, 0]))
    )
    weights = found.weights_of([alone, found.values(model(3.0))])
    assert weights.sum() == pytest.approx(1.0) and weights[0] > 0.99
    np.testing.assert_allclose(found.weights_of([alone, alone]), 0.5)


def test_the_noise_is_what_the_best_model_leaves_without_load():
    drifting, settled = model(2.0).sums, model(1.0).sums
    drifting.rest[:] *= 4.0
    assert noise_level.noise_level([drifting, settled]).under(np.ones(BLOCKS))[0] == pytest.approx(1.0)
    slow = model(1.0).sums
    slow.rest[:, : BLOCKS // 2] *= 3.0
    assert noise_level.noise_level([slow]).error[0] > 5 * noise_level.noise_level([settled]).error[0]
    white = np.sqrt(2 * noise_level.WHITE / (BLOCKS * COUNT))  # all blocks are alike: the error of white noise, twice
    assert noise_level.noise_level([settled]).error[0] == pytest.approx(white)
    many = noise_level.measured_noise(np.full((BLOCKS, 2), 1e9))
    assert many.error[0] == pytest.approx(rule_numbers.LEAST_NOISE_ERROR, rel=1e-3)


def test_noise_of_hardly_any_value_without_load_is_that_which_was_measured():
    few = model(1.0).sums
    few.rest[:] *= 300.0
    few.rest_count[:] *= 0.01
    assert noise_level.noise_level([few]).under(np.ones(BLOCKS))[0] == 1.0


# --- each number of the rule, on models that were fitted once

SENSORS = {
    "creep": {"contact": cases.relaxing(), "seed": 7},
    "gain-mismatch": {
        "change": lambda force, time: force * (1.0 + 0.25 * np.sin(2.3 * np.arange(cases.ROWS * cases.COLUMNS))),
        "seed": 1,
    },
    "": {"seed": 6},
}


@pytest.fixture(scope="module")
def searches():
    """Searches on development sensors, with all models that they tried."""
    found = {}
    concluded = diagnosis._concluded
    with pytest.MonkeyPatch.context() as patch:
        for name, words in SENSORS.items():
            patch.setattr(
                diagnosis,
                "_concluded",
                lambda begun, one, *models, name=name: found.setdefault(name, (begun, one)) and concluded(begun, one, *models),
            )
            run_job(diagnosis.diagnose(cases.rig(trials=4, seconds=6.0, **words)))
    return found


@contextlib.contextmanager
def number(name, value):
    """The rule with another number."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (rule_numbers, blocks, noise_level, score, search, verdict):
            if hasattr(module, name):
                patch.setattr(module, name, value)
        yield


def decided(one):
    """Names and scores by the models that a search tried, without another fit."""
    one._weigh()
    best = one.best()
    values = [one.score.value(other) for other in one.tried] + [one.score.lead(best, other)[1] for other in one.tried]
    return best.names, np.array(values)


CONTINUOUS = ("STRETCHES", "FORMULA_ERROR", "DRAWS")
"""Numbers of which every value gives other scores."""


@pytest.mark.slow("whole diagnoses of three sensors")
def test_names_hold_and_no_number_is_idle_or_a_cliff(searches):
    """Half and twice each number: scores or their errors change somewhere, and the names of these sensors nowhere."""
    before = {name: decided(one) for name, (_, one) in searches.items()}
    assert {name: Counter(names) for name, (names, _) in before.items()} == {
        name: Counter([name] if name else []) for name in SENSORS
    }
    for name in (
        "STRETCHES",
        "FORMULA_ERROR",
        "FREE_FORM_ERROR",
        "LARGEST_FORMULA_ERROR",
        "LEAST_NOISE_ERROR",
        "NEAR_ERRORS",
        "FIT_TOLERANCE",
        "FEWER_NUMBERS",
        "DRAWS",
    ):
        kind = type(getattr(rule_numbers, name))
        for times in (0.5, 2.0):
            with number(name, kind(times * getattr(rule_numbers, name))):
                after = {sensor: decided(one) for sensor, (_, one) in searches.items()}
            assert {sensor: names for sensor, (names, _) in after.items()} == {
                sensor: names for sensor, (names, _) in before.items()
            }, (name, times)
            if name in CONTINUOUS:
                changed = any(
                    not np.allclose(after[sensor][1], before[sensor][1]) for sensor in SENSORS if len(before[sensor][1]) > 2
                )
                assert changed, name


@pytest.mark.parametrize(
    ("name", "form", "values", "shows"),
    [
        ("offset", "common", {"offset": 0.2}, (False, False)),
        ("load-spreading", "gaussian", {"width": 0.004}, (True, False)),
        ("stiffening", "polynomial", {"beta2": 300.0, "beta3": 0.0}, (True, True)),
    ],
)
def test_what_an_effect_changes_is_counted_where_it_acts_and_beyond_a_factor_and_a_zero(name, form, values, shows):
    """The formula of an effect on readings leaves nothing in forces, though the stiffness is fitted to both."""
    rig = cases.rig(trials=2)
    rig = replace(rig, trials=tuple(replace(one, force=one.reading[:, :3] * 0.0 + 1.0) for one in rig.trials))
    views = blocks.views_of(predictors_of(rig.trials, rig), (0.01, 0.01), (1.0, 1.0))
    model = Model(replace(rig.parameters, k=1.3 * rig.parameters.k), (Effect(name, form, values),))
    found = Fit(model, (), np.zeros((1, 2)), np.ones((1, 2)))
    (changes,) = blocks.Blocks(views).sums(found, views, False).changes
    largest = changes.sum(axis=0).max()
    assert [bool(change > 1e-9 * max(largest, 1.0)) for change in changes.sum(axis=0)] == list(shows)


def test_numbers_of_recordings_are_counted_beyond_those_that_all_share():
    rig = with_own_numbers(cases.rig(trials=3))
    predictors = predictors_of(rig.trials, rig)
    views = blocks.views_of(predictors, (0.01, 0.01), (1.0, 1.0))
    model = with_recording_numbers(Model(rig.parameters), predictors)
    shares = []
    for factors in ([1.2, 1.2, 1.2], [1.2, 0.9, 1.1]):
        numbers = {number_name("factor", one.name): factor for one, factor in zip(rig.trials, factors, strict=True)}
        found = Fit(replace(model, recordings={**model.recordings, **numbers}), (), np.zeros((1, 2)), np.ones((1, 2)))
        shares.append(float(blocks.Blocks(views).sums(found, views, True).changes[0].sum()))
    assert shares[0] < 1e-9 * shares[1]


def test_check_recordings_change_nothing_of_what_is_counted_in_fitted_ones():
    rig = cases.rig(trials=3)
    effect, counted = Effect("stiffening", "polynomial", {"beta2": 300.0, "beta3": 0.0}), []
    for deeper in (0.0, 0.002):
        last = rig.trials[-1]
        moved = replace(rig, trials=(*rig.trials[:-1], replace(last, position=last.position - [0.0, 0.0, deeper])))
        views = blocks.views_of(predictors_of(moved.trials, moved), (0.01, 1.0), (1.0, 1.0))
        one = blocks.Blocks(views)
        found = Fit(Model(moved.parameters, (effect,)), (), np.zeros((1, 2)), np.ones((1, 2)))
        counted.append(one.sums(found, views, False).changes[0][one.recording < len(views.fitted)])
    np.testing.assert_array_equal(*counted)


@pytest.mark.parametrize(("left", "chosen"), [(1.005, "creep/exponential"), (1.05, "creep/power")])
def test_a_form_with_fewer_numbers_describes_as_well_what_the_noise_leaves_open(left, chosen):
    """The error of the noise is 0.01; blocks are alike, so that the difference has no error of its own."""
    forms = [model(1.0, "creep/power", numbers=3), model(left, "creep/exponential", numbers=2)]
    assert rule().best_form(forms).forms == (chosen,)


# --- readings and net forces together


def swinging(seed=1):
    """A sensor whose gain swings with a temperature that nobody records; its net forces are those of the base model."""
    rng = np.random.default_rng(seed)

    def swing(force, time):
        return force * (1.0 + 0.35 * np.sin(2.0 * np.pi * time / 5.0 + rng.uniform(0.0, 6.0)))[:, None]

    rig, measured = cases.rig(trials=4, seconds=8.0, seed=seed, stated=80.0, change=swing), []
    for one in predictors_of(rig.trials, rig):
        normal = one.normal_force(Model(rig.parameters)).sum(axis=1)
        force = np.column_stack([np.zeros((len(normal), 2)), -normal])
        measured.append(replace(one.trial, force=force + 0.003 * normal.max() * rng.normal(size=force.shape)))
    return replace(rig, trials=tuple(measured))


def test_fits_weigh_readings_and_forces_as_the_score_does():
    """The weight is the ratio of the derivatives of S by the squares; it is one where noise is all that is left."""
    count = np.tile([COUNT, 0.1 * COUNT], (BLOCKS, 1))
    found = Score(NoiseLevel(count, count, np.array([0.01, 0.02])), np.array([True, True]), PRICE, drawn_weights(BLOCKS))

    def leaving(readings, forces):
        one = model(1.0, "creep/power", changes=(4.0,))
        one.sums = Sums(count * [readings, forces], count, np.stack([count] * 2), np.stack([count] * 2), one.sums.changes)
        return one

    step = 1e-5
    by_readings, by_forces = (
        found.value(leaving(3.0 + step * share, 1.4 + 10.0 * step * (1.0 - share))) for share in (1.0, 0.0)
    )
    at = found.value(leaving(3.0, 1.4))
    assert found.force_weight(leaving(3.0, 1.4)) == pytest.approx((by_forces - at) / (by_readings - at), rel=1e-3)
    assert found.force_weight(leaving(1.01, 1.02)) == 1.0 == rule().force_weight(model(3.0))


def test_sums_are_in_units_of_the_noise_whatever_the_weight_of_forces():
    rig = swinging()
    views = blocks.views_of(predictors_of(rig.trials, rig), (0.01, 0.02), (1.0, 1.0))
    effect = Effect("stiffening", "polynomial", {"beta2": 300.0, "beta3": 0.0})
    found = Fit(Model(rig.parameters, (effect,)), (), np.zeros((1, 2)), np.ones((1, 2)))
    plain, weighted = (blocks.Blocks(views).sums(found, own, False) for own in (views, views.weighted(50.0)))
    for name in ("left", "count", "rest", "changes"):
        np.testing.assert_allclose(getattr(weighted, name), getattr(plain, name), rtol=1e-12)
    squares = [
        sum(view.squares(view.residual(found.model)) for view in own.fitted) / sum(view.counts for view in own.fitted)
        for own in (views, views.weighted(50.0))
    ]
    np.testing.assert_allclose(*squares, rtol=1e-12)  # a value counts as much as its square


@pytest.mark.slow("a whole diagnosis")
def test_what_disturbs_the_readings_brings_no_name_through_the_forces():
    """With the weights of the noise the base model followed the readings, and a drift (0.99) mended its error in the forces."""
    concluded, kept = diagnosis._concluded, []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosis, "_concluded", lambda begun, one, *models: kept.append(one) or concluded(begun, one, *models))
        result = cases.diagnosed(swinging())
    assert result.verdict == "unexplained" and not any(one.confidence >= rule_numbers.SURE for one in result.findings)
    (found,) = kept
    screening, base = found.under("")
    plain = fit(screening.views.fitted, base.fit.model, base.fit.free)
    assert found.score.value(base) > found.score.value(screening.hypothesis(plain)) + found.score.price


# --- converters


def test_a_model_without_steps_cannot_have_made_readings_that_repeat_a_few_values():
    found, step = rule(), Effect("quantization", "round", {"step": 0.5})
    plain, stepped = model(1.0), model(3.0, "quantization/round")
    for one, effects in ((plain, ()), (stepped, (step,))):
        one.fit.model = Model(cases.rig(trials=1, seconds=1.0).parameters, effects)
    before = found.value(plain) - found.value(stepped)
    assert before > 0.0 and found.reaches_noise(plain) and not found.leaves_gap(plain)
    found = replace(found, has_few_values=True, _kept={})
    assert found.value(plain) - found.value(stepped) == pytest.approx(before - score.IMPOSSIBLE)
    assert found.leaves_gap(plain) and not found.reaches_noise(plain)
    assert found.most_left(plain, found.value(stepped)) == 1.0 and found.most_to_gain(plain) > 0.0  # a converter may join


def in_steps(rounding, **words):
    """A sensor behind a converter with steps of 6 % of the range."""
    rig = cases.rig(trials=4, seconds=8.0, seed=2, stated=80.0, **words)
    step = 0.06 * max(one.reading.max() for one in rig.trials)
    return replace(rig, trials=tuple(replace(one, reading=step * rounding(one.reading / step)) for one in rig.trials))


@pytest.mark.slow("whole diagnoses")
@pytest.mark.parametrize(
    ("rounding", "words", "named"),
    [(np.floor, {}, {"quantization"}), (np.round, {"contact": cases.relaxing()}, {"quantization", "creep"})],
)
def test_a_coarse_converter_is_named_whatever_noise_it_hides(rounding, words, named):
    """Without load no noise is seen. With readings rounded down, a drift alone once left no more than that."""
    result = cases.diagnosed(in_steps(rounding, **words))
    assert {one.name for one in result.findings if one.confidence >= rule_numbers.SURE} == named


def test_values_are_few_if_readings_have_fewer_of_them_than_their_load():
    def are_few(one):
        return view_set_of(predictors_of(one.trials, one), (1e-15, 1.0)).repeats_few_values(Model(one.parameters))

    plain = cases.rig(trials=4, seconds=8.0, seed=2, stated=80.0)
    small = replace(plain, trials=tuple(replace(one, reading=1e-12 * one.reading) for one in plain.trials))  # in farads, say
    assert are_few(in_steps(np.floor)) and not are_few(plain) and not are_few(small)
    level = np.repeat(1e-3 * np.array([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0]), 200)  # a load that has steps itself
    sensed = cases.depth_trial(np.arange(len(level)) / cases.RATE, level, reading=np.zeros((len(level), 24)))
    rig = cases.grid_rig(6, 4, cases.PITCH, plain.parameters)
    (one,) = predictors_of([sensed], rig)
    made = replace(sensed, reading=one.predict(Model(rig.parameters)).reading ** 2)
    assert not are_few(replace(rig, trials=(made,)))


def test_forces_in_check_recordings_alone_weigh_nothing():
    count = np.tile([COUNT, 0.0], (BLOCKS, 1))
    count[-1, 1] = COUNT
    weights = drawn_weights(BLOCKS)
    weights[:, -1] = 0.0
    found = Score(NoiseLevel(count, count, np.full(2, 0.01)), count.sum(axis=0) > 0, PRICE, weights)
    one = model(3.0)
    one.sums = Sums(3.0 * count, count, np.stack([count] * 2), np.stack([count] * 2), one.sums.changes)
    assert found.force_weight(one) == 1.0
