# SPDX-License-Identifier: GPL-3.0-or-later
"""The generator of recordings with something hidden, and the scoring of what is said of them."""

import ast
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from palpate.benchmarks import _rows, gap
from palpate.benchmarks._hidden import cases, other, own, third, world
from palpate.core.effects.engine.registry import effect, library, names_where
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import Model, Predictor

HIDDEN = Path(cases.__file__).parent


@pytest.mark.parametrize("path", sorted(HIDDEN.glob("*.py")), ids=lambda path: path.stem)
def test_the_generator_shares_nothing_with_the_package(path):
    allowed = {"__future__", "collections", "dataclasses", "pathlib", "zlib", "numpy", "scipy"}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert {name.name.split(".")[0] for name in node.names} <= allowed
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 1 or (node.level == 0 and node.module.split(".")[0] in allowed)


def test_every_effect_is_hidden_in_some_case():
    """The three families of formulas hide the same effects: all that need nothing but readings and forces.

    What needs more, as a clock or a column, is hidden by test_warm_up.py and test_temperature.py. A new effect is hidden once
    somebody who did not write its file has written other formulas of it.
    """
    hidden = set(other.MAKERS)
    assert hidden == set(own.OWN) == set(third.THIRD) and len(hidden) >= 20
    assert hidden <= set(names_where(lambda kind: not kind.needs))
    assert not set(other.OUTSIDE) & set(library())


def test_own_forms_have_the_librarys_names_and_others_do_not():
    forms = {name: {form.name for form in kind.forms} for name, kind in library().items()}
    for seed in range(6):
        for name in own.OWN:
            assert own.OWN[name](np.random.default_rng(seed), 0.3).form in forms[name]
            foreign = [makers[name](np.random.default_rng(seed), 0.3).form for makers in (other.MAKERS, third.THIRD)]
            assert not set(foreign) & forms[name] and len(set(foreign)) == 2


@pytest.mark.long("draws cases of the benchmark")
def test_a_case_follows_from_kind_and_number(tmp_path):
    first, again, next_one = (cases.draw("other", number) for number in (24, 24, 44))
    files = [cases.write(case, tmp_path / name).parent for case, name in ((first, "a"), (again, "b"))]
    for path in sorted(files[0].iterdir()):
        assert path.read_bytes() == (files[1] / path.name).read_bytes()
    assert first.answer == next_one.answer and not np.array_equal(first.readings[0], next_one.readings[0])


def test_a_rig_is_read_and_does_not_tell_its_answer(tmp_path):
    case = cases.draw("own", 12)
    path = cases.write(case, tmp_path)
    rig = read_rig(path)
    assert [trial.use for trial in rig.trials] == ["fit"] * 4 + ["check"] * 2
    np.testing.assert_allclose(rig.trials[2].reading, case.readings[2], rtol=1e-6, atol=1e-6 * np.abs(case.readings[2]).max())
    assert not rig.warnings
    assert not any(word in path.read_text(encoding="utf-8") for word in (*case.answer, case.hidden[0].form))


@pytest.mark.long("draws cases of the benchmark")
@pytest.mark.parametrize("kind", ["own", "other", "third"])
@pytest.mark.parametrize("number", [3, 9, 12, 18])
def test_what_is_hidden_has_the_size_it_is_said_to_have(kind, number):
    case = cases.draw(kind, number)
    low, high = cases.SHARE
    assert all(0.9 * low < share < 1.6 * high for share in case.share)
    noise = np.std(np.concatenate([(r - c[0]).ravel() for r, c in zip(case.readings, case.clean, strict=True)]))
    np.testing.assert_allclose(noise, case.noise, rtol=0.02)


PRESSED = np.array([[0, 1, 3, 4, 6, 9], [0, 0, 1e-3, -2e-3, 4e-3, 4e-3], [1e-3, -1e-3, -3e-3, -1e-3, -3e-3, 1e-3]])
"""Time, y and height of a probe's lowest point: in, on, half out, on again with a slide, out."""


