# SPDX-License-Identifier: GPL-3.0-or-later
"""Where fits of candidates start, in which ranges, and on which views."""

from dataclasses import replace
from types import SimpleNamespace

import gap_cases as cases
import numpy as np
import pytest
import trimesh
from scipy import stats

from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.gap.base.base_model import friction_parameters_to_search, prepared
from palpate.core.gap.base.quantities import friction_kinds
from palpate.core.gap.candidates.candidates import Candidate, _halton_points, candidates, scales_of, search_range
from palpate.core.gap.candidates.direct_estimates import distinct, few_levels, unresponsive_texels
from palpate.core.gap.candidates.rao_score import ScoreTest
from palpate.core.gap.candidates.starting_points import starting_points
from palpate.core.gap.candidates.view_set import view_set_of
from palpate.core.gap.data_faults.data_fault import DataFault
from palpate.core.gap.dataset.rig import Indenter
from palpate.core.gap.fitting.intervals import student_quantile
from palpate.core.gap.fitting.least_squares import FRICTION_LEVEL, TrialView, fit, free_base_parameters, with_values
from palpate.core.gap.forward.predictor import Model, Predictor, predictors_of
from palpate.core.gap.selection.diagnosis import faults_of
from palpate.core.gap.selection.pairs import _dictionary
from palpate.core.gap.selection.screening import Screening, free_with
from palpate.core.geometry.mesh import checked_mesh
from palpate.core.model.parameter import Parameter
from palpate.core.model.sensor_parameters import SensorParameters


def test_a_handful_of_values_is_seen():
    rng = np.random.default_rng(1)
    smooth = rng.uniform(0, 1, 4000)
    np.testing.assert_allclose(distinct(0.25 * np.round(smooth / 0.25))[0], [0, 0.25, 0.5, 0.75, 1])
    assert few_levels(0.25 * np.round(smooth / 0.25)) and few_levels(np.floor(4 * np.sqrt(smooth)) ** 2)
    assert not few_levels(smooth) and not few_levels(np.ones(4000))
    assert not few_levels(np.round(smooth, 2))  # a hundred values: no step is seen by eye


def test_a_stated_fall_of_friction_is_held_and_its_level_free():
    parameters = SensorParameters(k=50.0, mus=0.6, mud=0.45, x0=0.02, ct=0.01)

    def stating(*names):
        return cases.grid_rig(1, 2, 3e-3, parameters, given=names)

    assert friction_parameters_to_search(stating("k", "mus", "mud", "x0", "ct")) == [FRICTION_LEVEL, "sigma0"]
    assert set(friction_parameters_to_search(stating("k", "mus", "mud", "ct"))) == {"mus", "mud", "sigma0", "x0"}
    assert "ct" in friction_parameters_to_search(stating("mus", "mud", "x0"))
    level = free_base_parameters(parameters, [FRICTION_LEVEL], 1.0)
    moved = with_values(Model(parameters), level, [0.9]).parameters
    assert (moved.mus, moved.mud) == pytest.approx((0.9, 0.675))


