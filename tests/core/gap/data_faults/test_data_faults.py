# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the data are found with evidence, put right on request, and no healthy rig is accused."""

import re
from dataclasses import replace
from pathlib import Path

import faulty_rigs as made
import gap_cases as cases
import numpy as np
import pytest

from palpate.benchmarks import _recordings
from palpate.benchmarks._handmade import low_pass
from palpate.benchmarks._recordings import Recording
from palpate.core.errors import PalpateError
from palpate.core.gap.data_faults.clocks import refined_shifts, shift_of, with_shift
from palpate.core.gap.data_faults.search import find_faults, put_right
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.dataset.trial import FAULT_KINDS
from palpate.core.gap.forward.stimulus import stimulus_of


def stimuli_of(rig):
    return [stimulus_of(trial, rig) for trial in rig.trials]


def with_correction(path, words='"all"'):
    path.write_text(path.read_text().replace("[sensor]", f"[data]\ncorrect = {words}\n[sensor]", 1))
    return path


def test_the_generator_shares_nothing_with_the_package_but_a_writer_of_files():
    for module, allowed in ((made, ["from palpate.benchmarks._recordings import Recording"]), (_recordings, [])):
        text = Path(module.__file__).read_text(encoding="utf-8")
        assert re.findall(r"^\s*((?:from|import) (?:palpate|\.).*)$", text, re.MULTILINE) == allowed


def test_every_kind_of_fault_is_made():
    assert set(made.KINDS) == set(FAULT_KINDS)


@pytest.mark.parametrize("kind", made.KINDS)
def test_a_fault_is_found_and_put_right(tmp_path, kind):
    case = made.draw("gel", kind, 0, tmp_path)
    rig = read_rig(case.path)
    found = find_faults(rig, stimuli_of(rig))
    assert made.is_right(case, [(fault.kind, fault.trials) for fault in found])
    assert found[0].sentence.endswith("puts it right.") and "\n" not in found[0].sentence
    rig = read_rig(with_correction(case.path))
    mended, faults = put_right(rig, stimuli_of(rig))
    assert [(fault.kind, fault.put_right) for fault in faults] == [(kind, True)]
    assert "this was put right" in faults[0].sentence
    assert not find_faults(mended, stimuli_of(mended))


@pytest.mark.parametrize(("family", "numbers"), [("foam", range(3)), ("counts", range(3, 6)), ("gel", range(6, 10))])
def test_a_healthy_rig_is_not_accused(tmp_path, family, numbers):
    """Whatever effect its sensor has: the numbers go through all of them."""
    for number in numbers:
        rig = read_rig(made.draw(family, "", number, tmp_path).path)
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
    path = rubbed.write(tmp_path)
    rig = read_rig(path)
    faults = find_faults(rig, stimuli_of(rig))
    assert [fault.kind for fault in faults] == kinds
    assert all(fault.trials == ("slow", "fast") and "drives the slide" in fault.sentence for fault in faults)
    mended, _ = put_right(read_rig(with_correction(path, '["sign"]')), stimuli_of(rig))
    np.testing.assert_allclose(mended.trials[0].force[:, 0], sign * rig.trials[0].force[:, 0])


def test_only_what_is_asked_for_is_put_right(tmp_path):
    rig = read_rig(with_correction(made.draw("gel", "stuck-logger", 0, tmp_path).path, '["sign", "unit"]'))
    assert rig.correct == ("sign", "unit")
    mended, faults = put_right(rig, stimuli_of(rig))
    assert mended is rig and [fault.put_right for fault in faults] == [False]


@pytest.mark.parametrize("words", ['"some"', "3", '["signs"]', "[1]"])
def test_unknown_corrections_are_refused(tmp_path, words):
    with pytest.raises(PalpateError, match="clock-shift"):
        read_rig(with_correction(made.draw("foam", "", 0, tmp_path).path, words))


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
