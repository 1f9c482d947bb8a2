# SPDX-License-Identifier: GPL-3.0-or-later
"""Tell wear from drift where recordings differ by their gains: gains that fall with use, or with the clock.

Gains that change once, from one recording on, go with neither: nothing in the recordings says what changed. The pauses between
the recordings are not known. So gains that fall by as much from each recording to the next go with the clock
if the recordings load the sensor unequally, and gains that fall most where most was pressed go with use. Recordings that load
the sensor alike tell nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from ..forward.stimulus import Stimulus

USE, CLOCK, TEXELS, NOTHING = "use", "clock", "texels", ""
"""What tells whether gains that fall are wear: loads of whole recordings, their order, loads of single texels, nothing."""
LEAST_GAINS = 4
"""Number of gains from which on a course is seen in them: a line has two numbers."""
CHANCE = 0.05
"""Chance with which one of two courses that are equally wrong may leave as much less (quantile of the F distribution). Of 3,000
simulated series of gains that fall with time, with pauses or with neither known, 19 are said to go with use."""
UNRESOLVED_SHARE = 0.001
"""Share of the squares of the gains that counts as left at least: neither measure of use is quite that of the sensor."""
BENT_FROM = 6
"""Number of gains from which on a course is a parabola and no line: what is lost may slow down."""
POWERS = (0.5, 1.0)
"""Powers of a measure along which gains fall."""


LEAST_RATIO_OF_LOADS = 2.0
"""Least ratio of what the more and the less loaded texels carried (90th and 10th percentile) from which on texels can tell.

Under equal loads the wear of each texel is a gain that all share: two formulas are compared, not wear and drift, and of six
sets of recordings under a plate that were alike three were called drift for it (``make bench ONLY=wear_or_drift``).
"""


def texels_can_tell(order: Sequence[Stimulus]) -> bool:
    """Return whether wear would change texels differently: some carried far more than others over all recordings."""
    rises = sum(np.maximum(np.diff(one.load, axis=0), 0.0).sum(axis=0) for one in order)
    used = np.atleast_1d(rises)[np.atleast_1d(rises) > 0.0]
    if len(used) < 2:
        return False
    low, high = np.percentile(used, [10.0, 90.0])
    return bool(high >= LEAST_RATIO_OF_LOADS * low)


def evidence_of_recordings(order: Sequence[Stimulus], gains: dict[str, float]) -> str:
    """Return whether gains of recordings follow use or clock, as :func:`evidence_of_courses` does.

    Parameters
    ----------
    order : sequence of Stimulus
        Of all recordings, in the order of the rig; what is only checked uses the sensor as well.
    gains : dict of str to float
        Of those recordings that were fitted.
    """
    return evidence_of_courses(*_courses(order, gains))


def changed_from(order: Sequence[Stimulus], gains: dict[str, float]) -> str:
    """Return the recording from which on gains are others, if they change once and neither with use nor clock; else empty.

    Parameters
    ----------
    order, gains
        As of :func:`evidence_of_recordings`.
    """
    first = change_of_level(*_courses(order, gains))
    return "" if first is None else [one.trial.name for one in order if one.trial.name in gains][first]


def _courses(order: Sequence[Stimulus], gains: dict[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gains in the order of the recordings, and measures of use and of time at each of them."""
    chosen = [i for i, one in enumerate(order) if one.trial.name in gains]
    lengths = [float(np.ptp(one.time)) for one in order]
    rises = [float(np.maximum(np.diff(one.load, axis=0), 0.0).sum()) for one in order]
    impulses = [float((np.diff(one.time)[:, None] * (one.load[1:] + one.load[:-1])).sum(axis=0).sum()) / 2.0 for one in order]
    pauses = [1.0] * len(order)
    same = float(np.mean(lengths))
    clocks = [pauses, lengths, [length + same for length in lengths]]
    values = np.array([gains[order[i].trial.name] for i in chosen])
    uses, times = (np.array([_middles(one)[chosen] for one in several]) for several in ([rises, impulses], clocks))
    return values, uses, times


def _middles(amounts: Sequence[float]) -> np.ndarray:
    """What has gathered up to the middle of each recording, in shares of the whole."""
    each = np.array(amounts)
    found: np.ndarray = (np.cumsum(each) - 0.5 * each) / max(float(each.sum()), 1e-300)
    return found


def evidence_of_courses(gains: np.ndarray, uses: np.ndarray, clocks: np.ndarray) -> str:
    """Return what gains that fall go with.

    Parameters
    ----------
    gains : (n,) float
        Above zero, in the order of the recordings.
    uses, clocks : (m, n) float
        Measures of what was loaded before, and of the time that has passed, at each gain.

    Returns
    -------
    str
        :data:`USE`, :data:`CLOCK`, or :data:`NOTHING` where neither leaves far less than the other one.
    """
    if len(gains) < LEAST_GAINS or not (gains > 0.0).all():
        return NOTHING
    by_use, by_clock = (_least_left(gains, courses) for courses in (uses, clocks))
    least = _least_ratio(len(gains))
    if by_use < least * by_clock:
        return USE
    return CLOCK if by_clock < least * by_use else NOTHING


def change_of_level(gains: np.ndarray, uses: np.ndarray, clocks: np.ndarray) -> int | None:
    """Return the number of the first gain after a change, if two levels leave far less than any course; else None.

    Parameters
    ----------
    gains, uses, clocks
        As of :func:`evidence_of_courses`. Two levels and the place of the change are as many numbers as a parabola has.
    """
    if len(gains) < LEAST_GAINS or not (gains > 0.0).all():
        return None
    logs = np.log(gains)
    left = [float(sum(((part - part.mean()) ** 2).sum() for part in np.split(logs, [i]))) for i in range(1, len(logs))]
    share = max(min(left) / max(float(((logs - logs.mean()) ** 2).sum()), 1e-300), UNRESOLVED_SHARE)
    by_course = min(_least_left(gains, uses), _least_left(gains, clocks))
    return int(np.argmin(left)) + 1 if share < _least_ratio(len(gains)) * by_course else None


def _least_ratio(count: int) -> float:
    """Ratio of what two courses leave of so many gains below which it is no chance."""
    from scipy.special import fdtri

    free = count - (2 if count < BENT_FROM else 3)
    return float(fdtri(free, free, CHANCE))


def _least_left(gains: np.ndarray, courses: np.ndarray) -> float:
    """What the best of some courses leaves."""
    return min(_left_share(gains, one**power) for one, power in product(courses, POWERS))


def _left_share(gains: np.ndarray, course: np.ndarray) -> float:
    """Share of the squares of the gains' logarithms about their mean that a line or parabola along a course leaves."""
    logs = np.log(gains)
    along = np.polynomial.Polynomial.fit(course, logs, 1 if len(gains) < BENT_FROM else 2)
    left = float(((logs - along(course)) ** 2).sum()) / max(float(((logs - logs.mean()) ** 2).sum()), 1e-300)
    return max(left, UNRESOLVED_SHARE)