@pytest.mark.parametrize(
    "beside", [("load-spreading", "gaussian"), ("crosstalk", "neighbours"), ("misalignment", "shift"), None]
)
def test_friction_is_looked_for_where_forces_are(beside):
    """What texels feel of each other is looked at without net forces, in which alone friction shows."""
    rig = cases.rig(trials=2, seconds=4.0)
    trials = [replace(trial, force=np.zeros((len(trial.time), 3))) for trial in rig.trials]
    views = view_set_of([Predictor(trial, rig) for trial in trials], (1.0, 1.0))
    model = Model(SensorParameters(), (effect(*beside),) if beside else ())
    for name in friction_kinds():
        kind = kind_of(name)
        seen = views.quick(Candidate(kind, kind.forms[0]), model)
        assert seen is (views.whole if beside else views.few_texels_with_forces)
        assert all(view.with_forces for view in seen)
    creep = kind_of("creep")
    seen = views.quick(Candidate(creep, creep.forms[0]), model)
    assert seen is (views.few_samples if beside else views.few_texels)
    assert not any(view.with_forces for view in seen)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_fault_counts_if_displaced_texels_have_it_too(swapped):
    """A shift makes channels follow the loads of other texels; two channels that are swapped do so after it as well."""
    plain = cases.rig(trials=3, seconds=4.0)
    moved = Model(SensorParameters(k=80.0, cn=0.0), (effect("misalignment", "shift", x=0.7 * cases.PITCH, y=0.0),))
    trials = [replace(trial, reading=Predictor(trial, plain).predict(moved).reading.copy()) for trial in plain.trials]
    loads = np.concatenate([trial.reading for trial in trials])
    first = int(np.argmax(loads.sum(axis=0)))
    like = np.where(loads.sum(axis=0) > 0.3 * loads[:, first].sum(), loads.T @ loads[:, first], np.inf)
    pair = [first, int(np.argmin(like))]
    for trial in trials if swapped else ():
        trial.reading[:, pair] = trial.reading[:, pair[::-1]]
    rig = replace(plain, trials=tuple(trials))
    names = tuple(trial.name for trial in trials)
    fault = DataFault("swapped-channels", names, "two channels follow each other's load", lambda trial: trial)
    result = SimpleNamespace(rig=rig, faults=[fault])
    assert bool(faults_of(result, moved)) is swapped
    assert faults_of(result, Model(moved.parameters)) == [fault]  # nothing displaced: faults were judged with these texels


def test_a_large_shift_under_a_flat_punch_is_found():
    """A shift changes nothing until an edge passes a texel, so that no derivative points to it."""
    edges, shift = (0.0124, 0.0162, 0.02), {"x": 0.0009, "y": -0.0036}
    solid = trimesh.creation.box(edges)
    plain = cases.rig(trials=4, seconds=1.5)
    rig = replace(plain, indenter=Indenter(checked_mesh(solid.vertices, solid.faces, "punch")[0], edges=edges))
    base = Model(SensorParameters(k=80.0, cn=0.0))
    trials = [replace(one, position=one.position + [0.0, 0.0, 0.5 * edges[2] - cases.RADIUS]) for one in rig.trials]
    truth = base.with_effect(effect("misalignment", "shift", **shift))
    trials = [replace(one, reading=Predictor(one, rig).predict(truth).reading) for one in trials]
    rig = replace(rig, trials=tuple(trials))
    flat = [Predictor(trial, rig) for trial in rig.trials]
    views = [TrialView(one, noise=(1e-3, 1.0)) for one in flat]
    scales = scales_of(flat, base)
    rigid = next(one for one in candidates(flat, base) if one.label == "misalignment/rigid")
    free = [one.name for one in rigid.free_parameters(0, scales, 1.0)]
    assert free == ["z", "about_x", "about_y"]  # an edge stays where it is
    rocked = replace(trials[0], quaternion=np.tile([np.cos(0.01), np.sin(0.01), 0.0, 0.0], (len(trials[0].time), 1)))
    not_all_flat = candidates([*flat, Predictor(rocked, rig)], base)
    assert not any(one.held for one in not_all_flat if one.form.placement)  # such a face meets texels one after another
    test = ScoreTest(views, fit(views, base, free_base_parameters(base.parameters, ("k",), 1.0)))
    candidate = Candidate(kind_of("misalignment"), form_of("misalignment", "shift"))
    _, best = starting_points(candidate, test, None, scales)[0]
    left, whole = (
        sum(float(((one.predict(model).reading - one.trial.reading) ** 2).sum()) for one in flat)
        for model in (base.with_effect(best), base)
    )
    assert left < 0.05 * whole


@pytest.mark.parametrize("threshold", [0.01, 0.02, 0.03])
def test_a_threshold_at_which_readings_jump_is_found(threshold):
    """No derivative points to it, and forms without a jump do not follow it: it is scanned, and screened beside them."""
    rig = cases.rig(lambda force, time: np.where(force > threshold, force, 0.0), trials=3, noise=1e-3)
    seen = predictors_of(rig.trials, rig)
    views = [TrialView(one, noise=(1e-3, 1.0)) for one in seen]
    base = fit(views, Model(rig.parameters), free_base_parameters(rig.parameters, ("k", "cn"), 1.0))
    step = Candidate(kind_of("dead-zone"), form_of("dead-zone", "step"))
    decrease, found = starting_points(step, test := ScoreTest(views, base), None, scales_of(seen, base.model), count=1)[0]
    assert found.values["threshold"] == pytest.approx(threshold, rel=0.02)
    assert decrease > 0.8 * test.total
    assert step.form.is_wide and form_of("dead-zone", "knee").is_wide and not form_of("dead-zone", "hard").is_wide


