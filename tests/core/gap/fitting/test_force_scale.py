# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of forces, which readings at known depths do not determine and net forces do."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import library
from palpate.core.gap.base.base_model import base_fit, identified_base_parameters
from palpate.core.gap.candidates.candidates import Candidate, scales_of
from palpate.core.gap.candidates.rao_score import ScoreTest, visible_parameters
from palpate.core.gap.candidates.view_set import view_set_of
from palpate.core.gap.fitting.force_scale import at_measured_forces, with_scaled_forces
from palpate.core.gap.fitting.least_squares import fit, free_base_parameters
from palpate.core.gap.forward.predictor import Model, Predictor

FORMS = [(kind, form) for kind in library().values() for form in kind.forms if not form.random]

HAVE_FORCE = ["k", "cn", "gain", "ct", "sigma0", "sigma1"]
"""Parameters of the base model whose dimension has force in it."""


def recorded():
    """A rig in an own unit with net forces."""
    rig = cases.rig(trials=2, seconds=4.0)
    rig = replace(rig, parameters=replace(rig.parameters, gain=3.0, unit="V"))
    return rig, [replace(trial, force=np.zeros((len(trial.time), 3))) for trial in rig.trials]


@pytest.fixture(scope="module")
def predictor():
    rig, trials = recorded()
    return Predictor(trials[0], rig)


@pytest.mark.parametrize(("kind", "form"), FORMS, ids=[f"{kind.name}/{form.name}" for kind, form in FORMS])
def test_readings_do_not_tell_the_scale_of_forces(predictor, kind, form):
    rig = predictor.rig
    scales = scales_of([predictor], Model(rig.parameters))
    one = Candidate(kind, form)
    values = list(one.starting_values(scales, 3.0, 2))[1]
    model = Model(rig.parameters, (one.effect(values, scales.texels, 3.0),))
    free = free_base_parameters(rig.parameters, HAVE_FORCE, 1.0)
    before, after = predictor.predict(model), predictor.predict(with_scaled_forces(model, free, 1.7))
    size = np.abs(before.reading).max()
    np.testing.assert_allclose(after.reading, before.reading, rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(after.force, 1.7 * before.force, rtol=0, atol=1e-9 * np.abs(before.force).max())


def test_net_forces_tell_the_scale():
    """A model with forces of 0.6 times the measured ones, and the right readings, gets the measured ones; NaN are left out."""
    rig, trials = recorded()
    right, free = Model(rig.parameters), free_base_parameters(rig.parameters, HAVE_FORCE, 1.0)
    made = [Predictor(trial, rig).predict(right) for trial in trials]
    forces = [np.where(np.arange(len(one.force))[:, None] % 5 == 0, np.nan, one.force) for one in made]
    measured = [
        replace(trial, reading=one.reading, force=force) for trial, one, force in zip(trials, made, forces, strict=True)
    ]
    views = view_set_of([Predictor(trial, rig) for trial in measured], (1.0, 1.0)).whole
    found = at_measured_forces(with_scaled_forces(right, free, 0.6), free, views)
    assert [found.parameters.k, found.parameters.gain] == pytest.approx([rig.parameters.k, 3.0], rel=1e-9)
    no_forces = view_set_of([Predictor(replace(trial, force=None), rig) for trial in measured], (1.0, 1.0)).whole
    assert at_measured_forces(right, free, no_forces) == right


@pytest.mark.parametrize(
    ("given", "stimuli", "seen"),
    [
        ({"k"}, "pose", ["cn", "gain", "zero"]),
        ({"k", "gain"}, "pose", ["k", "cn", "zero"]),
        ({"k"}, "mixed", ["k", "cn", "gain", "zero"]),
    ],
    ids=["open gain", "given gain", "known loads beside depths"],
)
def test_without_net_forces_stiffness_or_gain_is_held(given, stimuli, seen):
    """A fit with both took the stiffness 3 % off what net forces say, 11 deviations of their noise."""
    rig, trials = recorded()
    if stimuli == "mixed":
        trials[0] = replace(trials[0], stimulus="force", level=np.ones(len(trials[0].time)))
    rig = replace(rig, given=frozenset(given))
    views = view_set_of([Predictor(trial, rig) for trial in trials], (1.0, 1.0))
    free = free_base_parameters(rig.parameters, ["k", "cn", "gain", "zero", "mus"], 1.0)
    found = fit(views.whole, Model(rig.parameters), free, max_steps=0)
    assert [item.name for item in visible_parameters(views.whole, found)] == ["k", "cn", "gain", "zero", "mus"]
    assert [item.name for item in visible_parameters(views.few_samples, found)] == seen
    assert [item.name for item in ScoreTest(views.few_texels, found).free] == seen


@pytest.mark.parametrize("k", [6.0, 600.0, 6e5])
def test_a_base_fit_finds_a_stiffness_far_from_the_stated_one(k):
    """The rig states 60 N/m and no gain; noise of 0.3 % of the range. From there a fit ended at 190 N/m for one of 600."""
    rng, (rig, trials) = np.random.default_rng(0), recorded()
    true = replace(rig.parameters, k=k, cn=0.01 * k)
    made = [Predictor(trial, replace(rig, parameters=true)).predict(Model(true)) for trial in trials]
    full, largest = (max(float(np.ptp(values)) for values in part) for part in zip(*((m.reading, m.force) for m in made)))
    measured = [
        replace(
            trial,
            reading=one.reading + 0.003 * full * rng.normal(size=one.reading.shape),
            force=one.force + 0.003 * largest * rng.normal(size=one.force.shape),
        )
        for trial, one in zip(trials, made, strict=True)
    ]
    rig = replace(rig, given=frozenset({"k"}), trials=tuple(measured))
    views = view_set_of([Predictor(trial, rig) for trial in measured], (0.003 * full, 0.003 * largest)).whole
    found = base_fit(rig, views, full)
    assert found.mean == pytest.approx(1.0, abs=0.05)
    assert [found.model.parameters.k, found.model.parameters.gain] == pytest.approx([k, 3.0], rel=0.005)
    assert found.model.parameters.cn == pytest.approx(true.cn, rel=0.05)


@pytest.mark.parametrize(
    ("factors", "level", "names"),
    [
        ((1.0, 1.0), 1.0, ["k", "cn", "gain"]),
        (("a", "a"), 1.0, ["k", "cn", "gain"]),
        (("a", 1.0), 1.0, ["cn", "gain"]),
        (("a", "b"), 1.0, ["cn", "gain"]),
        ((1.0, 1.0), 0.0, ["cn", "gain"]),
    ],
)
def test_known_loads_identify_the_stiffness_where_they_share_a_factor_with_depths(factors, level, names):
    """Elsewhere stiffness, gain and the factors are known only as products; a load of zero says nothing."""
    rig, trials = recorded()
    depth, load = (replace(trial, force=None, tared=True, factor=own) for trial, own in zip(trials, factors, strict=True))
    load = replace(load, stimulus="force", level=np.full(len(load.time), level))
    assert identified_base_parameters(rig, [Predictor(depth, rig), Predictor(load, rig)]) == names
