# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of a converter are read off with its parameters, and none are seen where there is no converter."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.readout_chain import readings
from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.effects.engine.specification import TransducerArray
from palpate.core.gap.candidates.candidates import Candidate
from palpate.core.gap.candidates.direct_estimates import MOST_MISFIT, level_parameters, quantization_starts
from palpate.core.gap.candidates.view_set import view_set_of
from palpate.core.gap.forward.predictor import Model, predictors_of

LEVELS = {
    "round": lambda k, v: v["step"] * k,
    "power": lambda k, v: v["first"] * k ** (1.0 / v["exponent"]),
    "companding": lambda k, v: v["scale"] * np.expm1(v["growth"] * k),
}
CONVERTERS = [
    ("round", {"step": 0.02}),
    ("power", {"first": 0.02, "exponent": 0.5}),
    ("power", {"first": 0.02, "exponent": 1.6}),
    ("companding", {"scale": 0.1, "growth": 0.05}),
    ("companding", {"scale": 0.02, "growth": 0.02}),
]


@pytest.mark.parametrize(("count", "missing"), [(8, 0.0), (60, 0.1), (400, 0.1)])
@pytest.mark.parametrize(("form", "values"), CONVERTERS)
def test_levels_have_the_parameters_of_their_converter(form, values, count, missing):
    """Exactly, even if a tenth of the levels is missing: an error in the number of one level is seen in all above it."""
    k = np.arange(1, count + 1)
    k = k[np.random.default_rng(count).random(count) >= missing]
    levels = LEVELS[form](k, values)
    found, misfit = level_parameters(levels, form_of("quantization", form), missing == 0.0)
    assert found == pytest.approx(values, rel=1e-6) and misfit < 1e-6
    others = [level_parameters(levels, form_of("quantization", one), missing == 0.0)[1] for one in ("round", "companding")]
    assert min(others) > MOST_MISFIT or form != "power" or count == 8  # few levels have the numbers of several forms


def behind(form, values, gain=1.0, change=lambda reading: reading, noise=1e-4):
    """What is read off of a rig behind a converter, about readings up to one, after another change."""
    rig = cases.rig(trials=2, seconds=8.0, seed=2, stated=80.0)
    size = max(one.reading.max() for one in rig.trials)
    pad = TransducerArray(np.zeros((24, 3)), np.ones(24), gain=gain)
    converter = effect("quantization", form, **values)
    trials = [replace(one, reading=change(readings((converter,), pad, one.time, one.reading / size))) for one in rig.trials]
    views = view_set_of(predictors_of(trials, rig), (noise, 1.0))
    model = Model(replace(rig.parameters, gain=gain * rig.parameters.gain / size))

    def starts(other):
        candidate = Candidate(kind_of("quantization"), form_of("quantization", other))
        return quantization_starts(views.moving_readings(model), views.whole, model, candidate)

    return starts


@pytest.mark.parametrize("gain", [1.0, -1.0])
@pytest.mark.parametrize(("form", "values"), [("round", {"step": 0.01}), ("power", {"first": 0.01, "exponent": 0.6})])
def test_readings_behind_a_converter_show_its_levels(form, values, gain):
    """Whether readings rise or fall under load. Those that noise moves over an edge are levels, too."""
    found = behind(form, values, gain)(form)
    for name, value in values.items():
        assert [one.values[name] for one in found] == pytest.approx([value] * len(found), rel=1e-4)
    assert [one.values["rounding"] for one in found if "rounding" in one.values] == ([0.0, 0.5] if form == "power" else [])
    assert found


def test_three_levels_and_one_odd_reading_are_enough():
    (found,) = behind("round", {"step": 0.45})("round")
    assert found.values["step"] == pytest.approx(0.45)

    def with_a_glitch(reading):
        reading[len(reading) // 3, 10] += 0.045
        return reading

    (found,) = behind("round", {"step": 0.1}, change=with_a_glitch)("round")
    assert found.values["step"] == pytest.approx(0.1)


def test_even_steps_need_no_reading_without_load():
    (found,) = behind("round", {"step": 0.01}, change=lambda reading: np.where(reading > 0.3, reading + 7.0, np.nan))("round")
    assert found.values["step"] == pytest.approx(0.01)


def test_no_levels_are_seen_in_noise_or_below_it():
    assert behind("round", {"step": 0.0})("round") == []
    assert behind("round", {"step": 0.01}, noise=0.011)("round") == []
