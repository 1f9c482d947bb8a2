# SPDX-License-Identifier: GPL-3.0-or-later
"""The shift of two clocks is found to about a sample, or it is said not to be known."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.gap.logs.clock_alignment import clock_shift


def presses(seed, seconds=30.0, rate=200.0):
    """A height above a sensor that wanders, and times of it."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / rate)
    knots = np.sort(random.uniform(0.0, seconds, 14))
    return time, np.interp(time, knots, random.uniform(-3.0, 3.0, 14))


@pytest.mark.parametrize("late", [0.0, 3.217, -12.34, 86_400.5, -1.7e9])
@pytest.mark.parametrize("rate", [37.0, 500.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_shift_is_found_from_a_motion_that_only_touches_at_times(late, rate, sign):
    time, height = presses(3)
    clock = np.arange(-1.0, 32.0, 1.0 / rate)
    force = np.maximum(-np.interp(clock, time, height), 0.0) ** 1.5
    force += 0.02 * np.random.default_rng(1).normal(size=len(force))
    found = clock_shift((time, height), (clock + late, 40.0 + sign * force))
    assert found.is_sure and found.correlation > 0.8
    assert abs(found.late - late) < 0.05


def test_presses_that_repeat_do_not_tell_the_shift():
    time = np.arange(0.0, 30.0, 0.01)
    wave = np.maximum(np.sin(2.0 * np.pi * time), 0.0)
    assert not clock_shift((time, wave), (time + 0.3, wave)).is_sure


def test_what_does_not_change_has_no_shift():
    time, height = presses(0)
    assert clock_shift((time, np.zeros(len(time))), (time, height)) is None
    assert clock_shift((time, height), (time, np.full(len(time), np.nan))) is None
