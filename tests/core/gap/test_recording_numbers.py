# SPDX-License-Identifier: GPL-3.0-or-later
"""Specimens that differ by a factor and recordings with a zero of their own are said in the rig and fitted."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from rig_files import RIG, write

from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.fitting.least_squares import TrialView, cross_fitted, fit, free_base_parameters
from palpate.core.gap.forward.predictor import predictors_of
from palpate.core.gap.selection.base_model import (
    base_parameters_to_search,
    recording_numbers,
    start_model,
    with_recording_numbers,
)
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
    model = with_recording_numbers(start_model(rig, own), own)
    free = free_base_parameters(model.parameters, base_parameters_to_search(rig, own), 0.2)
    free += recording_numbers(rig, own, 0.2)
    return predictors, views, fit(views, model, free, max_steps=40, tolerance=1e-9)


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
    for words in (
        "force_zero = 1",
        'force_zero = [0, 0, "a"]',
        'factor = "some"',
        "factor = -1",
        "factor = 0",
        "zero = true",
        'specimen = "A"',
        "specimen = 3",
        "zero = [1]",
    ):
        with pytest.raises(PalpateError, match="Trial 1"):
            read(words)
