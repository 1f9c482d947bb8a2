# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the data are found with evidence, put right on request, and no healthy rig is accused."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from rig_files import RIG, write
from scipy.signal import lfilter

from palpate.benchmarks._handmade import low_pass
from palpate.benchmarks._recordings import Recording
from palpate.core.gap.data_faults.clocks import refined_shifts, shift_of, with_shift
from palpate.core.gap.data_faults.search import find_faults, put_right
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.dataset.trial import FAULT_KINDS
from palpate.core.gap.forward.stimulus import stimulus_of

TEXELS = cases.ROWS * cases.COLUMNS
RAIL = 0.08
"""N; about half of the largest reading."""


def stimuli_of(rig):
    return [stimulus_of(trial, rig) for trial in rig.trials]


def with_readings(change):
    """A fault of the readings (T, n) alone."""
    return lambda trial: replace(trial, reading=change(trial.reading))


def earlier(trial):
    """The stimulus comes half a second too early, so that the response is late."""
    late = int(0.5 * cases.RATE)
    return replace(trial, position=np.concatenate([trial.position[late:], np.repeat(trial.position[-1:], late, axis=0)]))


def swapped(reading):
    """Two texels that different places of the ball load."""
    order = np.arange(TEXELS)
    order[[5, 14]] = 14, 5
    return reading[:, order]


def stuck(reading):
    """The logger repeats one sample for 2 s."""
    reading = reading.copy()
    reading[120:200] = reading[119]
    return reading


