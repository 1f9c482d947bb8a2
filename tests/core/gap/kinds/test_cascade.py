# SPDX-License-Identifier: GPL-3.0-or-later
"""The cascade of kinds and its least squares, against finite differences and scipy on the samples themselves."""

from __future__ import annotations

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from palpate.core.gap.fitting.noise_floor import force_noise, reading_noise
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.kinds.cascade import TEXEL, Cascade, Point
from palpate.core.gap.kinds.decision_numbers import PRIORS
from palpate.core.gap.kinds.dictionaries import VARIANTS
from palpate.core.gap.kinds.normal_equations import BOUNDS, normal_equations
from palpate.core.gap.kinds.recorded import recorded

BY_LABEL = {variant.label: variant for variant in VARIANTS}


def _recorded(**changes):
    rig = cases.rig(trials=3, seconds=6.0, **changes)
    predictors = predictors_of(rig.trials[:2], rig)
    return recorded(predictors, Model(rig.parameters), {"cn", "damping", "zero"}, _noise(predictors))


def _noise(predictors):
    full = max(float(np.ptp(predictor.trial.reading)) for predictor in predictors)
    return reading_noise(predictors, full), force_noise(predictors, 1.0)


@pytest.fixture(scope="module")
def plain():
    return _recorded()


def _point(recorded_trials) -> Point:
    """Something of many kinds."""
    rng = np.random.default_rng(1)
    labels = ("stiffening", "creep", "hysteresis/leading", "adhesion/unloading", "load-spreading", "dead-zone", "lag", "drift")
    members = tuple(BY_LABEL[label] for label in labels)
    run = recorded_trials.runs[0]
    widths = {m.label: len(m.columns(run.elastic, run, recorded_trials)) for m in members}
    coefficients = {label: rng.uniform(0.01, 0.05, width) for label, width in widths.items()}
    texel = {name: 0.05 * rng.normal(size=recorded_trials.texel_count) for name in TEXEL}
    return Point(members, coefficients, {"k": 0.1, "damping": -0.2, "zero": 0.01}, texel)


def test_without_kinds_the_cascade_is_the_base_model(plain):
    cascade = Cascade(plain)
    for number, run in enumerate(plain.runs):
        course = cascade.course(Point(tuple(VARIANTS)), number)
        np.testing.assert_allclose(course.reading, run.load, atol=1e-12)
        np.testing.assert_allclose(course.force, (run.load * run.towards_normal).sum(axis=1), atol=1e-12)
    assert max(float(run.load.max()) for run in plain.runs) == pytest.approx(1.0)


@pytest.mark.parametrize("label", [v.label for v in VARIANTS if not v.texel_columns or v.kind == "drift"])
def test_derivatives_are_differences_of_the_cascade(plain, label):
    """Ten times the step of the derivatives: kinks lie between, so a few samples may differ."""
    cascade, point, variant = Cascade(plain), _point(plain), BY_LABEL[label]
    made = cascade.columns(point, 0, (variant,))[label]
    here = cascade.course(point, 0)
    for index, (reading, force) in enumerate(made):
        own = point.coefficients.get(label, np.zeros(len(made))).copy()
        own[index] += 1e-3
        there = cascade.course(replace(point, coefficients={**point.coefficients, label: own}), 0)
        for derivative, difference in ((reading, there.reading - here.reading), (force, there.force - here.force)):
            close = np.abs(derivative - difference / 1e-3) < 0.02 * (np.abs(derivative).max() + 1e-3)
            assert close.mean() > 0.98


def test_parameters_of_single_texels_change_their_own_texel(plain):
    cascade, point = Cascade(plain), _point(plain)
    made, here = cascade.texel_columns(point, 0), cascade.course(point, 0).reading
    for name in TEXEL:
        moved = point.texel[name].copy()
        moved[5] += 1e-3
        change = (cascade.course(replace(point, texel={**point.texel, name: moved}), 0).reading - here) / 1e-3
        assert not change[:, np.arange(plain.texel_count) != 5].any()
        assert (np.abs(change[:, 5] - made[name][:, 5]) < 0.02).mean() > 0.98


def test_eliminated_texels_give_the_solution_of_all_unknowns_at_once(plain):
    """All columns and all texels' gains as one bounded problem of the samples, solved by scipy."""
    cascade, members = Cascade(plain), (BY_LABEL["creep"], BY_LABEL["gain-mismatch"])
    equations = normal_equations(cascade, Point(), members)
    solution = equations.solve(members)
    rows, targets, low, high = [], [], [], []
    for number, run in enumerate(plain.runs):
        made = cascade.columns(Point(), number, members)
        pairs = [(name, pair) for name, columns in made.items() for pair in columns]
        reading = np.stack([pair[0].ravel() for _, pair in pairs], axis=1) / plain.noise[0]
        gains = np.zeros((run.load.size, plain.texel_count))
        texel = np.tile(np.arange(plain.texel_count), len(run.time))
        gains[np.arange(run.load.size), texel] = run.load.ravel() / plain.noise[0]
        rows.append(np.hstack([reading, gains]))
        targets.append((run.reading - run.load).ravel() / plain.noise[0])
        bounds = [BOUNDS.get(name, (0.0, 1.0)) for name, _ in pairs]
        low, high = [b[0] for b in bounds] + [-9.0] * plain.texel_count, [b[1] for b in bounds] + [9.0] * plain.texel_count
    prior = np.hstack([np.zeros((plain.texel_count, len(pairs))), np.eye(plain.texel_count) / PRIORS["gain"]])
    matrix, target = np.vstack([*rows, prior]), np.concatenate([*targets, np.zeros(plain.texel_count)])
    exact = lsq_linear(matrix, target, (low, high), method="bvls", tol=1e-12)
    count = sum(run.load.size for run in plain.runs)
    assert solution.fitted == pytest.approx(2.0 * exact.cost / count, rel=1e-4)
    np.testing.assert_allclose(solution.point.texel["gain"], exact.x[len(pairs) :], atol=2e-3)


def test_missing_readings_do_not_count(plain):
    rng, holes = np.random.default_rng(4), []
    for run in plain.runs:
        reading = run.reading.copy()
        reading[rng.uniform(size=reading.shape) < 0.3] = np.nan
        holes.append(replace(run, reading=reading))
    some = replace(plain, runs=tuple(holes))
    members = (BY_LABEL["dead-zone"],)
    solution = normal_equations(Cascade(some), Point(), members).solve(members)
    assert np.isfinite(solution.fitted) and some.count < 0.75 * plain.count
    assert normal_equations(Cascade(some), Point(), ()).count.sum() == some.count
