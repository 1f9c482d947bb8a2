# SPDX-License-Identifier: GPL-3.0-or-later
"""The gap workflow names what is hidden, says when nothing is, and says when nothing it knows explains what is."""

import base64
import json
import re
from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from palpate.core.effects.engine.registry import effect, kind_of
from palpate.core.errors import FileError
from palpate.core.gap.candidates.candidates import Candidate, scales_of
from palpate.core.gap.candidates.rao_score import ScoreTest
from palpate.core.gap.candidates.starting_points import starting_points
from palpate.core.gap.fitting.least_squares import FreeParameter, TrialView, cross_fitted, fit, free_base_parameters
from palpate.core.gap.fitting.residual_tests import residual_structure
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.report import summary
from palpate.core.gap.report.comparison import gap_errors, nrmse
from palpate.core.gap.report.sentences import next_experiment, noise_sentence
from palpate.core.io.sensor_toml import read_sensor


def views_of(rig, noise=1.0):
    return [TrialView(Predictor(trial, rig), noise=(noise, 1.0), stretch_count=2) for trial in rig.of("fit")]


def test_the_fit_is_that_of_scipy():
    rig = cases.rig(contact=cases.relaxing(), seed=1, trials=3, seconds=6.0)
    views = views_of(rig)
    start = Model(rig.parameters, (effect("creep", "exponential"),))
    free = [
        *free_base_parameters(rig.parameters, ("k", "cn"), 1.0),
        FreeParameter(0, "amount", 0, 0.95),
        FreeParameter(0, "time", 0.02, 100, log=True),
    ]
    found = fit(views, start, free, max_steps=40, tolerance=1e-10)

    def residual(x):
        parameters = replace(rig.parameters, k=x[0], cn=x[1])
        model = Model(parameters, (effect("creep", "exponential", amount=x[2], time=x[3]),))
        return np.concatenate([view.residual(model).ravel() for view in views])

    other = least_squares(
        residual, [60, 0.6, 0.2, 2.0], bounds=([1, 0, 0, 0.02], [1e3, 10, 0.95, 100]), x_scale=[60, 0.6, 0.2, 2]
    )
    p, values = found.model.parameters, found.model.effects[0].values
    np.testing.assert_allclose([p.k, p.cn, values["amount"], values["time"]], other.x, rtol=2e-3)
    assert found.sse.sum() == pytest.approx(2 * other.cost, rel=1e-6)


def test_cross_fitting_is_nearly_fitting_without_every_other_stretch():
    rig = cases.rig(contact=cases.relaxing(), seed=2, trials=4, seconds=8.0)
    views = [replace(view, stretch_count=4) for view in views_of(rig)]
    free = free_base_parameters(rig.parameters, ("k", "cn"), 1.0)
    found = fit(views, Model(rig.parameters), free, max_steps=30, tolerance=1e-9)
    unseen = cross_fitted(found, views, [view.residual(found.model) for view in views])
    for fold in (0, 1):
        parts = [
            (view, part) for view in views for i, part in enumerate(view.stretches(view.residual(found.model))) if i % 2 != fold
        ]
        without = fit(
            [replace(v, samples=part) for v, part in parts], Model(rig.parameters), free, max_steps=30, tolerance=1e-9
        )
        for view, own in zip(views, unseen, strict=True):
            r = view.residual(without.model)
            for part in view.stretches(r)[fold::2]:
                assert (own[part] ** 2).sum() == pytest.approx(float((r[part] ** 2).sum()), rel=0.05)


def test_noise_has_no_structure_and_hum_has():
    rng = np.random.default_rng(5)
    rig = cases.rig(seed=5)
    predictors = [Predictor(trial, rig) for trial in rig.of("fit")]
    noise = [lfilter([1], [1, -0.95], rng.normal(size=p.trial.reading.shape), axis=0) for p in predictors]
    assert residual_structure(predictors, noise).total < 0.03
    hum = [
        0.5 * np.sin(40 * p.trial.time + i)[:, None] + rng.normal(size=p.trial.reading.shape) for i, p in enumerate(predictors)
    ]
    found = residual_structure(predictors, hum)
    assert found.strongest == "common mode" and found.total > 0.05


