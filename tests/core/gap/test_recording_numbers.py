# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that the rig leaves open are fitted with the base model: factors of specimens, zeros, and contact heights."""

import re
from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from rig_files import RIG, write

from palpate.core.gap.base.base_model import free_parameters, start_model
from palpate.core.gap.candidates.candidates import candidates
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.fitting.least_squares import TrialView, cross_fitted, fit
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.forward.stimulus import stimulus_of
from palpate.core.model.sensor_parameters import SensorParameters

NOISE, STEP = 1e-3, 0.05
STATED = SensorParameters(k=60.0, cn=0.6)


def pressed(seed, factor=1.0, zero=0.0, net=False, use="fit"):
    """A trial of a sensor of 80 N/m whose responses are multiplied and shifted."""
    rng, time = np.random.default_rng(seed), STEP * np.arange(160)
    level = np.interp(time, [0, 0.5, 2.0, 4.0, 5.0, 6.0, 8.0], [-1e-3, -1e-3, 2e-3, 1e-3, -1e-3, 1.5e-3, -1e-3])
    rate = np.gradient(level, time)
    force = np.where(level > 0, np.maximum(80.0 * level + 0.8 * rate, 0.0), 0.0)[:, None] * np.ones(2)
    reading = zero + factor * force + NOISE * rng.normal(size=force.shape)
    total = np.stack([0.0 * time, 0.0 * time, -factor * force.sum(axis=1)], axis=1) + NOISE * rng.normal(size=(len(time), 3))
    response = {"force": total} if net else {"reading": reading}
    return cases.depth_trial(time, level, name=f"t{seed}", use=use, **response)


def fitted(trials):
    """Predictors of some trials, and the base model fitted to those that are to be fitted."""
    rig = cases.grid_rig(1, 2, 0.004, STATED, trials, ["k"])
    predictors = predictors_of(rig.trials, rig)
    own = [one for one in predictors if one.trial.use == "fit"]
    views = [TrialView(one, noise=(NOISE, NOISE), stretch_count=2) for one in own]
    model = start_model(rig, own)
    return predictors, views, fit(views, model, free_parameters(rig, own, model, 0.2), max_steps=40, tolerance=1e-9)


@pytest.mark.parametrize("net", [False, True])
def test_specimens_differ_by_a_factor(net):
    trials = [pressed(0, net=net), pressed(1, net=net), pressed(2, 1.6, net=net)]
    trials = [replace(trial, factor=name) for trial, name in zip(trials, "AAB", strict=True)]
    _, views, found = fitted(trials)
    assert found.mean < 1.2
    assert found.model.parameters.k == pytest.approx(80.0, rel=0.01)
    assert found.model.recordings == {"factor of A": 1.0, "factor of B": pytest.approx(1.6, rel=0.01)}
    unseen = cross_fitted(found, views, [view.residual(found.model) for view in views])
    assert sum((r**2).sum() for r in unseen) < 1.3 * found.count.sum()  # halves of the only recording of B judge each other


def test_each_recording_has_a_zero_of_its_own():
    trials = [replace(pressed(i, zero=shift), zero=f"t{i}") for i, shift in enumerate((0.0, 0.05, -0.03))]
    *_, found = fitted(trials)
    zeros = [found.model.recordings[f"zero of t{i}"] for i in range(3)]
    np.testing.assert_allclose(zeros, [0.0, 0.05, -0.03], atol=1e-3)
    assert found.mean < 1.2


def test_stated_numbers_are_used_as_they_are():
    trials = [replace(pressed(0, 1.6, 0.05), factor=1.6, zero=0.05), pressed(1)]
    *_, found = fitted(trials)
    assert found.mean < 1.2 and found.model.parameters.k == pytest.approx(80.0, rel=0.01) and not found.model.recordings


