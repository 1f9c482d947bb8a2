# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of kinds against differences of models, and what they leave of a signal against scipy on the samples themselves."""

from __future__ import annotations

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from palpate.core.gap.fitting.noise_floor import ChannelNoise
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.kinds.columns import POSE_SCALE, TEXEL, columns, texel_columns
from palpate.core.gap.kinds.decision_numbers import PRIORS, TYPICAL_SIZE
from palpate.core.gap.kinds.dictionaries import MISALIGNMENT, VARIANTS
from palpate.core.gap.kinds.distinguishability import KindSignal, left_by, signals_of
from palpate.core.gap.kinds.normal_equations import normal_equations
from palpate.core.gap.kinds.recorded import POSE, recorded
from palpate.core.model.effect import Effect

BY_LABEL = {variant.label: variant for variant in VARIANTS}
NOISE = ChannelNoise(0.002, 1.0, "given"), ChannelNoise(0.01, 1.0, "given")


@pytest.fixture(scope="module")
def fitted():
    rig = cases.rig(trials=3, seconds=6.0)
    return predictors_of(rig.trials[:2], rig)


@pytest.fixture(scope="module")
def plain(fitted):
    return recorded(fitted, Model(fitted[0].rig.parameters), {"cn", "gain", "zero"}, NOISE)


def _loads(fitted, seen, model):
    """Loads of the first run in the units of recordings."""
    return fitted[0].normal_force(model) / seen.source.scale


def _almost_everywhere(derivative, difference, share=0.98):
    """Kinks lie between, so a few samples may differ."""
    close = np.abs(derivative - difference) < 0.02 * (np.abs(derivative).max() + 1e-3)
    return close.mean() > share


def test_loads_are_the_base_models_and_nothing_without_contact(fitted, plain):
    for predictor, run in zip(fitted, plain.runs, strict=True):
        np.testing.assert_allclose(run.load * plain.source.scale, predictor.normal_force(plain.source.model), atol=1e-12)
        assert run.load.min() == 0.0 and not run.load[run.elastic <= 0.0].any()
        assert run.read.all() and not np.isfinite(run.force).any()
    assert max(float(run.load.max()) for run in plain.runs) == pytest.approx(1.0)


def test_corrections_of_the_base_model_are_changes_of_its_parameters(fitted, plain):
    made, run, model = columns(plain, 0, ()), plain.runs[0], plain.source.model
    p = model.parameters
    for name, changed in (("k", replace(p, k=1.001 * p.k, cn=1.001 * p.cn)), ("damping", replace(p, cn=1.001 * p.cn))):
        ((reading, force),) = made[name]
        difference = (_loads(fitted, plain, replace(model, parameters=changed)) - run.load) / 0.001
        assert np.abs(reading).max() > 0.01 and _almost_everywhere(reading, difference)
        assert _almost_everywhere(force, (difference * run.towards_normal).sum(axis=1))
    assert np.array_equal(made["gain"][0][0], run.load) and (made["zero"][0][0] == 1.0).all()
    assert not made["gain"][0][1].any() and not made["zero"][0][1].any()  # the reading's alone


@pytest.mark.parametrize("axis", range(6))
def test_misalignment_is_a_displacement_of_the_texels(fitted, plain, axis):
    reading, force = columns(plain, 0, (MISALIGNMENT,))[MISALIGNMENT.label][axis]
    run, size = plain.runs[0], 0.01  # in units of POSE_SCALE: several times the columns' own step
    moved = []
    for sign in (1.0, -1.0):
        values = {name: sign * size * POSE_SCALE[axis] * (name == POSE[axis]) for name in POSE}
        model = plain.source.model.with_effect(Effect(MISALIGNMENT.kind, "rigid", values))
        moved.append(_loads(fitted, plain, model))
    difference = (moved[0] - moved[1]) / (2.0 * size)
    assert np.abs(reading).max() > 0.01 and _almost_everywhere(reading, difference)
    assert _almost_everywhere(force, (difference * run.towards_normal).sum(axis=1), 0.95)  # some texel begins to touch


def _with(seen, variant, index, size):
    """Readings and net force of the first run with a coefficient of a variant, all others being zero."""
    run = seen.runs[0]

    def added(x, acts):
        return size * variant.columns(x, run, seen)[index] if acts else np.zeros_like(x)

    touching = run.elastic > 0.0
    before = run.elastic + added(run.elastic, variant.in_contact and not variant.after_clip)
    clipped = np.where(touching, np.maximum(before + run.load - run.elastic, 0.0), 0.0)
    force = clipped + np.where(touching, added(clipped, variant.after_clip), 0.0)
    return force + added(force, not variant.in_contact), (force * run.towards_normal).sum(axis=1)


@pytest.mark.parametrize("label", [v.label for v in VARIANTS if not v.texel_columns or v.kind == "drift"])
def test_derivatives_are_differences_of_the_model(plain, label):
    variant = BY_LABEL[label]
    made = columns(plain, 0, (variant,))[label]
    here = _with(plain, variant, 0, 0.0)
    for index, (reading, force) in enumerate(made):
        there = _with(plain, variant, index, 1e-3)
        assert _almost_everywhere(reading, (there[0] - here[0]) / 1e-3)
        assert _almost_everywhere(force, (there[1] - here[1]) / 1e-3)


