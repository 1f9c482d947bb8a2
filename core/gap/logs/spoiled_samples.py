# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of a stimulus that the readings contradict: a scale that sticks, zeros within a press, spikes.

The readings predict the stimulus by a map without memory (second degree in their largest principal components, fitted so that
single samples have little weight). A sample is spoiled if it disagrees, and what comes before and after it agrees. What
disagrees for other reasons, as the memory of a sensor, neither begins nor ends at once, and is left alone.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..dataset.trial import runs

COMPONENTS = 4
"""Principal components of the readings that the map takes."""
SAMPLES_PER_TERM = 8
"""Samples that the map needs for each of its terms."""
ROUNDS, HUBER = 25, 2.0
"""Rounds of reweighting, and standard deviations from which on a sample's weight falls (Huber 1964)."""
DISAGREES, LEAST = 8.0, 0.05
"""A sample disagrees if its residual is more than so many standard deviations by the median and than a share of the range."""
AGREES = 0.5
"""Share of that limit below which a sample agrees again."""
LONGEST_SPIKE = 3
"""Samples of a spike. What is longer is spoiled only if its values are equal to the last digit."""
MOST_SPOILED = 0.1
"""Share of a recording's samples up to which they can be spoiled; if more disagree, the map is wrong."""


def stimulus_residual(
    stimulus: tuple[np.ndarray, np.ndarray], readings: tuple[np.ndarray, np.ndarray], late: float = 0.0
) -> np.ndarray | None:
    """Return what the readings do not explain of a stimulus.

    Parameters
    ----------
    stimulus : (times (T,) s, values (T,))
    readings : (times (S,) s, values (S, n))
    late : float, s
        What the second clock shows more than the first.

    Returns
    -------
    (T,) float or None
        NaN where one of them is not known. None if there are too few samples for a map, or nothing changes.
    """
    time, values = stimulus
    clock, answers = readings
    usable = np.isfinite(answers).all(axis=0) & (np.ptp(np.nan_to_num(answers), axis=0) > 0.0)
    answers = answers[:, usable]
    inside = (time + late >= clock[0]) & (time + late <= clock[-1])
    known = np.isfinite(values) & inside
    if not answers.shape[1] or not known.any() or np.ptp(values[known]) <= 0.0:
        return None
    at = np.stack([np.interp(time[known] + late, clock, column) for column in answers.T], axis=1)
    centred = at - at.mean(axis=0)
    left, size, _ = np.linalg.svd(centred, full_matrices=False)
    count = int(min(COMPONENTS, (size > 1e-9 * size[0]).sum()))
    parts = left[:, :count] * np.sqrt(len(left))
    terms = [np.ones(len(parts)), *parts.T, *(parts[:, i] * parts[:, j] for i in range(count) for j in range(i, count))]
    if len(parts) < SAMPLES_PER_TERM * len(terms):
        return None
    found = np.full(len(values), np.nan)
    found[known] = _robust_residual(np.stack(terms, axis=1), values[known])
    return found


def _robust_residual(terms: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Residual of a linear fit with the weights of Huber."""
    weight = np.ones(len(values))
    residual = values
    for _ in range(ROUNDS):
        solution = np.linalg.lstsq(terms * weight[:, None], values * weight, rcond=None)[0]
        residual = values - terms @ solution
        scale = _scale(residual)
        weight = np.sqrt(np.minimum(1.0, HUBER * scale / np.maximum(np.abs(residual), 1e-300)))
    return residual


def _scale(residual: np.ndarray) -> float:
    """Standard deviation of most of the residuals."""
    return 1.4826 * float(np.median(np.abs(residual - np.median(residual))))


def spoiled_samples(
    stimulus: tuple[np.ndarray, np.ndarray], readings: tuple[np.ndarray, np.ndarray], late: float = 0.0
) -> np.ndarray:
    """Return which samples of a stimulus are spoiled, (T,) bool; the parameters are those of :func:`stimulus_residual`."""
    _, values = stimulus
    spoiled = np.zeros(len(values), bool)
    residual = stimulus_residual(stimulus, readings, late)
    if residual is None:
        return spoiled
    at = np.flatnonzero(np.isfinite(residual))
    error, value = np.abs(residual[at]), values[at]
    limit = max(DISAGREES * _scale(error), DISAGREES * _scale(residual[at]), LEAST * float(np.ptp(value)))
    for begin, end in runs(error > limit):
        while begin > 0 and value[begin - 1] == value[begin]:
            begin -= 1
        while end < len(value) and value[end] == value[end - 1]:
            end += 1
        if begin == 0 or end == len(value):
            continue
        is_clear = error[begin - 1] < AGREES * limit and error[end] < AGREES * limit and error[end - 1] > limit
        if is_clear and (_is_spike(value, begin, end) or (end - begin > 1 and (value[begin:end] == value[begin]).all())):
            spoiled[at[begin:end]] = True
    return spoiled if spoiled.sum() <= MOST_SPOILED * len(at) else np.zeros(len(values), bool)


def _is_spike(value: np.ndarray, begin: int, end: int) -> bool:
    """True if a few samples leave the way between those before and after them."""
    if end - begin > LONGEST_SPIKE:
        return False
    before, after = float(value[begin - 1]), float(value[end])
    away = np.abs(value[begin:end] - 0.5 * (before + after))
    return bool(abs(after - before) < float(away.min()))


def readings_of(table: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return the readings of a table of columns, (T, n); None without any."""
    names = [name for name in table if name.startswith("texel_")]
    return np.stack([table[name] for name in names], axis=1) if names else None
