# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaps, plans, fits and studies by their public functions."""

from __future__ import annotations

import gap_cases as cases
import numpy as np
import pytest

import palpate as pp
from palpate.core.gap.calibration.friction import steady_friction
from palpate.core.gap.report.comparison import rms_by_texel
from palpate.core.gap.report.plots import CAPTIONS
from palpate.core.model.sensor_parameters import SensorParameters


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return cases.write(cases.rig(contact=cases.relaxing(), seed=7, trials=4, seconds=9.0), tmp_path_factory.mktemp("rig"))


@pytest.fixture(scope="module")
def gap(rig):
    return pp.find_gap(pp.read_rig(rig))


@pytest.mark.slow("finds the gap of a small rig, for all tests of this file")
def test_a_gap_names_effects_with_intervals(gap):
    assert gap.verdict == "explained"
    assert gap.error_after < 0.5 * gap.error_before
    names = [effect.name for effect in gap.effects]
    assert names == ["creep"] and all(0 < effect.confidence <= 1 for effect in gap.effects)
    for effect in gap.effects:
        assert repr(effect).startswith(f"<FoundEffect: {effect.name} (") and len(repr(effect)) < 200
        for one in effect.parameters.values():
            assert one.low is None or one.low <= one.value <= one.high
    assert all(name in gap.headline and name in repr(gap) for name in names)
    assert "data:image/png" in gap._repr_html_()


def test_the_amended_sensor_is_simulated(gap):
    assert [effect.name for effect in gap.sensor.effects] == [effect.name for effect in gap.effects]
    assert len(gap.sensor.texels) == cases.ROWS * cases.COLUMNS
    ball = pp.Body.sphere(cases.RADIUS, path_of_motion=[[0, 0, cases.RADIUS], [0, 0, cases.RADIUS - 2e-3]])
    found = pp.simulate(gap.sensor, ball, fps=10)
    assert found.unit == "N" and found.reading[-1].max() > found.reading[0].max()


@pytest.mark.slow("draws every figure of a report")
def test_a_report_is_written_and_its_sensor_read(gap, tmp_path):
    page = gap.report(tmp_path / "out")
    assert (tmp_path / "out" / "gap.json").is_file()
    text = page.read_text(encoding="utf-8")
    assert text.index(CAPTIONS["overview"]) < text.index("<h2>")
    read = pp.read_sensor(tmp_path / "out" / "sensor.toml")
    assert read.effects == gap.sensor.effects and read.parameters == gap.sensor.parameters


def test_the_overview_says_where_what_and_how_much(gap):
    """The maps are those of the errors, a bar stands for the base model, each effect and both models on check recordings."""
    figure, errors = gap.plot("overview"), gap.errors
    *maps, _bar, bars = figure.axes
    assert [axes.get_title() for axes in maps] == ["base model", "amended"]
    for axes, model in zip(maps, (gap.diagnosis.base.model, gap.diagnosis.best.model), strict=True):
        shown = 100.0 * rms_by_texel(gap.diagnosis, model)
        np.testing.assert_allclose(np.sort(axes.images[0].get_array().compressed()), np.sort(shown))
    widths = [bar.get_width() for bar in bars.patches]
    expected = [errors.base["fit"], *errors.stages[1:], errors.base["check"], errors.amended["check"]]
    np.testing.assert_allclose(widths, 100.0 * np.array(expected))
    assert widths[len(gap.effects)] == pytest.approx(100.0 * gap.error_after)
    names = " ".join(label.get_text() for label in bars.get_yticklabels()).replace(" ", "-")
    assert all(effect.name in names for effect in gap.effects)
    assert any(f"{100.0 * errors.noise_floor:.2f}" in text.get_text() for text in bars.texts)


def test_an_interrupted_report_leaves_no_file(gap, tmp_path):
    def stop(step):
        if step.share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gap.report(tmp_path / "out", progress=stop)
    left = [path for path in (tmp_path / "out").rglob("*") if path.is_file() and ".palpate" not in path.parts]
    assert left == []


def test_figures_of_a_gap(gap):
    assert gap.plot("gap")._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(pp.PalpateError, match=r"called 'lops' \(did you mean 'loops'\?\)"):
        gap.plot("lops")


@pytest.mark.slow("plans a recording")
def test_a_plan_is_written_and_can_be_simulated(rig, tmp_path):
    plan = pp.plan_experiment(rig, limits={"depth": 2e-3, "duration": 10.0})
    assert len(plan.rows) > 3 and repr(plan) == f"<Plan: {plan.sentence}>"
    assert {path.name for path in plan.report(tmp_path)} == {"plan.json", "plan.csv"}
    times, positions = plan.path_of_motion
    assert positions.shape == (len(times), 3) and times[-1] <= 10.0 + 1e-9
    ball = pp.Body.sphere(cases.RADIUS, path_of_motion=tmp_path / "plan.csv")
    assert ball.path.positions == pytest.approx(positions, abs=1e-8)