def test_a_shift_starts_from_the_displacement_that_was_fitted_alone():
    rigid = effect("misalignment", "rigid", x=1e-3, y=-2e-3, z=1e-4, about_x=0.01, about_y=0.0, about_z=0.02)
    alone = {"misalignment/rigid": rigid, "lag/first-order": effect("lag", "first-order", time=0.1)}
    screening = Screening(None, None, None, SimpleNamespace(texels=6), "", alone)
    values = {}
    for name, form in (("misalignment", "shift"), ("lag", "first-order"), ("lag", "second-order")):
        candidate = Candidate(kind_of(name), form_of(name, form))
        values[form] = [one.values for one in screening._known(candidate, 1.0)]
    assert values == {"shift": [{"x": 1e-3, "y": -2e-3}], "first-order": [{"time": 0.1}], "second-order": []}


def test_pairs_are_looked_for_in_free_forms_and_in_those_that_these_do_not_follow():
    """Wires explain a part of what leaks from the channel scanned before; a kind without a free form comes in all its forms."""
    rig = cases.rig(lambda force, _time: force, trials=2, seconds=5.0)
    predictors, model = predictors_of(rig.trials, rig), Model(rig.parameters)
    screening = Screening(
        SimpleNamespace(whole=[TrialView(one) for one in predictors]), None, None, scales_of(predictors, model), "", {}
    )
    found = {
        entry.candidate.label for entry in _dictionary(screening, SimpleNamespace(fit=SimpleNamespace(model=model, free=())))
    }
    assert {"crosstalk/wires", "crosstalk/previous", "lag/second-order-plus-dead-time", "dead-zone/step"} <= found
    assert not found & {"crosstalk/neighbours", "lag/first-order", "dead-zone/hard", "creep/power", "creep/rising-exponential"}
    assert {one.name for one in kind_of("hysteresis").forms} <= {label.split("/")[1] for label in found}


# --- ranges


def test_a_speed_is_that_of_sliding_for_friction_and_that_of_pressing_for_other_effects():
    rig = cases.rig(lambda force, _time: force, trials=2, seconds=5.0)
    predictors = predictors_of(rig.trials, rig)
    scales = scales_of(predictors, Model(rig.parameters))
    rates = [np.abs(np.diff(p.stimulus.depth, axis=0)).max(axis=1) / np.diff(p.trial.time) for p in predictors]
    fastest = max(rate.max() for rate in rates)
    assert scales.rate == pytest.approx(fastest) and 1e-4 < fastest < 1.0
    parameter = Parameter("rate", "m/s", 0.01, 1e-9, 2.0, "Of something.", log=True)
    scales = replace(scales, sliding_speed=1e-6)
    friction, creep = form_of("stribeck", "gaussian"), form_of("creep")
    assert search_range(parameter, scales, creep) == pytest.approx((0.02 * fastest, 2.0 * fastest))
    assert search_range(parameter, scales, friction) == pytest.approx((2e-8, 2e-6))
    work, most = Parameter("life", "J", 0.1, 1e-12, 1e9, "Of something.", log=True), 50.0 * scales.force * scales.seconds
    assert search_range(work, scales, form_of("wear"))[1] == pytest.approx(most * fastest)
    assert search_range(work, scales, friction)[1] == pytest.approx(most * 1e-6)
    drag = Parameter("drag", "N·s/m", 0.1, 1e-12, 1e9, "Of something.", log=True)
    assert search_range(drag, scales, creep)[1] == pytest.approx(2.0 * scales.force / fastest)