def pressed_pad(radius=0.012):
    """A pad, a contact along :data:`PRESSED` and a function that returns what is recorded with hidden effects."""
    pad = world.Pad(60.0, 0.6, 0.6, 0.5, 0.01, 30.0, 0.3, 0.02, 500.0, 40.0, "counts")
    probe = world.Probe(radius, None) if radius else world.Probe(None, (0.06, 0.4, 0.02))
    time = np.arange(0, 9, 0.02)
    y, z = (np.interp(time, PRESSED[0], PRESSED[i]) for i in (1, 2))
    path = np.stack([np.zeros_like(time), y, probe.lowest + z], axis=1)

    def record(*hidden):
        signals = world.respond(world.touch(probe, pad, time, path, hidden), pad, hidden)
        return signals, world.converted(signals.reading, pad, hidden), world.net_force(signals)

    return pad, record


@pytest.mark.parametrize("name", [name for name in third.THIRD if name != "dead-texels"])
def test_a_formula_of_the_third_family_changes_what_is_recorded_and_stays_finite(name):
    """Nothing at all as the strength goes to zero, more the stronger it is."""
    pad, record = pressed_pad()
    _, plain, plain_force = record()
    changes = []
    for strength in (0.02, 0.3, 3.0):
        made = [record(third.THIRD[name](np.random.default_rng(5), strength)) for _ in range(2)]
        assert all(np.isfinite(part).all() for part in made[0][1:])
        np.testing.assert_array_equal(made[0][1], made[1][1])  # the same seed, the same recording
        reading, force = made[0][1:]
        shown = (reading - plain) / np.ptp(plain) if name not in cases.IN_FORCE else (force - plain_force) / np.ptp(plain_force)
        changes.append(np.sqrt(np.mean(shown**2)))
    assert changes[0] < 0.1 * changes[2] and changes[0] < changes[1] < changes[2] and changes[2] > 0.02


def test_a_fractional_solid_relaxes_as_the_complementary_error_function():
    """E of order 1/2 is known: E(-√t) = exp(t) erfc(√t). The integral ends where r^(1/2) = 3e-7 of it is left."""
    from scipy.special import erfcx

    time = np.array([0.0, 0.01, 0.3, 2.0, 40.0])
    np.testing.assert_allclose(third._mittag_leffler(time, 0.5), erfcx(np.sqrt(time)), atol=1e-6)


@pytest.mark.long("draws a case with three hidden effects")
def test_three_effects_are_three_and_act_in_their_order():
    for number in range(3):
        hidden = cases._names("three", number, np.random.default_rng(number), True)
        assert len(set(hidden)) == 3 and hidden == sorted(hidden, key=cases.ORDER.index)
    case = cases.draw("three", 1)
    assert len(case.answer) == 3 and all(form.form not in third.THIRD for form in case.hidden) and len(case.share) == 3


def test_friction_is_coulombs_once_it_slides():
    """A flat probe at constant speed and depth: after some bristle lengths the force is LuGre's steady state, Eq. 10–12."""
    pad = world.Pad(60.0, 0.0, 0.6, 0.5, 0.01, 30.0, 0.3, 0.02, 1.0, 0.0, "N")
    time = np.arange(0, 4, 0.02)
    speed, depth = 0.02, 1e-3
    path = np.stack([np.zeros_like(time), speed * time - 0.04, np.full_like(time, 0.01 - depth)], axis=1)
    probe = world.Probe(None, (0.06, 0.4, 0.02))
    shear = world.respond(world.touch(probe, pad, time, path), pad).shear[-1]
    steady = pad.k * depth * (0.5 + 0.1 * np.exp(-4.0)) + pad.ct * speed
    np.testing.assert_allclose(shear[:, 1], steady, rtol=1e-6)
    np.testing.assert_allclose(shear[:, [0, 2]], 0.0, atol=1e-12)


def test_low_pass_and_relaxation_against_closed_forms():
    """``τ q' = x − q`` under a ramp, and the reading of a sensor with it hidden in it."""
    t = np.arange(0, 5, 0.02)
    got = own._low_pass(t[:, None] * 2.0, 0.02, 0.7, np.zeros(1))[:, 0]
    np.testing.assert_allclose(got, 2.0 * (t - 0.7 * -np.expm1(-t / 0.7)), atol=1e-12)


