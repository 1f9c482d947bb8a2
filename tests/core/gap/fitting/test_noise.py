# SPDX-License-Identifier: GPL-3.0-or-later
"""The noise at rest: from cells that are missing, in loads, in repeats, and a line in it."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from rig_files import RIG, write
from scipy.signal import lfilter

from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.fitting.least_squares import TrialView
from palpate.core.gap.fitting.noise_floor import ChannelNoise, _load_noise, force_noise, reading_noise, with_repeats
from palpate.core.gap.fitting.residual_tests import strongest_line
from palpate.core.gap.forward.predictor import Model, Predictor, predictors_of

NOISE = 0.003
ERROR = 0.05
"""The deviation of a few thousand values has a standard error of 2 %."""


def with_missing(values, share, rng):
    """Values of which a share is missing."""
    return np.where(rng.random(values.shape) < share, np.nan, values)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.4])
def test_missing_readings_leave_the_noise_as_it_is(share):
    rng, rig = np.random.default_rng(11), cases.rig(trials=2, seconds=8.0, noise=NOISE)
    trials = tuple(replace(one, reading=with_missing(one.reading, share, rng)) for one in rig.trials)
    found = reading_noise(predictors_of(trials, rig), 1.0)
    true = reading_noise(predictors_of(rig.trials, rig), 1.0)
    assert true.source == found.source == "stretches without load"
    assert found.deviation == pytest.approx(true.deviation, rel=ERROR)
    assert found.correlation_time == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("zeros", [0.0, 50.0])
def test_neither_common_mode_nor_zeros_nor_the_median_bias_the_noise(zeros):
    rng, rig, found = np.random.default_rng(14), cases.rig(trials=2, seconds=20.0), []
    for _ in range(8):
        trials = []
        for one in rig.trials:
            common = np.sin(one.time)[:, None] + zeros * NOISE * rng.normal(size=one.reading.shape[1])
            trials.append(replace(one, reading=common + NOISE * rng.normal(size=one.reading.shape)))
        found.append(reading_noise(predictors_of(trials, rig), 1.0).deviation / NOISE)
    error = np.std(found, ddof=1) / np.sqrt(len(found))
    assert error < 0.003 and np.mean(found) == pytest.approx(1.0, abs=3 * error)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_missing_forces_leave_the_noise_as_it_is(share):
    rng, rig = np.random.default_rng(12), cases.rig(trials=2, seconds=8.0)
    force = [np.sin(one.time)[:, None] + NOISE * rng.normal(size=(len(one.time), 3)) for one in rig.trials]
    trials = tuple(replace(t, force=with_missing(f, share, rng)) for t, f in zip(rig.trials, force, strict=True))
    assert force_noise(predictors_of(trials, rig), 1.0).deviation == pytest.approx(NOISE, rel=2 * ERROR)


def test_coloured_noise_keeps_its_memory_where_cells_are_missing():
    rng, rig = np.random.default_rng(13), cases.rig(trials=2, seconds=30.0)
    trials = []
    for one in rig.trials:
        noise = rng.normal(size=one.reading.shape)
        noise[1:] += noise[:-1]  # of neighbours: correlation 1/2, so a memory of 1 + 2 · 1/2 samples
        trials.append(replace(one, reading=one.reading + NOISE * noise))
    some = [replace(one, reading=with_missing(one.reading, 0.3, rng)) for one in trials]
    whole, part = (reading_noise(predictors_of(one, rig), 1.0) for one in (trials, some))
    assert whole.correlation_time == pytest.approx(2.0, abs=0.3)
    assert part.deviation == pytest.approx(whole.deviation, rel=ERROR)
    assert part.correlation_time == pytest.approx(whole.correlation_time, abs=0.3)


# --- loads


LOADS = 60


def weights(rng):
    """Weights that are put down within one to four samples."""
    rate, parts = rng.uniform(10.0, 200.0), []
    for _ in range(rng.integers(3, 25)):
        weight, count, up = rng.uniform(0.1, 2.0), int(rng.uniform(0.5, 6.0) * rate) + 4, rng.integers(1, 5)
        rise = np.arange(up) / up if rng.random() < 0.5 else np.sort(rng.random(up))
        parts += [np.zeros(count), weight * rise, np.full(count, weight)]
    return np.concatenate(parts)


def pressed(rng):
    """Ramps and holds of a force sensor with white noise and steps of up to four deviations; and the noise."""
    rate, parts = rng.uniform(20.0, 500.0), []
    for _ in range(rng.integers(2, 10)):
        height, up, count = rng.uniform(0.2, 2.0), int(rng.uniform(0.2, 2.0) * rate), int(rng.uniform(0.3, 4.0) * rate)
        ramp = np.linspace(0.0, height, up)
        parts += [np.zeros(count // 2 + 2), ramp, np.full(count, height), ramp[::-1]]
    load = np.concatenate(parts)
    deviation = 10 ** rng.uniform(-2.8, -1.6) * load.max()
    values, step = load + deviation * rng.normal(size=len(load)), rng.choice([0.0, 1.0, 2.0, 3.0, 4.0]) * deviation
    return (np.round(values / step) * step if step else values), np.hypot(deviation, step / np.sqrt(12.0))


def test_weights_have_no_noise():
    rng = np.random.default_rng(2)
    assert [_load_noise(weights(rng)) for _ in range(LOADS)] == [0.0] * LOADS


def test_measured_loads_have_their_noise():
    rng = np.random.default_rng(3)
    ratios = []
    for _ in range(LOADS):
        load, noise = pressed(rng)
        ratios.append(_load_noise(load) / noise)
    assert min(ratios) > 0.8 and max(ratios) < 1.7  # coarse steps are not normal: their median is a step


# --- repeats


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


@pytest.mark.parametrize("scatter", ["factors", "zeros", "gains of texels", "wander"])
def test_what_repeats_differ_by_is_no_gap(scatter):
    rig, rng = repeated(factors=FACTORS if scatter == "factors" else (1.0,) * 4, noise=0.001), np.random.default_rng(8)
    full = rig.trials[0].reading.max()
    trials = []
    for trial in rig.trials:
        count, texels = trial.reading.shape
        change = {
            "factors": 0.0,
            "zeros": 0.03 * full * rng.normal(),
            "gains of texels": 0.08 * rng.normal(size=texels) * trial.reading,
            "wander": 0.08 * lfilter([0.2], [1.0, -0.98], rng.normal(size=count))[:, None] * trial.reading,
        }[scatter]
        trials.append(replace(trial, reading=trial.reading + change))
    found = cases.diagnosed(replace(rig, trials=tuple(trials)))
    assert found.verdict == "no gap" and not found.findings


def test_recordings_with_other_loads_are_no_repeats():
    rig = repeated()
    other = replace(rig.trials[1], position=rig.trials[1].position[::-1].copy() + [0.002, 0.0, 0.0])
    with pytest.raises(FileError, match="loads differ"):
        with_repeats(QUIET, predictors_of([rig.trials[0], other], rig), "reading")


def test_a_rig_says_it(tmp_path):
    rig = read_rig(write(tmp_path, RIG.replace('.csv"\n', '.csv"\nrepeats = "a"\n')))
    assert [trial.repeats for trial in rig.trials] == ["a", "a"]


# --- lines


def line_in(rig, deviation):
    views = [TrialView(Predictor(trial, rig), noise=(deviation, 1.0)) for trial in rig.of("fit")]
    return strongest_line(views, Model(rig.parameters))


def hum(amplitude, frequency):
    """Every texel at a phase of its own, so that the mean of all shows nothing."""
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, cases.ROWS * cases.COLUMNS)
    return lambda reading, time: reading + amplitude * np.sin(2 * np.pi * frequency * time[:, None] + phase)


def test_a_line_is_found_with_frequency_and_amplitude():
    found = line_in(cases.rig(change=hum(0.01, 7.3), seed=21), 1e-3)
    assert found.frequency == pytest.approx(7.3, abs=0.04)  # half the distance of two frequencies of a trial
    assert found.amplitude == pytest.approx(0.01, rel=0.15)  # a frequency between two loses some of it


@pytest.mark.parametrize("colour", [0.0, 0.9])
@pytest.mark.parametrize("seed", range(5))
def test_noise_has_no_line(colour, seed):
    assert line_in(cases.rig(seed=30 + seed, colour=colour), 1e-3) is None