def test_a_specimen_that_is_only_checked_has_its_own_numbers():
    trials = [replace(pressed(0), factor="A"), replace(pressed(1, 0.7, 0.1, use="check"), factor="C", zero="C")]
    predictors, _, found = fitted(trials)
    view = TrialView(predictors[1], noise=(NOISE, NOISE))
    assert view.squares(view.residual(found.model))[0] < 1.3 * view.counts[0]
    stiffer = replace(found.model, parameters=replace(found.model.parameters, cn=8.0))
    assert view.squares(view.residual(stiffer))[0] > 5.0 * view.counts[0]  # a factor does not make up for everything


def test_the_force_sensor_has_a_bias():
    shift = np.array([0.02, -0.03, 0.05])
    trials = [pressed(i, net=True, use=use) for i, use in enumerate(("fit", "fit", "check"))]
    trials = [replace(one, force=one.force + shift, force_zero=name) for one, name in zip(trials, "AAB", strict=True)]
    predictors, _, found = fitted(trials)
    biases = [found.model.recordings[f"{axis} of A"] for axis in ("force_x", "force_y", "force_z")]
    np.testing.assert_allclose(biases, shift, atol=3e-4)
    assert found.mean < 1.2 and found.model.parameters.k == pytest.approx(80.0, rel=0.01)
    view = TrialView(predictors[2], noise=(NOISE, NOISE))  # a day that is only checked has a bias of its own
    assert view.squares(view.residual(found.model))[1] < 1.2 * view.counts[1]
    stated = [replace(one, force_zero=tuple(shift)) for one in trials]
    *_, found = fitted(stated)
    assert found.mean < 1.2 and not found.model.recordings


def test_a_rig_says_them(tmp_path):
    def read(words):
        return read_rig(write(tmp_path, RIG.replace('file = "press.csv"', f'file = "press.csv"\n{words}'))).trials[0]

    assert (read("").factor, read("").zero) == (1.0, 0.0)
    assert (read('factor = "free"\nzero = "free"').factor, read('zero = "free"').zero) == ("press", "press")
    assert read('specimen = "A"\nfactor = "free"').factor == "A"
    assert (read("factor = 2").factor, read("zero = -0.5").zero) == (2.0, -0.5)
    assert read('force_zero = "free"').force_zero == "press" and read("force_zero = [0, 0.5, 1]").force_zero == (0.0, 0.5, 1.0)
    assert read('specimen = "A"\nforce_zero = "free"').force_zero == "A"


def test_two_specimens_and_two_loggers(tmp_path, repository):
    """The rig of docs/rig-format.md; the logger of the responses was started a second later."""
    page, late = (repository / "docs" / "rig-format.md").read_text(encoding="utf-8"), 40
    (text,) = [block for block in re.findall(r"```toml\n(.*?)```", page, re.S) if 'specimen = "B"' in block]
    (tmp_path / "rig.toml").write_text(text)
    for trial, factor in zip(cases.rig(trials=4, seconds=6.0, k=80.0).trials, (1.0, 1.0, 1.5, 1.5), strict=True):
        reading, position = factor * trial.reading[late:], trial.position[:-late]
        table = np.column_stack([1e3 * trial.time[:-late], position[:, :2], 1e3 * position[:, 2], reading])
        header = "t,x,y,height," + ",".join(f"texel_{i}" for i in range(reading.shape[1]))
        np.savetxt(tmp_path / f"{trial.name}.csv", table, "%.9g", ",", header=header, comments="")
    found = cases.diagnosed(read_rig(tmp_path / "rig.toml"))
    assert {(fault.kind, fault.put_right) for fault in found.faults} == {("clock-shift", True)}
    assert found.verdict == "no gap" and not found.findings
    assert found.best.model.parameters.k == pytest.approx(80.0, rel=0.02)
    assert found.best.model.recordings["factor of B"] == pytest.approx(1.5, rel=0.02)


# --- contact heights


OFF = 0.0004


def lowered(rig, height, **words):
    """The rig with poses recorded too high by `height`: the sensor's surface is as much higher than they say."""
    trials = [replace(one, position=one.position + [0.0, 0.0, height], **words) for one in rig.trials]
    return replace(rig, trials=tuple(trials))


