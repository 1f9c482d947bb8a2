# SPDX-License-Identifier: GPL-3.0-or-later
"""What a further recording would separate: against least squares over all samples, as files of a plan, and from end to end."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.benchmarks._recordings import Recording
from palpate.commands import main
from palpate.core.errors import ParameterError
from palpate.core.gap.candidates.candidates import candidates, scales_of
from palpate.core.gap.fitting.least_squares import free_base_parameters
from palpate.core.gap.fitting.noise_floor import ChannelNoise
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.planning.experiment_plan import plan_experiment
from palpate.core.gap.planning.paths import Wishes
from palpate.core.gap.planning.separation import LEAST_SEPARATION, STARTS, Signals
from palpate.core.gap.report.plan_files import experiment_words, planned_sentence, table_rows, write_plan
from palpate.core.jobs import run_job
from palpate.core.model.sensor import Effect

NOISES = ChannelNoise(0.005, 1.0, "given"), ChannelNoise(0.05, 1.0, "given")


@pytest.fixture(scope="module")
def rig():
    """A rig whose recordings go down once, slowly, and stay there: they do not tell creep from much else."""
    made = cases.rig(trials=2, seconds=8.0)
    trials = []
    for trial in made.trials:
        place = trial.position.copy()
        place[:, 2] = cases.RADIUS + np.interp(trial.time, [0.0, 1.0, 8.0], [0.001, 0.001, -0.002])
        trials.append(replace(trial, position=place))
    return replace(made, trials=tuple(trials))


def test_what_a_rival_leaves_is_that_of_least_squares_over_all_samples(rig):
    fitted = predictors_of(rig.trials[:1], rig)
    model = Model(replace(rig.parameters, cn=0.0))
    labels = ("gain-mismatch/listed", "saturation/tanh", "creep/power")
    forms = [one for one in candidates(fitted, model) if one.label in labels]
    signals = Signals(model, free_base_parameters(model.parameters, ["k"], 1.0), forms, fitted, NOISES)
    pairs = list(itertools.permutations([label.partition("/")[0] for label in labels], 2))
    products = signals.products(fitted)
    found = {pair: signals.separation(products, *pair) for pair in pairs}
    scales = scales_of(fitted, model)

    def changes(form):
        effects = [form.effect(values, scales.texels, 1.0) for values in form.starting_values(scales, 1.0, STARTS)]
        readings = [fitted[0].predict(model.with_effect(effect)).reading for effect in effects]
        return np.stack([(one - fitted[0].predict(model).reading).ravel() / NOISES[0].deviation for one in readings], axis=1)

    load = fitted[0].predict(model).reading
    each = np.zeros((*load.shape, load.shape[1]))
    each[:, np.arange(load.shape[1]), np.arange(load.shape[1])] = load
    for form in forms:
        if form.name == "gain-mismatch":
            continue
        own, base = changes(form), load.reshape(-1, 1)
        alone = own - base @ np.linalg.lstsq(base, own, rcond=None)[0]
        for other in forms:
            if other is not form:
                rival = each.reshape(load.size, -1) if other.name == "gain-mismatch" else changes(other)
                matrix = np.concatenate([base, rival / np.maximum(np.linalg.norm(rival, axis=0), 1e-300)], axis=1)
                left = own - matrix @ np.linalg.lstsq(matrix, own, rcond=1e-6)[0]
                share = np.median((left**2).sum(axis=0) / (alone**2).sum(axis=0))
                assert found[form.name, other.name].share == pytest.approx(share, rel=0.02, abs=1e-5), (form.name, other.name)


def test_kinds_that_were_fitted_are_separated_as_they_were_fitted(rig):
    """Texels that lie lower read about what springs with a threshold read; other values differ more, and net forces do, too."""
    model, depth = Model(replace(rig.parameters, cn=0.0)), 4e-4
    height = Effect("misalignment", "tilt", {"about_x": 0.0, "about_y": 0.0, "z": -depth})
    known = {"misalignment": height, "dead-zone": Effect("dead-zone", "hard", {"threshold": model.parameters.k * depth})}
    free, found = free_base_parameters(model.parameters, ["k"], 1.0), []
    for with_forces, effects in ((False, known), (True, known), (False, None)):
        force = np.zeros((len(rig.trials[0].time), 3)) if with_forces else None
        fitted = predictors_of([replace(rig.trials[0], force=force)], rig)
        labels = [f"{one.name}/{one.form}" for one in known.values()]
        forms = [one for one in candidates(fitted, model) if one.label in labels]
        signals = Signals(model, free, forms, fitted, NOISES, effects)
        found.append(signals.separation(signals.products(fitted), *known).deviations)
    assert found[0] < 0.5 * LEAST_SEPARATION < LEAST_SEPARATION < min(found[1:]), found


def test_a_plan_names_a_programme_and_writes_a_recording_that_a_rig_can_have(rig, tmp_path):
    plan = run_job(plan_experiment(rig, Wishes(between=("creep", "saturation"), duration=6.0)))
    one = plan.experiment
    planned = experiment_words(one, "plan.csv")
    assert set(planned["between"]) == {"creep", "saturation"} and one.limits.duration == 6.0
    assert planned["separation_after"] > 2.0 * planned["separation_before"]
    rows = dict(table_rows(plan))
    assert "hysteresis" in plan.cannot_show and rows["hysteresis"] == plan.cannot_show["hysteresis"]
    path, out = cases.write(rig, tmp_path), tmp_path / "plan"
    out.mkdir()
    written = write_plan(plan, out)
    assert [file.name for file in written] == ["plan.json", "plan.csv"]
    words = json.loads(written[0].read_text())
    assert words["experiment"]["programme"] == one.programme and len(words["pairs"]) == len(plan.separations)
    table = np.genfromtxt(written[1], delimiter=",", names=True)
    assert table.dtype.names == ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
    assert np.allclose(np.stack([table[axis] for axis in "xyz"], 1), one.trajectory.trial.position, rtol=0, atol=1e-10)
    assert main(["gap", str(path), "--plan", "--between", "creep", "drift", "--out", str(out)]) == 0
    assert json.loads(written[0].read_text())["experiment"]["between"] == ["creep", "drift"]  # the earlier plan is replaced


def test_what_is_known_by_unloading_is_planned_with_unloading(rig):
    plan = run_job(plan_experiment(rig, Wishes(between=("hysteresis", "stiffening"))))
    depth = cases.RADIUS - plan.experiment.trajectory.trial.position[:, 2]
    assert "hysteresis" in plan.cannot_show and (np.diff(depth) < 0.0).any()
    words = experiment_words(plan.experiment, "plan.csv")
    assert words["separation_after"] > 2.0 * words["separation_before"]


def test_a_programme_that_separates_no_more_is_not_recommended():
    words = {"file": "plan.csv", "programme": "stairs", "between": ["creep", "lag"], "limits": {"duration": 6.0}}
    words |= {"separation_before": 5.0, "separation_after": 9.0}
    assert planned_sentence(words).endswith("by 9 standard deviations of the noise; your recordings alone by 5.")
    said = planned_sentence(words | {"separation_after": 5.2, "net_forces": False})
    assert said.startswith("No programme within these limits separates creep from lag better") and "record net forces" in said


def test_options_of_a_plan_that_do_not_go_together_are_refused(rig, tmp_path, capsys):
    path = str(cases.write(rig, tmp_path))
    for options, said in (
        ([], "--out DIR"),
        (["--out", str(tmp_path), "--between", "creep", "lag"], "give --plan"),
        (["--plan", "--sensor", "Pad"], "leave out"),
        (["--plan", "--between", "creep", "nonsense"], "no effect 'nonsense'"),
        (["--plan", "--between", "creep", "noise"], "No trajectory is planned for 'noise'"),
        (["--plan", "--between", "creep", "creep"], "stands alone"),
        (["--plan", "--depth", "0"], "depth is 0"),
    ):
        assert main(["gap", path, *options]) == 1
        assert said in capsys.readouterr().err
    with pytest.raises(ParameterError):
        run_job(plan_experiment(rig, Wishes(area=(5.0, 6.0, 5.0, 6.0))))


# --- what recordings leave ambiguous, a recording along the written trajectory resolves


ROWS, COLUMNS, PITCH, RADIUS, K = 5, 3, 4e-3, 14e-3, 60.0
RATE, DEEP = 25.0, 2.5e-3
SENSOR = f"""
grid = {{ rows = {ROWS}, columns = {COLUMNS}, pitch = {PITCH} }}
thickness = 6e-3
k = {K}
cn = 0.0
unit = "N"
gain = 1.0
zero = 0.0
[indenter]
shape = {{ sphere = {RADIUS} }}
"""
SHARE, TAU, POWER = 0.35, 2.5, 0.6
"""Of the stress that relaxes: by a stretched exponential (Kohlrausch), which the library does not have."""
NOISE = 0.003
"""Of full load."""


def loads(path):
    """Forces (T, n) N of springs under a ball whose centre follows a path (T, 3), m."""
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    x, y = (column - 0.5 * (COLUMNS - 1)) * PITCH, (row - 0.5 * (ROWS - 1)) * PITCH
    across = (path[:, :1] - x) ** 2 + (path[:, 1:2] - y) ** 2
    high = np.sqrt(np.maximum(RADIUS**2 - across, 0.0))  # of the ball's middle above the point where it meets the texel's line
    return K * np.maximum(high - path[:, 2:], 0.0) * high / RADIUS  # across the ball's surface


def recorded(path, rng):
    """A recording of the pad, whose stress relaxes, under a ball whose centre follows a path (T, 3), m."""
    force, time = loads(path), np.arange(len(path)) / RATE
    lost = SHARE * (1.0 - np.exp(-((time / TAU) ** POWER)))
    rises = np.diff(force, axis=0, prepend=0.0)
    relaxed = np.stack([np.convolve(rises[:, i], lost)[: len(path)] for i in range(force.shape[1])], axis=1)
    readings = np.maximum(force - relaxed, 0.0) + NOISE * K * DEEP * rng.normal(size=force.shape)
    texels = {f"texel_{i}": one for i, one in enumerate(readings.T)}
    return {"time": time, **dict(zip("xyz", path.T, strict=True)), **texels}


def said_of(trials, folder, out):
    rig = Recording("pad that relaxes", SENSOR, trials).write(folder)
    assert main(["gap", str(rig), "--out", str(folder / out)]) == 0
    return json.loads((folder / out / "gap.json").read_text())


@pytest.mark.long("palpate gap twice, from a rig to its report")
def test_the_trajectory_that_is_written_resolves_what_was_ambiguous(tmp_path):
    """Three slow presses, without a hold or another speed, and then what is planned."""
    rng, time = np.random.default_rng(5), np.arange(int(14 * RATE)) / RATE
    depth = np.interp(time, [0.0, 1.0, 7.0, 13.0, 14.0], [-1e-3, -1e-3, DEEP, -1e-3, -1e-3])
    slow = np.stack([0.0 * time, 0.0 * time, RADIUS - depth], axis=1)
    trials = [(f"press_{i}", "check" if i == 2 else "fit", recorded(slow, rng)) for i in range(3)]
    before = said_of(trials, tmp_path, "before")
    assert any("creep" in group for group in before["ambiguous"])
    assert before["planned_experiment"]["separation_after"] > before["planned_experiment"]["separation_before"]
    table = np.genfromtxt(tmp_path / "before" / "next_experiment.csv", delimiter=",", names=True)
    time = np.arange(0.0, table["time"][-1], 1.0 / RATE)
    planned = np.stack([np.interp(time, table["time"], table[axis]) for axis in "xyz"], axis=1)
    after = said_of([*trials, ("planned", "fit", recorded(planned, rng))], tmp_path, "after")
    assert not after["ambiguous"] and after["verdict"] == "explained"
    assert [one["effect"] for one in after["found"] if one["confidence"] >= 0.5] == ["creep"]