def test_a_texel_that_does_not_press_cannot_press_less(fitted):
    """Fast releases, where strong damping takes all of the force: what lowers it changes nothing."""
    parameters = replace(fitted[0].rig.parameters, cn=0.1 * fitted[0].rig.parameters.k)
    seen, label = recorded(fitted, Model(parameters), {"cn"}, NOISE), "creep"
    run = seen.runs[0]
    released = (run.load == 0.0) & (run.elastic > 0.0)
    added = BY_LABEL[label].columns(run.elastic, run, seen)[0]
    reading = columns(seen, 0, (BY_LABEL[label],))[label][0][0]
    assert (added[released] < -0.01).any() and not reading[released].any()
    pressed = run.load > 0.001
    assert np.array_equal(reading[pressed], added[pressed])


def test_parameters_of_single_texels_are_what_they_say(plain):
    gain, offset, rate, fading = texel_columns(plain, plain.runs[0])
    run = plain.runs[0]
    assert np.array_equal(gain, run.load) and (offset == 1.0).all()
    assert not rate[0].any() and rate[-1] == pytest.approx(np.ptp(run.time) / plain.duration)
    assert (fading[run.load == 0.0] == 1.0).all() and fading.min() == pytest.approx(1.0 / (1.0 + run.load.max()))


def _with_holes(seen):
    """The same with net forces, and without some of the readings and forces."""
    rng, runs = np.random.default_rng(4), []
    for run in seen.runs:
        force = np.where(rng.uniform(size=len(run.time)) < 0.2, np.nan, 0.0)
        runs.append(replace(run, read=rng.uniform(size=run.read.shape) < 0.7, force=force))
    return replace(seen, runs=tuple(runs))


def _samples(seen, variants):
    """All columns over the samples, (s, p), and those of parameters of single texels, (q, s, n), in units of the noise."""
    rows, texel_rows, n = [], [], seen.texel_count
    for number, run in enumerate(seen.runs):
        weight = np.concatenate([run.read.ravel() / seen.noise[0], np.isfinite(run.force) / seen.noise[1]])
        made = [pair for pairs in columns(seen, number, variants).values() for pair in pairs]
        rows.append(np.array([np.concatenate([reading.ravel(), force]) * weight for reading, force in made]).T)
        own = np.einsum("qtn,nm->qtnm", texel_columns(seen, run), np.eye(n)).reshape(len(TEXEL), -1, n)
        still = np.zeros((len(TEXEL), len(run.time), n))
        texel_rows.append(np.concatenate([own, still], axis=1) * weight[None, :, None])
    return np.concatenate(rows), np.concatenate(texel_rows, axis=1)


@pytest.mark.parametrize("label", ["creep", "adhesion/steady", "load-spreading", "gain-mismatch", "drift", "offset/fading"])
def test_what_a_kind_leaves_is_that_of_least_squares_over_all_samples(plain, label):
    """Base model, one variant and its parameters of single texels with their priors, as one bounded problem."""
    seen, other = _with_holes(plain), BY_LABEL[label]
    variants = (BY_LABEL["saturation"], other)
    equations = normal_equations(seen, variants)
    matrix, texel = _samples(seen, variants)
    assert equations.count == sum(run.read.sum() + np.isfinite(run.force).sum() for run in seen.runs)
    rng = np.random.default_rng(2)
    target = matrix[:, equations.at["saturation"]] @ rng.uniform(0.0, 0.2, len(equations.at["saturation"]))
    target += matrix[:, equations.at[label]] @ rng.uniform(-0.1, 0.4, len(equations.at[label]))
    target += 0.1 * texel[0] @ rng.normal(size=seen.texel_count)
    signal = KindSignal("any", "any", matrix.T @ target, target @ target, np.einsum("qsn,s->qn", texel, target))
    base = [column for name in ("k", "damping", "gain", "zero") for column in equations.at[name]]
    own = [TEXEL.index(name) for name in other.texel_columns]
    blocks = [matrix[:, base], matrix[:, equations.at[label]], *texel[own]]
    prior = np.diag(np.repeat([1.0 / PRIORS[TEXEL[index]] for index in own], seen.texel_count))
    free = sum(block.shape[1] for block in blocks) - len(prior)
    whole = np.vstack([np.hstack(blocks), np.hstack([np.zeros((len(prior), free)), prior])])
    low = np.full(whole.shape[1], -np.inf)
    low[len(base) : free] = -np.inf if other.is_signed else 0.0
    scale = np.linalg.norm(whole, axis=0)
    exact = lsq_linear(whole / scale, np.concatenate([target, np.zeros(len(prior))]), (low, np.inf), method="bvls", tol=1e-14)
    left = left_by(equations, signal, (other,))
    assert left == pytest.approx(2.0 * exact.cost, rel=1e-5)
    assert left < 0.99 * left_by(equations, signal, ())


def test_signals_are_as_large_as_a_usual_effect(plain):
    variants = [BY_LABEL[label] for label in ("creep", "gain-mismatch", "drift")] + [MISALIGNMENT]
    equations = normal_equations(plain, variants)
    signals = [one for variant in variants for one in signals_of(equations, variant)]
    sideways, height, turned = (f"{MISALIGNMENT.label}/{name}" for name in ("sideways", "height", "turned"))
    assert [one.label for one in signals] == ["creep", "gain-mismatch", "drift", sideways, height, turned]
    assert all(one.square == pytest.approx(TYPICAL_SIZE**2 * equations.count) for one in signals)
