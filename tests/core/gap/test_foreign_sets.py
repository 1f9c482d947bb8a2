# SPDX-License-Identifier: GPL-3.0-or-later
"""Models by hand of foreign recordings: each finds what it consists of, and has at most five numbers for each channel."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.benchmarks._foreign import FOREIGN, _eflesh
from palpate.benchmarks._handmade import predict_by_hand
from palpate.benchmarks._recordings import Recording
from palpate.core.gap.dataset.column_names import GRAVITY

TIME = np.linspace(0.0, 40.0, 500)
STIMULI = {"force": (0.0, 2000.0), "depth": (0.0, 1e-3), "slide_x": (-5e-3, 5e-3)}
STIMULUS = {
    "adhesive": "depth",
    "tape": "depth",
    "foam": "depth",
    "foam-shear": "depth",
    "brake": "slide_x",
    "damper": "slide_x",
}
SIZES = {"foam": 5.0, "oscillator": 2e-4}


def columns(name, phase):
    low, high = STIMULI[STIMULUS.get(name, "force")]
    wave = 0.5 - 0.5 * np.cos(2 * np.pi * TIME / 7.0 + phase) * np.cos(TIME / 9.0)
    time = TIME / 50.0 if name == "oscillator" else TIME
    volts = {"force": 1e3 + 400.0 * np.sin(TIME / 3.0 + phase)} if name == "damper" else {}
    return {"time": time, STIMULUS.get(name, "force"): low + (high - low) * wave * SIZES.get(name, 1.0)} | volts


def test_every_set_says_what_it_is_and_its_model_is_small():
    for one in FOREIGN.values():
        assert one.kind and one.licence and one.split and one.by_hand.describes
        own = next(name for name, other in FOREIGN.items() if other is one)
        terms = one.by_hand.terms(one.by_hand.start, columns(own, 0.0), 0)
        assert len(terms) + len(one.by_hand.start) <= 5 and all(term.shape == TIME.shape for term in terms)


@pytest.mark.parametrize("name", sorted(FOREIGN))
def test_a_model_finds_what_it_consists_of(name):
    """Readings of other numbers than those from which the search starts are predicted in a recording that was not fitted."""
    model = FOREIGN[name].by_hand
    numbers = np.array(model.start) * 1.3
    trials = []
    for i, use in enumerate(("fit", "check")):
        own = columns(name, 0.8 * i)
        terms = model.terms(numbers, own, 0)
        size = [max(np.abs(term).max(), 1e-12) for term in model.terms(numbers, columns(name, 0.0), 0)]
        reading = sum((1.0 + k) * term / size[k] for k, term in enumerate(terms))
        trials.append((f"trial_{i}", use, own | {"texel_0": reading}))
    found = predict_by_hand(model, Recording(name, "", trials))[1][:, 0]
    truth = trials[1][2]["texel_0"]
    assert np.sqrt(np.mean((found - truth) ** 2)) < 2e-3 * np.ptp(truth)


def test_a_scale_that_was_too_slow_is_interpolated(tmp_path):
    """Of eFlesh's files a force of −1 is none, grams become newtons, and two samples become one."""
    time = 1.7e9 + np.arange(400) * 0.1
    grams = 1000.0 - 1000.0 * np.cos(np.arange(400) * 0.03)
    written = np.where(np.arange(400) % 2 > 0, -1.0, grams)
    np.savetxt(tmp_path / "states.csv", np.column_stack([time, 0 * time, 0 * time, 0 * time, written]), "%.9f", delimiter=",")
    np.savetxt(tmp_path / "sensor_post_baselines.csv", np.column_stack([time + 1e-3, grams, -grams]), "%.9f", delimiter=",")
    found = _eflesh(tmp_path)
    assert set(found) == {"time", "force", "texel_0", "texel_1"} and np.median(np.diff(found["time"])) == pytest.approx(0.2)
    np.testing.assert_allclose(found["force"], GRAVITY * 1e-3 * found["texel_0"], atol=0.02)