def test_a_delay_is_compared_with_the_time_of_a_loading():
    """A time constant of creep may be as long as a recording; where nothing is loaded slowly, a delay of four samples shows."""
    rig = cases.rig(lambda force, _time: force, trials=2, seconds=5.0)
    scales = scales_of(predictors_of(rig.trials, rig), Model(rig.parameters))
    lag, creep = form_of("lag", "second-order-plus-dead-time"), form_of("creep")
    by_name = {p.name: p for p in (*creep.parameters, *lag.parameters[1:])}
    low, high = search_range(lag.parameters[0], scales, lag)
    assert low == pytest.approx(0.5 * scales.step) and high == pytest.approx(4.0 * scales.depth / scales.rate)
    assert high < 0.5 * scales.seconds and search_range(by_name["time"], scales, creep)[1] == 2.0 * scales.seconds
    assert search_range(lag.parameters[0], replace(scales, rate=1e9), lag)[1] == pytest.approx(4.0 * scales.step)
    assert search_range(lag.parameters[0], replace(scales, rate=1e-9), lag)[1] == 2.0 * scales.seconds


# --- points and quantiles without scipy.stats, which takes half a second to load


@pytest.mark.parametrize("dimensions", [1, 2, 5, 12])
def test_halton_points(dimensions):
    sequence = stats.qmc.Halton(dimensions, scramble=False)
    sequence.fast_forward(1)
    assert np.array_equal(_halton_points(dimensions, 300), sequence.random(300))


def test_quantiles():
    for freedom in (1, 2, 7, 40, 1000):
        assert student_quantile(freedom) == pytest.approx(stats.t.ppf(0.975, freedom), rel=1e-14)


# --- texels that do not answer


GONE, TOUCH = [5, 9, 14], 0.004


def silent(reading, _time):
    reading[:, GONE] = 0.0


def stuck(reading, _time):
    reading[:, GONE] = 0.3


def deaf(reading, _time):
    """Stuck but for a twentieth of the signal."""
    reading[:, GONE] = 0.3 + 0.05 * reading[:, GONE]


def railed(reading, _time):
    """To the rail at the first touch, and back when it ends."""
    reading[:, GONE] = np.where(reading[:, GONE] > TOUCH, 2.0, reading[:, GONE])


def clipped(reading, _time):
    np.minimum(reading, 0.03, out=reading)


def estimated(change):
    """Candidate with a rig whose readings are changed, its predictors, views, and the effect that is estimated."""

    def changed(reading, time):
        reading = reading.copy()
        change(reading, time)
        return reading

    rig = cases.rig(change=changed, seed=3, stated=80.0, noise=1e-4)
    predictors = predictors_of(rig.trials, rig)
    noise, _ = prepared(rig, predictors)
    views = view_set_of(predictors, (noise[0].deviation, 1.0)).whole
    candidate = Candidate(kind_of("dead-texels"), form_of("dead-texels", "held"))
    found = unresponsive_texels(views, Model(rig.parameters), candidate, len(rig.texels))
    return candidate, rig, predictors, views, found


@pytest.mark.parametrize(("change", "level"), [(silent, 0.0), (stuck, 0.3), (railed, 2.0), (clipped, None)])
def test_texels_that_do_not_answer(change, level):
    _, rig, _, _, found = estimated(change)
    if level is None:
        assert found is None
        return
    assert np.flatnonzero(found.values["dead"]).tolist() == GONE
    np.testing.assert_allclose(np.asarray(found.values["level"])[GONE], level + rig.parameters.zero, atol=2e-3)


@pytest.mark.parametrize(("change", "follows"), [(silent, 0.0), (stuck, 0.0), (deaf, 0.05)])
def test_a_dead_texel_may_follow_a_share_of_its_load(change, follows):
    candidate, rig, predictors, views, effect = estimated(change)
    model = Model(rig.parameters)
    free = free_with((), model, candidate, effect, scales_of(predictors, model))
    assert [item.number_count(len(rig.texels)) for item in free] == [len(GONE)] * 2
    found = fit(views, model.with_effect(effect), free).model.effects[0].values
    others = np.delete(np.arange(len(rig.texels)), GONE)
    assert all((np.asarray(found[name])[others] == 0.0).all() for name in ("dead", "level"))
    np.testing.assert_allclose(np.asarray(found["dead"])[GONE], 1.0 - follows, atol=2e-3)
    if change is deaf:
        np.testing.assert_allclose(np.asarray(found["level"])[GONE], 0.3 / 0.95 + rig.parameters.zero, atol=2e-3)
