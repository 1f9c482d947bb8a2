# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of files without a header: what drove a sensor is known by how its columns behave.

A clock rises steadily. A column that does not move is a setting. A force is zero without contact, never falls clearly below it,
and rests there now and then; what moves otherwise is a place of the indenter.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

ROUNDING = 1e-6
"""Share of the size of a column up to which its changes are rounding: numbers of 32 bits have 6e-8, sums of them more."""
ZERO, RESTS, BELOW = 0.02, 0.05, 0.05
"""A force is within the first share of its range of zero for at least the second share of its samples, and not below zero by
more than the third."""
STEADY = 0.9999
"""Correlation with the clock from which on a column that rises counts samples or is a clock, too."""
ORDERED = 0.5
"""Correlation of a load with itself one sample later below which the samples are points in no order."""
ONE_ROW_PITCH = 0.01
"""Metres between channels whose places no log has, in one row. All of them share the force, so it has no influence on it."""


def is_unnamed(names: Sequence[str]) -> bool:
    """Return True if the columns of a table have no names but numbers."""
    return all(re.fullmatch(r"column_\d+", name) for name in names)


def is_steady(time: np.ndarray, values: np.ndarray) -> bool:
    """Return True if values rise with the clock in a line: a second clock, or a number of samples."""
    known = np.isfinite(time) & np.isfinite(values)
    if known.sum() < 8 or not (np.diff(values[known]) > 0.0).all():
        return False
    return float(np.corrcoef(time[known], values[known])[0, 1]) > STEADY


def moves(values: np.ndarray) -> bool:
    """Return True if values change by more than rounding."""
    known = values[np.isfinite(values)]
    return len(known) > 0 and float(np.ptp(known)) > ROUNDING * float(np.abs(known).max())


def is_force(values: np.ndarray) -> bool:
    """Return True if values behave as a force of contact."""
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, [0.1, 99.9])
    span = float(high - low)
    return bool(span > 0.0 and low > -BELOW * span and (np.abs(known) < ZERO * span).mean() > RESTS)


def names_of_what_drove(columns: Mapping[str, np.ndarray]) -> dict[str, tuple[str, str]]:
    """Return what the columns of an unnamed logger beside the sensor are, without its clocks.

    Parameters
    ----------
    columns : mapping of str to (T,) float
        Without the clocks, in the order of the file.

    Returns
    -------
    dict of str to (str, str)
        Quantity and reason of each column that is one; empty if the columns do not tell.
    """
    moving = {name: values for name, values in columns.items() if moves(values)}
    forces = [name for name, values in moving.items() if is_force(values)]
    places = [name for name in moving if name not in forces]
    if len(forces) == 1:
        others = f", so {', '.join(places)} {'is' if len(places) == 1 else 'are'} not needed" if places else ""
        return {forces[0]: ("force", f"it is zero without contact and never below{others}")}
    if not forces and len(places) == 3:
        return {name: (axis, "it is one of three columns that move") for name, axis in zip(places, "xyz", strict=True)}
    if not forces and len(places) == 1:
        return {places[0]: ("z", "it is the only column that moves")}
    return {}


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Return the correlation of two columns where both are known, without its sign; 0 if one does not change."""
    known = np.isfinite(one) & np.isfinite(other)
    if known.sum() < 8 or np.ptp(one[known]) == 0.0 or np.ptp(other[known]) == 0.0:
        return 0.0
    return abs(float(np.corrcoef(one[known], other[known])[0, 1]))


def is_unordered(load: np.ndarray) -> bool:
    """Return True if a load jumps from sample to sample, as in a table of calibration points."""
    known = load[np.isfinite(load)]
    return len(known) >= 16 and float(np.ptp(known)) > 0.0 and float(np.corrcoef(known[:-1], known[1:])[0, 1]) < ORDERED


def contact_of(values: np.ndarray) -> float:
    """Return how far values, averaged over five samples, leave their noise from sample to sample, in units of that."""
    known = values[np.isfinite(values)]
    if len(known) < 8:
        return 0.0
    noise = 1.4826 * float(np.median(np.abs(np.diff(known)))) / np.sqrt(2.0)
    span = float(np.ptp(np.convolve(known, np.full(5, 0.2), mode="valid")))
    return np.inf if span > 0.0 and noise == 0.0 else span / noise if noise else 0.0
