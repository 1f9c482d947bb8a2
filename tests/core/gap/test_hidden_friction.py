# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction that the base model lacks shows in net forces alone, and is not judged by readings that it cannot change."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.report import sentences
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.report.summary import summary
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import SensorParameters

PARAMETERS = SensorParameters(k=1e4, cn=0.0, sigma0=5e4, sigma1=1.0, mus=0.6, mud=0.5, x0=0.02, ct=0.0)


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
        said = Predictor(sensed, cases.grid_rig(1, 1, 0.01, PARAMETERS, [sensed])).predict(Model(PARAMETERS))
        force = said.force.copy()
        force[:, 0] = change(force[:, 0], np.gradient(slide, time))
        reading = said.reading + 0.05 * rng.normal(size=said.reading.shape) + sway * np.sin(3.0 * time)[:, None]
        trials.append(replace(sensed, force=force + 0.03 * rng.normal(size=force.shape), reading=reading))
    return cases.grid_rig(1, 1, 0.01, PARAMETERS, trials, given={"k", "mus", "mud", "x0", "ct"})


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
            lambda force, speed: force * (1.0 + 0.8 * np.exp(-np.sqrt(np.abs(speed) / 0.004))),
            marks=pytest.mark.long("a whole diagnosis with friction"),
        ),
    ],
)
def test_friction_is_judged_by_the_forces_where_the_readings_leave_noise(name, change):
    result = run_job(diagnose(sliding(change, sway=0.015)))
    assert [one.name for one in result.findings] == [name] and result.findings[0].confidence > 0.5
    errors = gap_errors(result)
    said, closed = sentences.headline(result, errors), summary(result, errors)["gap"]["closed"]
    assert name in said and "The base model has friction" not in said
    assert closed["fit"] > 0.8 and closed["check"] > 0.8
