# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment from end to end: what recordings leave ambiguous, a recording along the written trajectory resolves."""

import json

import numpy as np
import pytest
from small_pad import DEEP, RADIUS, RATE, SENSOR, K, columns_of, loads

from palpate.benchmarks._recordings import Recording
from palpate.commands import main

SHARE, TAU, POWER = 0.35, 2.5, 0.6
"""Of the stress that relaxes: by a stretched exponential (Kohlrausch), which the library does not have."""
NOISE = 0.003
"""Of full load."""


def recorded(path, rng):
    """A recording of the pad, whose stress relaxes, under a ball whose centre follows a path (T, 3), m."""
    force, time = loads(path), np.arange(len(path)) / RATE
    lost = SHARE * (1.0 - np.exp(-((time / TAU) ** POWER)))
    rises = np.diff(force, axis=0, prepend=0.0)
    relaxed = np.stack([np.convolve(rises[:, i], lost)[: len(path)] for i in range(force.shape[1])], axis=1)
    return columns_of(path, np.maximum(force - relaxed, 0.0) + NOISE * K * DEEP * rng.normal(size=force.shape))


def said_of(trials, folder, out):
    rig = Recording("pad that relaxes", SENSOR, trials).write(folder)
    assert main(["gap", str(rig), "--out", str(folder / out)]) == 0
    return json.loads((folder / out / "gap.json").read_text())


@pytest.mark.long("palpate gap twice, from a rig to its report")
def test_the_trajectory_that_is_written_resolves_what_was_ambiguous(tmp_path):
    """Three slow presses, without a hold or another speed, and then what is planned."""
    rng, time = np.random.default_rng(5), np.arange(int(14 * RATE)) / RATE
    depth = np.interp(time, [0.0, 1.0, 7.0, 13.0, 14.0], [-1e-3, -1e-3, DEEP, -1e-3, -1e-3])
    slow = np.stack([0.0 * time, 0.0 * time, RADIUS - depth], axis=1)
    trials = [(f"press_{i}", "check" if i == 2 else "fit", recorded(slow, rng)) for i in range(3)]
    before = said_of(trials, tmp_path, "before")
    assert any("creep" in group for group in before["ambiguous"])
    assert before["planned_experiment"]["separation_after"] > before["planned_experiment"]["separation_before"]
    table = np.genfromtxt(tmp_path / "before" / "next_experiment.csv", delimiter=",", names=True)
    time = np.arange(0.0, table["time"][-1], 1.0 / RATE)
    planned = np.stack([np.interp(time, table["time"], table[axis]) for axis in "xyz"], axis=1)
    after = said_of([*trials, ("planned", "fit", recorded(planned, rng))], tmp_path, "after")
    assert not after["ambiguous"] and after["verdict"] == "explained"
    assert [one["effect"] for one in after["found"] if one["confidence"] >= 0.5] == ["creep"]