@pytest.mark.long("draws cases of the benchmark")
@pytest.mark.parametrize("number", range(len(cases.POOR)))
def test_poor_recordings_are_poor(number):
    way = list(cases.POOR)[number]
    case = cases.draw("poor", number)
    assert case.answer[0] in cases.POOR[way] and cases.draw("poor", number + len(cases.POOR)).answer != case.answer
    touched = np.any([(path[:, 2] < case.probe.lowest).any() for path in case.paths])
    assert touched
    if way == "one level":
        assert all(np.ptp(path[:, 2]) == 0 for path in case.paths)
    if way == "never unloaded":
        assert all((np.diff(path[:, 2]) <= 0).all() for path in case.paths)
    if way in cases.PROGRAMMES:
        assert all(np.array_equal(path[:, :2], case.paths[0][:, :2]) for path in case.paths)
    full = max(np.abs(reading - case.pad.zero).max() for reading, _ in case.clean)
    assert (case.noise > 0.08 * full) == (way == "too noisy")


def test_outcomes():
    say = gap.outcome
    assert say(["creep"], ["creep"], "explained", False) == "right"
    assert say(["creep"], ["lag"], "explained", False) == "wrong"
    assert say(["creep"], ["creep", "lag"], "explained", False) == "wrong"
    assert say(["creep"], [], "explained", True) == "ambiguous"
    assert say(["creep"], [], "unexplained", False) == "unexplained"
    assert say([], [], "no gap", False) == "no gap"
    assert say([], ["drift"], "explained", False) == "wrong"
    assert say(["creep", "lag"], ["lag"], "explained", False) == "part"
    assert say(["creep", "lag", "drift"], ["lag"], "explained", False) == "part"
    assert say(["creep", "lag", "drift"], ["lag", "drift"], "explained", True) == "right"
    assert say(["creep", "lag", "drift"], ["lag", "drift", "wear"], "explained", False) == "wrong"


def test_a_whole_run_has_every_kind_and_grows_without_changing():
    small, whole = gap.plan_of(20, 1000), gap.plan_of(sum(_rows.MIX.values()), 1000)
    assert len(whole) == 390 and {kind for kind, _ in small} == set(_rows.MIX)
    assert set(small) <= set(whole)


def test_net_force_under_a_sliding_ball_is_that_of_the_other_code(tmp_path):
    """Two integrations of the same friction, second order both; where they differ is less than the force's noise."""

    case = cases.draw("none", 2)
    rig = read_rig(cases.write(case, tmp_path))
    names = ("k", "cn", "mus", "mud", "x0", "sigma0", "sigma1", "ct", "gain", "zero")
    true = Model(replace(rig.parameters, **{name: getattr(case.pad, name) for name in names}))
    for trial, (reading, force), measured in zip(rig.trials, case.clean, case.forces, strict=True):
        found = Predictor(trial, rig).predict(true)
        assert np.sqrt(np.mean((found.force - force) ** 2)) < 0.6 * np.std(measured - force)
        assert np.abs(found.reading - reading).max() < 0.01 * np.ptp(reading)


def test_a_wrongly_mounted_sensor_is_that_of_the_other_code(tmp_path):
    """The generator moves the ball into the sensor's frame, the library moves the texels: the six numbers mean the same."""
    values = {"x": 2e-3, "y": -1.5e-3, "z": 0.6e-3, "about_x": 0.04, "about_y": -0.03, "about_z": 0.1}
    frame = Rotation.from_euler("xyz", [values["about_x"], values["about_y"], values["about_z"]])
    case = next(case for case in map(partial(cases.draw, "none"), range(9)) if case.probe.radius is not None)
    readings = []
    for time, path in zip(case.times, case.paths, strict=True):
        middle = frame.inv().apply(path - [values["x"], values["y"], values["z"]])
        readings.append(world.respond(world.touch(case.probe, case.pad, time, middle), case.pad, slides=False).reading)
    rig = read_rig(cases.write(replace(case, readings=readings), tmp_path))
    plain = Model(rig.parameters)
    model = plain.with_effect(effect("misalignment", "rigid", **values))
    for trial, reading in zip(rig.trials, readings, strict=True):
        predictor = Predictor(trial, rig)
        agree, moved = (np.corrcoef(predictor.predict(one).reading.ravel(), reading.ravel())[0, 1] for one in (model, plain))
        assert agree > 0.995 > moved
