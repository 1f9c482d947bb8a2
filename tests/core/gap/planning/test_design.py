# SPDX-License-Identifier: GPL-3.0-or-later
"""What a further recording would tell: against least squares over all samples, and against what came out."""

from __future__ import annotations

import json
from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from palpate.commands import main
from palpate.core.errors import ParameterError
from palpate.core.gap.fitting.noise_floor import ChannelNoise
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.kinds.columns import columns
from palpate.core.gap.kinds.distinguishability import possible_variants
from palpate.core.gap.kinds.recorded import planned, recorded
from palpate.core.gap.planning.design import DesignSpace, best_design
from palpate.core.gap.planning.experiment_plan import Wishes, plan_experiment
from palpate.core.gap.planning.limits import limits_of
from palpate.core.gap.planning.outlook import least_sureness
from palpate.core.gap.planning.paths import Ground
from palpate.core.gap.planning.programmes import random_programme
from palpate.core.gap.report.plan_files import planned_sentence, table_rows, write_plan
from palpate.core.jobs.job_runner import run_job

NOISE = ChannelNoise(0.005, 1.0, "given"), ChannelNoise(0.05, 1.0, "given")


def _with_one_press(seconds=8.0):
    """A rig whose recordings go down once, slowly, and stay there: they do not tell creep from much else."""
    rig = cases.rig(trials=2, seconds=seconds)
    trials = []
    for trial in rig.trials:
        down = np.interp(trial.time, [0.0, 1.0, seconds], [0.001, 0.001, -0.002])
        place = trial.position.copy()
        place[:, 2] = cases.RADIUS + down
        trials.append(replace(trial, position=place))
    return replace(rig, trials=tuple(trials))


def _space(rig, kinds):
    fitted = [p for p in predictors_of(rig.trials, rig) if p.trial.use == "fit"]
    seen = recorded(fitted, Model(rig.parameters), {"cn"}, NOISE)
    return DesignSpace(seen, fitted, Ground(fitted, limits_of(fitted)), kinds)


def _table(space, further):
    """Columns of every variant and of the base model over all samples of all runs, weighted, as one matrix."""
    variants = possible_variants(space.recorded, {"creep", "hysteresis"})
    base, own = [], {variant.label: [] for variant in variants}
    for seen in (space.recorded, further):
        for number in range(len(seen.runs)):
            made = columns(seen, number, variants)
            flat = {name: np.array([reading.ravel() / seen.noise[0] for reading, _ in pairs]) for name, pairs in made.items()}
            base.append(np.concatenate([flat[name] for name in made if name not in own]))
            for name in own:
                own[name].append(flat[name])
    return np.concatenate(base, axis=1).T, {name: np.concatenate(parts, axis=1).T for name, parts in own.items()}


def _brute_force(base, own, signal, others):
    """Share of a signal's square beside the base model that others leave, by least squares over all samples."""
    free = base - 0.0
    weights = []
    for column in own[signal].T:
        left = column - free @ np.linalg.lstsq(free, column, rcond=None)[0]
        weights.append(1.0 / np.linalg.norm(left))
    target = own[signal] @ np.array(weights)
    alone = target - free @ np.linalg.lstsq(free, target, rcond=None)[0]
    shares = []
    for other in others:
        matrix = np.concatenate([free, own[other]], axis=1)
        scale = np.linalg.norm(matrix, axis=0)
        low = np.concatenate([np.full(free.shape[1], -np.inf), np.zeros(own[other].shape[1])])
        fit = lsq_linear(matrix / scale, target, (low, np.inf), tol=1e-12, max_iter=2000)
        shares.append(2.0 * fit.cost / (alone @ alone))
    return min(shares)


def test_what_a_further_recording_tells_is_that_of_least_squares_over_all_samples():
    space = _space(_with_one_press(6.0), ("creep", "hysteresis"))
    programme = random_programme(space.ground.span, np.random.default_rng(2))
    trajectory = space.ground.trajectory(programme)
    question = frozenset((one.distinction.signal, one.other) for one in space.before)
    told = {(one.distinction.signal, one.other): one.distinction.share for one in space.told(trajectory, question)}
    further = planned(space.recorded, trajectory.as_trial(space.ground.like))
    base, own = _table(space, further)
    loops = ["hysteresis/leading", "hysteresis/trailing", "hysteresis/reading"]
    for signal, other, others in (
        ("creep", "hysteresis", loops),
        ("creep/rising", "hysteresis", loops),
        ("hysteresis/leading", "creep", ["creep", "creep/rising"]),
        ("hysteresis/reading", "creep", ["creep", "creep/rising"]),
    ):
        # lsq_linear ends at a relative tolerance of the cost; the Gram matrix loses half of the digits.
        assert told[signal, other] == pytest.approx(_brute_force(base, own, signal, others), rel=0.01, abs=1e-4)