def test_empty_cells_of_a_dense_grid_hide_nothing():
    """Cells that are not measured count neither as residuals of zero nor as neighbours that agree."""
    rig = cases.rig(seed=5, seconds=6.0, trials=4)
    rng, empty = np.random.default_rng(5), np.arange(cases.ROWS * cases.COLUMNS) % 6 != 0
    shares = []
    for hidden in (False, True):
        residuals, predictors = [], []
        for number, trial in enumerate(rig.of("fit")):
            residual = 0.4 * np.sin(2 * np.pi * 7.3 * trial.time)[:, None] + rng.normal(size=trial.reading.shape)
            reading = np.where(empty & hidden, np.nan, trial.reading)
            predictors.append(Predictor(replace(trial, reading=reading), rig))
            residuals.append(np.where(empty & hidden, 0.0, residual))
            assert number < 3
        shares.append(residual_structure(predictors, residuals).shares["common mode"])
    # Of four texels each is predicted by three others, whose mean has a third of their noise.
    expected = 0.08 / (0.08 + 1.0 / 3.0) * 0.08 / 1.08
    assert shares[1] == pytest.approx(expected, rel=0.5) and shares[0] > shares[1] > 0.005


@pytest.mark.parametrize("form", ["gaussian", "exponential"])
def test_a_search_of_load_spreading_does_not_begin_where_nothing_spreads(form):
    """Loads that spread by a kernel of their own: the first starting point spreads them about as far."""
    width = 1.2 * cases.PITCH
    position = cases.rig(trials=1, seconds=1.0).texels.position
    apart = np.linalg.norm(position[:, None] - position[None], axis=2)
    kernel = 1.0 / (1.0 + (apart / width) ** 2) ** 2
    kernel /= kernel.sum(axis=0)
    rig = cases.rig(change=lambda r, t: r @ kernel.T, seed=14, trials=3, seconds=6.0, stated=80.0)
    views = views_of(rig, 1e-3)
    found = fit(views, Model(rig.parameters), free_base_parameters(rig.parameters, ("k", "cn"), 1.0))
    kind = kind_of("load-spreading")
    candidate = Candidate(kind, next(one for one in kind.forms if one.name == form))
    scales = scales_of([view.predictor for view in views], found.model)
    first = starting_points(candidate, ScoreTest(views, found), views, scales)[0][1]
    assert 0.3 * width < first.values["width"] < 3.0 * width
    (free,) = candidate.free_parameters(0, scales, 1.0)
    assert 0.2 * cases.PITCH < free.low < 0.3 * cases.PITCH


def test_loads_spread_alike_on_a_mesh_whose_rim_has_small_vertices():
    """Each vertex is a texel of one stiffness: those at the rim take as much of a load as their distance says."""
    width = 1.2 * cases.PITCH
    rig = cases.rig(trials=1, seconds=1.0)
    apart = np.linalg.norm(rig.texels.position[:, None] - rig.texels.position[None], axis=2)
    kernel = np.exp(-0.5 * (apart / width) ** 2)
    kernel /= kernel.sum(axis=0)
    rig = cases.rig(change=lambda r, t: r @ kernel.T, noise=1e-4, seed=14, trials=3, seconds=6.0, stated=80.0)
    near = (apart < 1.1 * cases.PITCH).sum(axis=0)  # with the vertex itself: 3 at a corner, 4 at a side
    texels = replace(rig.texels, area=rig.texels.area * np.where(near == 3, 0.25, np.where(near == 4, 0.5, 1.0)))
    rig = replace(rig, texels=texels)
    shape = kind_of("load-spreading").forms[0].name
    model = Model(replace(rig.parameters, cn=0.8), (effect("load-spreading", shape, width=width),))
    for trial in rig.trials:
        error = Predictor(trial, rig).predict(model).reading - trial.reading
        assert np.sqrt(np.mean(error**2)) < 0.005 * trial.reading.max()


def test_nothing_hidden_but_wrong_parameters_is_no_gap():
    result = cases.diagnosed(cases.rig(seed=6, colour=0.8, stated=130.0))
    assert result.verdict == "no gap" and not result.findings and not result.ambiguous
    assert result.best.model.parameters.k == pytest.approx(80.0, rel=0.01)


