# SPDX-License-Identifier: GPL-3.0-or-later
"""How often the clocks of two loggers are aligned by correlation, how often wrongly, and how often those of unrelated files.

An indenter presses six times at random, at random speeds and depths, within 50 s; another logger with a clock and a rate of its
own records a force that goes with the depth or its 3/2-th power, with noise. Cases are numbered from PALPATE_CLOCKS_FIRST
(1000) on; those below 1000 may be looked at.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np

CASES, PRESSES, SECONDS, RATE = 100, 6, 60.0, 100.0
NOISES = (0.02, 0.1, 0.3)
"""Deviation of the noise in units of the largest force."""
MANY_ERRORS, LEAST_MISS = 4.0, 0.05
"""A shift is wrong from so many standard errors and so many seconds on."""


def run() -> Iterator[dict]:
    """Yield how many of the cases are aligned, how many of these wrongly, and how many pairs of unrelated recordings are."""
    first = int(os.environ.get("PALPATE_CLOCKS_FIRST", "1000"))
    numbers = range(first, first + CASES)
    for noise in NOISES:
        found = [_aligned(number, noise) for number in numbers]
        for what, count in (("aligned", len(found) - found.count(None)), ("wrong", found.count(False))):
            yield {"name": f"clock_alignment.noise_{noise:g}.{what}", "value": count, "unit": f"of {CASES}"}
    unrelated = sum(_unrelated_are_aligned(number) for number in numbers)
    yield {"name": "clock_alignment.unrelated.aligned", "value": unrelated, "unit": f"of {CASES}"}


def _aligned(number: int, noise: float) -> bool | None:
    """Whether the shift of a case is right; None if it is not sure."""
    from palpate.core.gap.logs.clock_alignment import clock_shift

    rng = np.random.default_rng(number)
    time, height = _presses(rng)
    clock, force = _answer(rng, time, height, noise)
    late = rng.uniform(-20.0, 20.0)
    found = clock_shift((time, height), (clock + late, force))
    if found is None or not found.is_sure:
        return None
    miss = abs(found.late - late)
    return not (miss > MANY_ERRORS * found.uncertainty and miss > LEAST_MISS)


def _unrelated_are_aligned(number: int) -> bool:
    """Whether one recording's motion and another one's force are taken for the same."""
    from palpate.core.gap.logs.clock_alignment import clock_shift

    rng = np.random.default_rng(number)
    time, height = _presses(rng)
    found = clock_shift((time, height), _answer(rng, *_presses(rng), NOISES[0]))
    return found is not None and found.is_sure


def _presses(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and heights of an indenter (mm), which presses below zero."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE)
    starts = np.sort(rng.uniform(3.0, 50.0, PRESSES)) + 1.2 * np.arange(PRESSES)
    knots = [(0.0, 3.0)]
    for start in starts:
        deep, ramp = rng.uniform(0.5, 2.0), rng.uniform(0.1, 0.4)
        begin = max(float(start), knots[-1][0] + 0.05)
        hold = rng.uniform(0.05, 0.4)
        knots += [(begin, 3.0), (begin + ramp, -deep), (begin + ramp + hold, -deep), (begin + 2.0 * ramp + hold, 3.0)]
    table = np.array(knots)
    return time, np.interp(time, table[:, 0], table[:, 1])


def _answer(rng: np.random.Generator, time: np.ndarray, height: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of another logger, and the force that it records."""
    rate = rng.uniform(30.0, 300.0)
    clock = np.arange(-rng.uniform(0.0, 3.0), SECONDS + 2.0, 1.0 / rate)
    force = np.maximum(-np.interp(clock, time, height), 0.0) ** rng.choice([1.0, 1.5])
    force /= force.max()
    return clock, force + noise * rng.normal(size=len(force))