def test_a_planned_recording_has_the_units_of_those_that_were_made():
    rig = cases.rig(trials=3, seconds=5.0)
    fitted = predictors_of(rig.trials, rig)
    both = recorded(fitted[:2], Model(rig.parameters), {"cn"}, NOISE)
    again = planned(both, rig.trials[1])
    for name in ("load", "elastic", "work", "towards_normal"):
        assert np.array_equal(getattr(again.runs[0], name), getattr(both.runs[1], name))
    assert again.runs[0].read.all() and not np.isfinite(again.runs[0].force).any() and again.full_path == both.full_path


@pytest.mark.long("compares with random trajectories")
def test_the_best_trajectory_tells_what_the_recordings_and_most_random_ones_do_not():
    space = _space(_with_one_press(), ("creep", "hysteresis"))
    question = frozenset((one.distinction.signal, one.other) for one in space.before)
    steps, shares = best_design(space, question), []
    while True:
        try:
            shares.append(next(steps))
        except StopIteration as stop:
            best = stop.value
            break
    assert shares == sorted(shares) and shares[0] >= 0.0 and shares[-1] < 1.0
    assert least_sureness(best.before) < 0.5 and least_sureness(best.after) > 0.8
    rng = np.random.default_rng(9)
    others = [space.design(random_programme(space.ground.span, rng), question).value for _ in range(10)]
    assert best.value > max(others)
    assert space.design(best.programme, question).value == best.value  # the programme alone says all


def test_what_is_known_by_unloading_is_not_shown_without():
    space = _space(_with_one_press(), ("hysteresis", "lag"))
    assert not any(one.is_shown for one in space.before if one.kind == "hysteresis")
    assert all(one.is_shown for one in space.before if one.kind == "lag")
    assert all(one.sureness <= 0.2 and not one.is_told for one in space.before if one.kind == "hysteresis")


@pytest.fixture(scope="module")
def rig():
    return _with_one_press()


@pytest.mark.long("a whole plan of the next recording")
def test_a_plan_names_the_open_pair_and_writes_a_recording_that_a_rig_can_have(rig, tmp_path):
    plan = run_job(plan_experiment(rig, Wishes(between=("creep", "saturation"), duration=6.0)))
    one = plan.experiment
    assert set(one.kinds) == {"creep", "saturation"} and one.limits.duration == 6.0
    assert one.sure_after > one.sure_before + 0.2
    rows = dict(table_rows(plan))
    assert "hysteresis" in plan.cannot_show and rows["hysteresis"] == plan.cannot_show["hysteresis"]
    assert "saturation" in rows["creep"] and "drift" not in rows["creep"]
    path = cases.write(rig, tmp_path)
    out = tmp_path / "plan"
    out.mkdir()
    written = write_plan(plan, out)
    assert [file.name for file in written] == ["plan.json", "plan.csv"]
    words = json.loads(written[0].read_text())
    assert words["experiment"]["sure_after"] == round(one.sure_after, 3) and len(words["pairs"]) == len(plan.outlooks)
    table = np.genfromtxt(written[1], delimiter=",", names=True)
    assert table.dtype.names == ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
    assert np.allclose(np.stack([table[axis] for axis in "xyz"], 1), one.design.trajectory.positions(), rtol=0, atol=1e-10)
    assert main(["gap", str(path), "--plan", "--between", "creep", "drift", "--out", str(out)]) == 0
    again = json.loads(written[0].read_text())  # the earlier plan is replaced
    assert again["experiment"]["between"] == ["creep", "drift"]


def test_a_trajectory_that_tells_no_more_is_not_recommended():
    words = {
        "file": "plan.csv",
        "between": ["creep", "lag"],
        "limits": {"duration": 6.0},
        "sure_before": 0.5,
        "sure_after": 0.9,
    }
    assert planned_sentence(words).endswith("confidence 90% with it, 50% without.")
    said = planned_sentence(words | {"sure_after": 0.52})
    assert said.startswith("No trajectory within these limits separates creep from lag better") and "allow more depth" in said


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