@pytest.mark.slow("a whole diagnosis, the one that names an effect in this tier")
def test_creep_is_named_and_the_gap_closes(tmp_path, monkeypatch):
    """A plan that fails takes no finished result with it; test_report_exchange.py has the place of an earlier report."""

    def plan_after(_result):
        raise FileError("0.1 N do not rest on the sensor.")
        yield  # as the real one is a job

    monkeypatch.setattr(summary, "plan_after", plan_after)
    result = cases.diagnosed(cases.rig(contact=cases.relaxing(), seed=7))
    assert [named.name for named in result.findings] == ["creep"]
    assert result.verdict == "explained" and result.findings[0].confidence > 0.6
    for _ in summary.write_report(result, tmp_path, gap_errors(result)):
        pass
    found = json.loads((tmp_path / "gap.json").read_text())
    assert not (tmp_path / "next_experiment.csv").exists()
    assert "No further recording was planned: 0.1 N do not rest on the sensor." in found["warnings"]
    assert found["format"] == "palpate-gap/1" and found["found"][0]["effect"] == "creep"
    floor, before, after = found["gap"]["noise_floor"], found["gap"]["before"]["check"], found["gap"]["after"]["check"]
    assert max(after**2 - floor**2, 0) < 0.2**2 * (before**2 - floor**2)  # four fifths of the gap, noise removed
    assert sum(entry["share"] for entry in found["where"] if "phase" in entry) == pytest.approx(1.0, abs=1e-3)
    assert found["found"][0]["gap_after"] == pytest.approx(found["gap"]["after"]["fit"])
    # What was written is the sensor that was judged.
    sensor = read_sensor(tmp_path / "sensor.toml")
    again = nrmse(result.of("check"), Model(sensor.parameters, sensor.effects), result.full)
    assert again == pytest.approx(after, rel=1e-9)
    page = (tmp_path / "report.html").read_text()
    pictures = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert len(pictures) == 5 and all(base64.b64decode(one).startswith(b"\x89PNG") for one in pictures)
    assert "http" not in page.replace("http-equiv", "") and "Creep" in page
    for name in ("overview", "gap", "curves", "loops", "map", "phases"):
        assert (tmp_path / f"{name}.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.long("a whole diagnosis")
def test_hum_is_unexplained():
    result = cases.diagnosed(cases.rig(change=lambda r, t: r + 0.01 * np.sin(2 * np.pi * 7.3 * t)[:, None], seed=9))
    assert result.verdict == "unexplained" and not result.findings and result.line is not None
    assert result.structure.strongest == "common mode"
    assert "without touching" in next_experiment(result)


@pytest.mark.long("a whole diagnosis")
def test_intervals_hold_what_was_hidden():
    """The library's own form is hidden; its intervals should hold it, and be narrow enough to mean something."""
    rig = cases.rig(change=lambda r, t: 0.15 * np.tanh(r / 0.15), seed=10)
    result = cases.diagnosed(rig)
    assert [named.name for named in result.findings] == ["saturation"]
    (level,) = (one for one in result.intervals if one.name == "level")
    assert level.low < 0.15 < level.high and level.high - level.low < 0.03


@pytest.mark.long("a whole diagnosis")
def test_noise_that_grows_with_the_reading_is_named():
    rng = np.random.default_rng(12)
    result = cases.diagnosed(cases.rig(change=lambda r, t: r * (1 + 0.2 * rng.normal(size=r.shape)), noise=0.003, seed=12))
    assert [named.name for named in result.findings] == ["noise"] and result.verdict == "explained"
    assert result.best.model.effects[-1].values["share"] == pytest.approx(0.2, rel=0.1)


def test_what_the_amended_sensor_explains_is_not_called_noise():
    """Where contact begins earlier than the rig says, presses are among the readings "without load"."""
    assert noise_sentence(0.06, 0.07).startswith("Noise is 6% of the range")
    assert noise_sentence(0.06, None).startswith("Noise is 6% of the range")
    said = noise_sentence(0.06, 0.0055)
    assert "Noise" not in said
    assert "0.55%" in said and "contact_height" in said
