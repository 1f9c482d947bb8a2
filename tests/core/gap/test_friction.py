# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction of the base model, friction that it lacks, and backlash, which is in no library."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.base.base_model import base_fit
from palpate.core.gap.fitting.least_squares import TrialView
from palpate.core.gap.forward.contact_phases import TRAVEL_BANDS, features
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.report import sentences, summary
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection.rule_numbers import SURE
from palpate.core.model.sensor_parameters import SensorParameters

# --- friction that the base model lacks shows in net forces alone


STIFF = SensorParameters(k=1e4, cn=0.0, sigma0=5e4, sigma1=1.0, mus=0.6, mud=0.5, x0=0.02, ct=0.0)


def sliding(change, sway):
    """Slides at many constant speeds under a load that changes; `change(force, speed)` is done to the tangential force.

    Readings have noise, and a slow swing of `sway` that is smaller than their noise.
    """
    rng, time, trials = np.random.default_rng(0), 0.01 * np.arange(1601), []
    for i in range(4):
        speeds = rng.choice([-1.0, 1.0], 16) * 10 ** rng.uniform(-3.3, -1.2, 16)
        slide = 0.01 * np.cumsum(np.append(np.repeat(speeds, 100), 0.0))
        level = 1e-3 * (1.0 + 0.3 * np.sin(0.2 * np.pi * (i + 1) * time))
        nothing, use = np.zeros((len(time), 3)), "check" if i == 3 else "fit"
        sensed = cases.depth_trial(time, level, slide=slide, force=nothing, reading=nothing[:, :1], name=f"t{i}", use=use)
        said = Predictor(sensed, cases.grid_rig(1, 1, 0.01, STIFF, [sensed])).predict(Model(STIFF))
        force = said.force.copy()
        force[:, 0] = change(force[:, 0], np.gradient(slide, time))
        reading = said.reading + 0.05 * rng.normal(size=said.reading.shape) + sway * np.sin(3.0 * time)[:, None]
        trials.append(replace(sensed, force=force + 0.03 * rng.normal(size=force.shape), reading=reading))
    return cases.grid_rig(1, 1, 0.01, STIFF, trials, given={"k", "mus", "mud", "x0", "ct"})


@pytest.mark.parametrize(
    ("name", "change"),
    [
        pytest.param(
            "viscous-friction",
            lambda force, speed: force * (1.0 + 10.0 * np.abs(speed)),
            marks=pytest.mark.slow("a whole diagnosis, the one with friction in this tier"),
        ),
        pytest.param(
            "stribeck",
            lambda force, speed: force * (1.0 + 0.8 / (1.0 + np.sqrt(np.abs(speed) / 0.004))),
            marks=pytest.mark.long("a whole diagnosis with friction"),
        ),
    ],
)
def test_friction_is_judged_by_the_forces_where_the_readings_leave_noise(name, change):
    result = cases.diagnosed(sliding(change, sway=0.015))
    assert [one.name for one in result.findings] == [name] and result.findings[0].confidence > 0.5
    errors = gap_errors(result)
    said, closed = sentences.headline(result, errors), summary.summary(result, errors)["gap"]["closed"]
    assert name in said and "The base model has friction" not in said
    assert closed["fit"] > 0.8 and closed["check"] > 0.8


# --- a surface that slides to and fro under a constant load


PARAMETERS = SensorParameters(k=1e4, cn=0.0, sigma0=5e3, sigma1=1.0, mus=0.6, mud=0.5, x0=0.02, ct=0.0)


def brake(backlash):
    """Two recordings of 8 s; what hides in them pulls against the slide for the first tenth of the way after each turn."""
    time = np.linspace(0.0, 8.0, 801)
    trials = []
    rng = np.random.default_rng(0)
    for i, beat in enumerate((0.5, 0.8)):
        slide, level = 0.02 * np.sin(2 * np.pi * beat * time), np.full(len(time), 1e-3)
        use, nothing = "check" if i else "fit", np.zeros((len(time), 3))
        sensed = cases.depth_trial(time, level, slide=slide, force=nothing, name=f"t{i}", use=use)
        force = Predictor(sensed, cases.grid_rig(1, 1, 0.01, PARAMETERS, [sensed])).predict(Model(PARAMETERS)).force.copy()
        phase = (beat * time + 0.25) % 0.5
        force[:, 0] -= backlash * np.sign(force[:, 0]) * (phase < 0.1)
        trials.append(replace(sensed, force=force + 0.01 * rng.normal(size=force.shape)))
    return cases.grid_rig(1, 1, 0.01, PARAMETERS, trials)


@pytest.mark.slow("a whole diagnosis with friction")
def test_the_report_says_what_friction_does_and_what_is_left(tmp_path):
    result = cases.diagnosed(brake(backlash=2.0))
    errors = gap_errors(result)
    assert all(errors.frictionless[use] > 3.0 * errors.base[use] for use in ("fit", "check"))
    assert not any(named.confidence >= SURE for named in result.findings)
    assert result.structure.strongest == "turning"
    said = sentences.headline(result, errors)
    assert (
        "distance slid since the last reversal" in said
        and "The base model has friction; without it" in said
        and "not missing" not in said
    )
    assert summary.summary(result, errors)["base"]["gap_without_friction"] == errors.frictionless
    *_, _ = summary.write_report(result, tmp_path, errors)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "1 texel, 1 trial fitted" in page and "base without its friction" in page and "base model, refitted" in page
    assert "not identifiable from these recordings" in page  # friction and stiffness are known as a product alone


def test_the_way_since_the_last_turn():
    predictor = Predictor(brake(0.0).trials[0], brake(0.0))
    found = features(predictor, np.zeros((801, 1)))
    assert "depth" not in found  # it is the same all the time
    bands = found["turning"][:, :, 0]
    assert ((bands != 0).sum(axis=0) <= 1).all() and len(bands) == len(TRAVEL_BANDS) - 1
    peak = np.flatnonzero(np.isclose(predictor.trial.travel[:, 0], 0.02, atol=1e-9))[0]
    assert bands[0, peak + 2] == -1.0 and bands[-1, peak - 2] == 1.0  # just turned back; at the end of the way there


def test_friction_is_found_from_a_default_stiffness_of_the_bristles():
    """A rig that does not state `sigma0` begins at 1 N/m, five thousand times too soft."""
    rig = brake(0.0)
    rig = replace(rig, parameters=replace(PARAMETERS, sigma0=1.0, sigma1=1e-4))
    views = [TrialView(Predictor(trial, rig), noise=(1.0, 0.01)) for trial in rig.of("fit")]
    found = base_fit(rig, views, 1.0)
    assert found.mean < 1.2
    assert 2e3 < found.model.parameters.sigma0 < 2e4
