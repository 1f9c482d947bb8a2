# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured repeats are the noise floor where they differ by more than the noise."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from rig_files import RIG, write
from scipy.signal import lfilter

from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.fitting.noise_floor import ChannelNoise, with_repeats
from palpate.core.gap.forward.predictor import predictors_of
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

QUIET = ChannelNoise(0.001, 1.0, "stretches without load")
FACTORS = (1.0, 1.06, 0.94, 1.03, 0.97)


def repeated(factors=FACTORS, group="a", noise=0.0):
    """A rig of one recording, measured again with readings that each differ by a factor."""
    rig, rng = cases.rig(trials=1, seconds=10.0, noise=noise), np.random.default_rng(3)
    first = rig.trials[0]
    trials = [
        replace(
            first,
            name=f"t{i}",
            use="check" if i == len(factors) - 1 else "fit",
            reading=factor * first.reading + 1e-4 * rng.normal(size=first.reading.shape),
            repeats=group,
            time=first.time + 100.0 * i,
        )
        for i, factor in enumerate(factors)
    ]
    return replace(rig, trials=tuple(trials))


def test_the_scatter_of_repeats_is_their_noise():
    rig = repeated()
    found = with_repeats(QUIET, predictors_of(rig.trials, rig), "reading")
    mean = np.mean([trial.reading for trial in rig.trials], axis=0) / np.mean(FACTORS)
    assert found.deviation == pytest.approx(np.std(FACTORS, ddof=1) * np.sqrt((mean**2).mean()), rel=0.01)
    assert found.source == "measured repeats" and found.correlation_time > 5.0
    loud = ChannelNoise(1.0, 1.0, "stretches without load")
    assert with_repeats(loud, predictors_of(rig.trials, rig), "reading") is loud
    assert with_repeats(QUIET, predictors_of(rig.trials, rig), "force") is QUIET
    alone = repeated(group="")
    assert with_repeats(QUIET, predictors_of(alone.trials, alone), "reading") is QUIET


def test_white_noise_of_repeats_has_its_own_deviation():
    rig = cases.rig(trials=1, seconds=10.0, noise=0.0)
    rng, first = np.random.default_rng(5), rig.trials[0]
    trials = [replace(first, name=f"t{i}", repeats="a", reading=first.reading + 0.01 * rng.normal(size=first.reading.shape))
              for i in range(3)]  # fmt: skip
    found = with_repeats(QUIET, predictors_of(trials, rig), "reading")
    assert found.deviation == pytest.approx(0.01, rel=0.03) and found.correlation_time < 1.3


def test_what_repeats_differ_by_is_no_gap():
    assert run_job(diagnose(repeated(noise=0.001))).verdict == "no gap"


@pytest.mark.parametrize("scatter", ["zeros", "gains of texels", "wander"])
def test_repeats_that_differ_in_other_ways_are_no_gap_either(scatter):
    rig, rng = repeated(factors=(1.0,) * 4), np.random.default_rng(8)
    full = rig.trials[0].reading.max()
    trials = []
    for trial in rig.trials:
        count, texels = trial.reading.shape
        change = {
            "zeros": 0.03 * full * rng.normal(),
            "gains of texels": 0.08 * rng.normal(size=texels) * trial.reading,
            "wander": 0.08 * lfilter([0.2], [1.0, -0.98], rng.normal(size=count))[:, None] * trial.reading,
        }[scatter]
        trials.append(replace(trial, reading=trial.reading + change))
    found = run_job(diagnose(replace(rig, trials=tuple(trials))))
    assert found.verdict == "no gap" and not found.findings


def test_an_effect_larger_than_the_scatter_is_a_gap():
    rig = repeated(factors=(1.0, 1.02, 0.98))
    trials = [replace(one, reading=one.reading + one.reading**2 / one.reading.max()) for one in rig.trials]
    found = run_job(diagnose(replace(rig, trials=tuple(trials))))
    assert found.noise[0].source == "measured repeats" and found.verdict != "no gap"


def test_recordings_with_other_loads_are_no_repeats():
    rig = repeated()
    other = replace(rig.trials[1], position=rig.trials[1].position[::-1].copy() + [0.002, 0.0, 0.0])
    with pytest.raises(FileError, match="loads differ"):
        with_repeats(QUIET, predictors_of([rig.trials[0], other], rig), "reading")


def test_a_rig_says_it(tmp_path):
    rig = read_rig(write(tmp_path, RIG.replace('.csv"\n', '.csv"\nrepeats = "a"\n')))
    assert [trial.repeats for trial in rig.trials] == ["a", "a"]
    with pytest.raises(FileError, match="Only one recording"):
        read_rig(write(tmp_path, RIG + 'repeats = "a"\n'))
    with pytest.raises(FileError, match="repeats of Trial 2"):
        read_rig(write(tmp_path, RIG + "repeats = 3\n"))
