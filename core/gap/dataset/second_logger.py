# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings that a second logger recorded, by a clock of its own.

::

    [[trial]]
    file = "press_0.csv"                                                  # what drove the sensor
    readings = { file = "press_0_readings.csv", late = 12.453 }

`late` is how many seconds more the second clock shows at the same moment. The columns of the first file are interpolated at the
times of the second.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ...errors import FileError
from ...io.schema import wanted
from .column_names import TURN
from .trial import LONGEST_TIME

# Missing samples of what drove a sensor: which of them can be interpolated.
#
# A gap is judged by its length against the stimulus, and not by the share of the samples that are missing: every second sample
# may be missing where the stimulus is slow, and a single one is too many within a step. The samples that are there say how long
# a gap may be: each of them is predicted from its neighbours at growing distances, and the longest distance counts at which
# these predictions are good.

MOST_ERROR = 0.03
"""Share of the stimulus's range by which its linear interpolation over a gap may be wrong (95 % quantile, while it moves). Half
of the force samples of eFlesh's presses lack, 0.2 s apart in presses of 15 s; over such gaps the error is 0.5 %."""
MOVES = 0.02
"""Share of the range by which a stimulus must change over a gap to count as moving."""
FEWEST = 8
"""Known samples, and gaps of a length, from which anything is judged."""
ERROR_QUANTILE = 0.95


def longest_gap(time: np.ndarray, values: np.ndarray) -> float:
    """Return how long a gap may be to be interpolated, in seconds.

    Parameters
    ----------
    time, values : (T,) float
        Without missing values.

    Returns
    -------
    float
        Infinite for a stimulus that does not move, and zero where even neighbours do not predict the sample between them.
    """
    span = float(np.ptp(values)) if len(values) else 0.0
    if span <= 0.0 or len(values) < FEWEST:
        return np.inf
    longest, half = 0.0, 1
    while len(values) > 2 * half + FEWEST:
        first, middle, last = values[: -2 * half], values[half:-half], values[2 * half :]
        lengths = time[2 * half :] - time[: -2 * half]
        share = (time[half:-half] - time[: -2 * half]) / lengths
        error = np.abs(middle - (first + share * (last - first)))
        moving = np.ptp([first, middle, last], axis=0) > MOVES * span
        if moving.sum() >= FEWEST and float(np.quantile(error[moving], ERROR_QUANTILE)) > MOST_ERROR * span:
            break
        longest = float(np.median(lengths))
        half *= 2
    return longest


def bridged(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values with the missing ones interpolated where the gap is short enough.

    Parameters
    ----------
    time : (T,) float, s
    values : (T,) float
        NaN where a value is missing.

    Returns
    -------
    (T,) float
        NaN within gaps that are too long, and before the first and after the last known value.
    """
    known = np.isfinite(values)
    if not known.any():
        return values
    times, found = time[known], values[known]
    gap = np.diff(times, prepend=-np.inf, append=np.inf)[np.searchsorted(times, time)]
    filled = np.interp(time, times, found, left=np.nan, right=np.nan)
    return np.where(known | (gap > longest_gap(times, found)), values, filled)


def peak_of(values: np.ndarray) -> tuple[int, float, float]:
    """Return the number of the largest of (n,) values, how far away from it the maximum is, in spacings, and the maximum.

    Both are those of a parabola through three values, unless the largest is at an end.
    """
    top = int(np.argmax(values))
    away = slope = 0.0
    if 0 < top < len(values) - 1:
        before, here, after = values[top - 1 : top + 2]
        bend, slope = before - 2.0 * here + after, 0.5 * (after - before)
        away = -slope / bend if bend < 0.0 else 0.0
    return top, float(away), float(values[top] + 0.5 * slope * away)


@dataclass(frozen=True)
class SecondLogger:
    """The file of a second logger, by its name in the rig.

    Attributes
    ----------
    file : object
        As the rig writes it; it is checked where it is opened.
    late : float, s
        The second clock's time of an event minus the first one's.
    """

    file: Any = None
    late: Annotated[float, wanted("write seconds", ge=-LONGEST_TIME, le=LONGEST_TIME)] = 0.0


def joined(
    first: Mapping[str, np.ndarray], second: Mapping[str, np.ndarray], late: float, files: tuple[Path, Path]
) -> dict[str, np.ndarray]:
    """Return the columns of two loggers at the times of the second, on the clock of the first.

    Parameters
    ----------
    first, second : mapping of str to (T,) ndarray
        With checked `time`, in seconds.
    late : float, s
    files : (Path, Path)
        For messages.

    Raises
    ------
    FileError
        A column is in both, or the recordings do not overlap.
    """
    for name in second:
        if name != "time" and name in first:
            raise FileError(f"Both '{files[0].name}' and '{files[1].name}' have a column '{name}': remove one of them.")
    time = second["time"] - late
    inside = (time >= first["time"][0]) & (time <= first["time"][-1])
    if inside.sum() < 8:
        raise FileError(
            f"'{files[0].name}' and '{files[1].name}' have {int(inside.sum())} samples at the same time with late = {late:g} "
            "s: check late, it is the time of the second clock minus that of the first."
        )
    own = {name: column[inside] for name, column in second.items() if name != "time"}
    return {"time": time[inside], **at_times(first, time[inside]), **own}


def at_times(columns: Mapping[str, np.ndarray], wanted: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of a recording but for `time`, interpolated at other times."""
    steady = with_steady_signs(columns)
    return {name: interpolated(columns["time"], column, wanted) for name, column in steady.items() if name != "time"}


def with_steady_signs(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return columns in which ``qw qx qy qz`` do not jump between the two quaternions of a rotation."""
    found = dict(columns)
    if set(columns) >= set(TURN):
        turns = np.stack([columns[name] for name in TURN])
        flips = np.where((turns[:, 1:] * turns[:, :-1]).sum(axis=0) < 0.0, -1.0, 1.0)
        sign = np.concatenate([[1.0], np.cumprod(flips)])
        found |= {name: columns[name] * sign for name in TURN}
    return found


def interpolated(time: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return values at other times of the recording; missing within gaps that are too long (:func:`bridged`)."""
    return np.interp(wanted, time, bridged(time, values))