EVERY, ONE = tuple(f"t{i}" for i in range(5)), ("t1",)
FAULTS = {
    "clock-shift": (earlier, (EVERY, ONE)),
    "swapped-channels": (with_readings(swapped), (EVERY,)),
    "reversed-channels": (with_readings(lambda reading: reading[:, ::-1]), (EVERY,)),
    "stuck-logger": (with_readings(stuck), (ONE,)),
    "repeated-samples": (with_readings(lambda reading: reading[np.arange(len(reading)) // 3 * 3]), (EVERY, ONE)),
    "unit": (with_readings(lambda reading: 9.81 * reading), (EVERY, ONE)),
    "saturated-converter": (with_readings(lambda reading: np.minimum(reading, RAIL)), (EVERY,)),
    "sign": (with_readings(lambda reading: -reading), (EVERY, ONE)),
}
"""Faults, and the recordings that have them."""


def faulty(kind, names):
    """A sensor that creeps, of which some recordings have a fault."""
    rig = cases.rig(contact=cases.relaxing(), seed=2)
    return replace(rig, trials=tuple(FAULTS[kind][0](one) if one.name in names else one for one in rig.trials))


@pytest.mark.parametrize(("kind", "names"), [(kind, names) for kind, (_, all_names) in FAULTS.items() for names in all_names])
def test_a_fault_is_found_and_put_right(kind, names):
    assert set(FAULTS) == set(FAULT_KINDS)
    rig = faulty(kind, names)
    (fault,) = find_faults(rig, stimuli_of(rig))
    assert fault.kind == kind and set(fault.trials) == set(names)
    assert fault.sentence.endswith("puts it right.") and "\n" not in fault.sentence
    mended, faults = put_right(replace(rig, correct=(kind,)), stimuli_of(rig))
    assert [(one.kind, one.put_right) for one in faults] == [(kind, True)]
    assert "this was put right" in faults[0].sentence
    assert not find_faults(mended, stimuli_of(mended))


def test_missing_cells_do_not_end_the_run_of_a_logger_that_is_stuck():
    rig, said = faulty("stuck-logger", ONE), []
    for _ in range(2):
        (fault,) = find_faults(rig, stimuli_of(rig))
        said.append(fault.sentence)
        rig.trials[1].reading[[130, 150, 151], [3, 5, 3]] = np.nan
    assert said[0] == said[1]


def low_passed(reading, time):
    keep = np.exp(-1.0 / (0.1 * cases.RATE))
    return lfilter([1.0 - keep], [1.0, -keep], reading, axis=0)


def played(reading, _time):
    """A quarter of the reading trails behind by a play of an eighth of the largest."""
    held, width = np.zeros(TEXELS), 0.12 * reading.max()
    found = np.empty_like(reading)
    for i, now in enumerate(reading):
        held = np.clip(held, now - width, now + width)
        found[i] = 0.75 * now + 0.25 * np.maximum(held, 0.0)
    return found


HEALTHY = {
    "nothing": {},
    "relaxes": {"contact": cases.relaxing()},
    "late": {"change": low_passed},
    "loop": {"change": played},
    "gains": {"change": lambda reading, time: reading * np.linspace(0.7, 1.3, TEXELS)},
    "offsets": {"change": lambda reading, time: reading + 0.01 * np.sin(7.0 * np.arange(TEXELS))},
    "drifts": {"change": lambda reading, time: reading + 0.02 * (1.0 - np.exp(-time / 8.0))[:, None]},
    "bends": {"change": lambda reading, time: 0.1 * np.tanh(reading / 0.1)},
    "steps": {"change": lambda reading, time: np.round(reading / 0.002) * 0.002, "noise": 0.0},
    "falls in counts": {"change": lambda reading, time: np.round(3200.0 - 2400.0 * reading / (0.1 + reading)), "noise": 0.001},
}


@pytest.mark.parametrize("effect", HEALTHY)
def test_a_healthy_rig_is_not_accused(effect):
    """Whatever effect its sensor has, and with the net force that its readings sum to."""
    rig = cases.rig(**HEALTHY[effect], seed=3)
    if effect == "falls in counts":
        rig = replace(rig, parameters=replace(rig.parameters, unit="counts"))
    else:
        net = [np.outer(trial.reading.sum(axis=1), [0.0, 0.0, -1.0]) for trial in rig.trials]
        rig = replace(rig, trials=tuple(replace(one, force=force) for one, force in zip(rig.trials, net, strict=True)))
    assert not find_faults(rig, stimuli_of(rig))


@pytest.mark.parametrize(("late", "kinds"), [(False, []), (True, ["clock-shift"])])
def test_a_sensor_that_lags_has_no_shifted_clock(tmp_path, late, kinds):
    """Three low passes in turn delay and smear the response of all recordings; a clock that is as late does not smear it."""
    rng, trials = np.random.default_rng(7), []
    for name, use in (("a", "fit"), ("b", "fit"), ("c", "check")):
        time = np.arange(0.0, 40.0, 0.05)
        wide = rng.uniform(0.3, 1.2, 8)
        depth = 0.002 * sum(np.abs(time - 5.0 * (i + 0.6)) < half for i, half in enumerate(wide))
        felt = 1e3 * depth
        if late:
            felt = np.interp(time - 0.6, time, felt)
        else:
            for _ in range(3):
                felt = low_pass(time, felt, 0.25)
        trials.append((name, use, {"time": time, "depth": depth, "texel_0": felt + rng.normal(0.0, 0.01, len(time))}))
    press = Recording("press", 'grid = { rows = 1, columns = 1, pitch = 0.01 }\nunit = "kPa"\nmax_penetration = 0.01', trials)
    rig = read_rig(press.write(tmp_path))
    assert [fault.kind for fault in find_faults(rig, stimuli_of(rig))] == kinds


@pytest.mark.parametrize(("threshold", "rest", "kinds"), [(8.0, 0.0, []), (8.0, 40.0, []), (0.0, None, ["stuck-logger"])])
def test_electronics_that_cut_off_below_a_threshold_are_no_stuck_logger(tmp_path, threshold, rest, kinds):
    """Untouched, all texels read the same to the last digit; a logger that is stuck under load is one still."""
    rng, trials = np.random.default_rng(8), []
    for name, use in (("a", "fit"), ("b", "fit"), ("c", "check")):
        time = np.arange(0.0, 15.0, 0.03)
        force = 2.0 * np.clip(np.sin(time * rng.uniform(0.8, 1.2)), 0.0, None) ** 2
        count = np.round(400.0 * force[:, None] / 4.0 * [1.0, 1.05, 0.95, 1.0] + rng.normal(0.0, 1.5, (len(time), 4)))
        if rest is not None:
            count = rest + np.where((count < threshold) | (force < 1e-9)[:, None], 0.0, count)
        else:
            count[200:240] = count[199]
        columns = {f"texel_{i}": count[:, i] for i in range(4)}
        trials.append((name, use, {"time": time, "force": force, **columns}))
    pad = Recording("pad", 'grid = { rows = 2, columns = 2, pitch = 0.0034 }\nunit = "counts"', trials)
    rig = read_rig(pad.write(tmp_path))
    assert [fault.kind for fault in find_faults(rig, stimuli_of(rig))] == kinds


@pytest.mark.parametrize(("sign", "kinds"), [(1.0, []), (-1.0, ["sign"])])
def test_friction_never_drives_a_slide(tmp_path, sign, kinds):
    """Friction of 2 N takes work from the surface that slides; the cell that measures it has an offset, too."""
    time = np.arange(0.0, 8.0, 0.01)
    trials = []
    for name, use, beat in (("slow", "fit", 0.5), ("fast", "check", 0.8)):
        slide = 0.02 * np.sin(2 * np.pi * beat * time)
        force = sign * (2.0 * np.tanh(50.0 * np.cos(2 * np.pi * beat * time)) + 0.2)
        trials.append((name, use, {"time": time, "depth": np.full(len(time), 1e-3), "slide_x": slide, "force_x": force}))
    rubbed = Recording("rubbed", "grid = { rows = 1, columns = 1, pitch = 0.01 }\nk = 1e4", trials)
    rig = read_rig(rubbed.write(tmp_path))
    faults = find_faults(rig, stimuli_of(rig))
    assert [fault.kind for fault in faults] == kinds
    assert all(fault.trials == ("slow", "fast") and "drives the slide" in fault.sentence for fault in faults)
    mended, _ = put_right(replace(rig, correct=("sign",)), stimuli_of(rig))
    np.testing.assert_allclose(mended.trials[0].force[:, 0], sign * rig.trials[0].force[:, 0])


def test_only_what_is_asked_for_is_put_right():
    rig = replace(faulty("stuck-logger", ONE), correct=("sign", "unit"))
    mended, faults = put_right(rig, stimuli_of(rig))
    assert mended is rig and [fault.put_right for fault in faults] == [False]


def test_a_rig_says_what_is_put_right(tmp_path):
    def read(words):
        return read_rig(write(tmp_path, RIG.replace("[sensor]", f"[data]\ncorrect = {words}\n[sensor]")))

    assert read('["sign", "unit"]').correct == ("sign", "unit") and set(read('"all"').correct) == set(FAULT_KINDS)


def test_shifts_are_refined_and_taken_back_to_a_fraction_of_a_sample():
    """A viscous response comes earlier than its load, here by 0.4 samples, which may be left in all shifts."""
    late, step = 20.4, 1.0 / cases.RATE
    rig = cases.rig(trials=3, seconds=8.0)
    trials = []
    for trial in rig.trials:
        reading = np.stack([np.interp(trial.time - late * step, trial.time, column) for column in trial.reading.T], axis=1)
        trials.append(replace(trial, reading=reading))
    rough = [shift_of(stimulus_of(trial, rig)).late for trial in trials]
    assert max(abs(one / step - late) for one in rough) < 1.0
    samples = np.array(refined_shifts(rig, trials, rough)) / step - late
    assert np.ptp(samples) < 0.15 and (samples > -0.45).all() and (samples < 0.1).all()
    mended = with_shift(trials[0], late * step)
    path = rig.trials[0].position
    np.testing.assert_allclose(mended.position[40:-20], path[20:-40] - 0.4 * np.diff(path, axis=0)[19:-40])
    assert np.isnan(mended.reading[:20]).all() and np.array_equal(mended.reading[21:], trials[0].reading[21:])


def test_the_time_of_a_shift_is_found_again_in_an_uneven_clock():
    trial = cases.rig(trials=1, seconds=4.0, noise=0.0).trials[0]
    time = trial.time + 0.01 * np.sin(7.0 * trial.time)
    uneven = replace(trial, time=time, position=np.repeat(time[:, None], 3, axis=1))
    moved = with_shift(uneven, 0.3)
    kept = np.isfinite(moved.reading[:, 0])
    np.testing.assert_allclose(moved.position[kept, 0], time[kept] - 0.3)
    assert 0.9 < kept.mean() < 0.95