def test_wrong_rigs_and_limits_are_refused(rig, tmp_path):
    (tmp_path / "empty.toml").write_text('format = "palpate-rig/1"\n[sensor]\ngrid = {rows = 2, columns = 2, pitch = 0.001}\n')
    for call, message in (
        (lambda: pp.find_gap(tmp_path / "none.toml"), r"There is no rig '.*none\.toml'"),
        (lambda: pp.find_gap(tmp_path / "empty.toml"), r"has no \[\[trial\]\]: name at least one CSV file"),
        (lambda: pp.find_gap(3), r"rig is 3: give the path of a rig\.toml"),
        (lambda: pp.plan_experiment(rig, limits={"dept": 1e-3}), r"called 'dept' \(did you mean 'depth'\?\)"),
        (lambda: pp.plan_experiment(rig, limits=2e-3), "limits is 0.002: give a mapping"),
        (lambda: pp.plan_experiment(rig, limits={"depth": "2 mm"}), "depth of limits is '2 mm': give a number"),
        (lambda: pp.plan_experiment(rig, limits={"speed": -1.0}), "The limit of the speed is -1"),
        (lambda: pp.plan_experiment(rig, limits={"area": (0, 1)}), r"area of limits has the shape \(2,\)"),
        (lambda: pp.plan_experiment(rig, between=("creep", "crepe")), "There is no effect 'crepe'"),
        (lambda: pp.run_study(tmp_path / "none.toml"), r"none\.toml"),
        (lambda: pp.run_study(tmp_path / "none.toml", formats=("hdf",)), r"no format 'hdf' \(did you mean 'hdf5'\?\)"),
    ):
        with pytest.raises(pp.PalpateError, match=message):
            call()


def test_stiffness_from_arrays_and_from_a_file(tmp_path):
    depth = np.linspace(0.5e-3, 4e-3, 8)
    pressure = 3.924e6 * depth
    fit = pp.fit_stiffness((depth, pressure), area=0.00125, texels=84)
    assert fit.k.value == pytest.approx(3.924e6 * 0.00125 / 84)
    lines = "\n".join(f"{a:.17g},{b:.17g}" for a, b in zip(depth, pressure, strict=True))
    (tmp_path / "foam.csv").write_text(f"compression,pressure\n{lines}\n", encoding="utf-8")
    assert pp.fit_stiffness(tmp_path / "foam.csv", 0.00125, 84).k.value == pytest.approx(fit.k.value)
    with pytest.raises(pp.PalpateError, match="foam has arrays of 8, 7 numbers"):
        pp.fit_stiffness((depth, pressure[:-1]), 0.00125, 84)
    with pytest.raises(pp.PalpateError, match="The sensor's area is -1 m²"):
        pp.fit_stiffness((depth, pressure), -1.0, 84)


def test_friction_from_arrays():
    velocity = np.linspace(0.01, 1.4, 30)
    fit = pp.fit_friction((velocity, 84 * steady_friction(velocity, 0.08, SensorParameters())), normal_force=0.08, texels=84)
    assert fit.parameters.mus == pytest.approx(0.435, rel=1e-6) and fit.parameters.mud == pytest.approx(0.23, rel=1e-6)
    with pytest.raises(pp.PalpateError, match="curve is .*: give a file, or 2 or 3 arrays"):
        pp.fit_friction(velocity, 0.08)


def test_a_study_is_run_and_goes_on(tmp_path):
    pytest.importorskip("distributed")
    (tmp_path / "double.py").write_text(
        "def run(values, folder):\n    return {'double': 2.0 * values['x']}\n", encoding="utf-8"
    )
    (tmp_path / "study.toml").write_text(
        'format = "palpate-sweep/1"\njob = "double.py"\ndesign = "grid"\n[vary]\nx = { choice = [1.0, 2.0, 3.0] }\n',
        encoding="utf-8",
    )
    with pytest.raises(pp.PalpateError, match="runs the Python of 'double.py'"):
        pp.run_study(tmp_path / "study.toml")
    assert not (tmp_path / "study").exists()
    seen = []
    found = pp.run_study(tmp_path / "study.toml", workers=1, scripts="allow", progress=lambda step: seen.append(step.done))
    assert (found.total, found.done, found.failed, found.folder) == (3, 3, 0, tmp_path / "study")
    assert seen[0] == 0 and seen[-1] == 3 and (found.folder / "report.html").is_file()
    assert pp.run_study(found.folder, scripts="allow").done == 3