@pytest.mark.parametrize("height", [-OFF, 0.0029])  # with the second one no recording seems to touch
def test_a_free_height_is_fitted_and_no_effect(height):
    found = cases.diagnosed(lowered(cases.rig(trials=3, seconds=6.0), height, contact_height="all"))
    assert found.verdict == "no gap" and not found.findings
    assert found.best.model.recordings["contact height of all"] == pytest.approx(height, abs=1e-5)
    (interval,) = [one for one in found.intervals if one.name == "contact height of all"]
    assert interval.low < height < interval.high < interval.low + 1e-4


def test_a_stated_height_is_used_as_it_is():
    rig = cases.rig(trials=2, seconds=4.0)
    moved = lowered(rig, OFF, contact_height=OFF)
    for one, other in zip(rig.trials, moved.trials, strict=True):
        np.testing.assert_allclose(stimulus_of(other, moved).depth, stimulus_of(one, rig).depth, atol=1e-12)
        assert stimulus_of(other, moved).trial is other


def test_the_height_of_a_misaligned_sensor_is_no_candidate_beside_a_free_one():
    rig = lowered(cases.rig(trials=2, seconds=4.0), 0.0, contact_height="all")
    predictors = predictors_of(rig.trials, rig)
    open_one = {one.form.name: one for one in candidates(predictors, Model(rig.parameters)) if one.name == "misalignment"}
    assert set(open_one) == {"shift", "turn", "tilt", "rigid"}
    assert all(p.name != "z" for one in open_one.values() for p in one.form.parameters)
    assert open_one["rigid"].effect({"x": 0.001}, 24, 1.0).values["z"] == 0.0
    known = cases.rig(trials=2, seconds=4.0)
    closed = candidates(predictors_of(known.trials, known), Model(known.parameters))
    assert any(p.name == "z" for one in closed if one.name == "misalignment" for p in one.form.parameters)


def test_depths_are_counted_from_where_contact_begins():
    time = np.arange(9.0)
    level = np.array([-2, -1, 0, 1, 2, 1, 0, -1, -2.0]) * 1e-3
    rig = cases.grid_rig(1, 2, 0.004, cases.SensorParameters(k=80.0))
    trial = cases.depth_trial(time, level, reading=np.zeros((9, 2)))
    raised = stimulus_of(trial, rig, height=0.5e-3).depth[:, 0]
    np.testing.assert_allclose(raised, np.maximum(level + 0.5e-3, 0.0))
    clipped = cases.depth_trial(time, np.maximum(level, 0.0), reading=np.zeros((9, 2)))
    np.testing.assert_allclose(stimulus_of(clipped, rig, height=0.5e-3).depth[:, 0], np.where(level > 0, level + 0.5e-3, 0.0))


def test_the_recordings_of_a_session_share_the_height():
    rig = lowered(cases.rig(trials=2, seconds=4.0), OFF, contact_height="all")
    second = replace(rig.trials[1], time=rig.trials[1].time + 10.0)
    trials = [replace(one, session="a") for one in (rig.trials[0], second)]
    plain = predictors_of(cases.rig(trials=2, seconds=4.0).trials, rig)
    model = Model(rig.parameters, recordings={"contact height of all": OFF})
    for one, other in zip(predictors_of(trials, rig), plain, strict=True):
        np.testing.assert_allclose(one.predict(model).reading, other.predict(Model(rig.parameters)).reading, atol=1e-9)


def test_a_rig_says_it(tmp_path):
    def read(of_sensor="", of_trial=""):
        text = RIG.replace("k = 80.0", f"k = 80.0\n{of_sensor}")
        return read_rig(write(tmp_path, text.replace('file = "press.csv"', f'file = "press.csv"\n{of_trial}'))).trials

    assert [one.contact_height for one in read()] == [0.0, 0.0]
    assert [one.contact_height for one in read('contact_height = "free"')] == ["all", "all"]
    assert [one.contact_height for one in read("contact_height = 1e-3", 'contact_height = "free"')] == ["press", 1e-3]
    assert read("", 'contact_height = "free"\nspecimen = "A"')[0].contact_height == "A"
