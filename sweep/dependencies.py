# SPDX-License-Identifier: GPL-3.0-or-later
"""How strongly metrics depend on what was varied, by two tests of ranks.

The rank correlation (Spearman 1904) sees what rises or falls throughout. The ranks of groups of runs (Kruskal and Wallis 1952)
also see what rises and falls again, and names from a choice: groups are the runs of a name, or of neighbouring values of a
number. The strength is the root of the share of the ranks' variance between the groups, without that of chance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

LEAST_RUNS = 8
"""Runs with a value below which nothing is said of a dependency."""
RUNS_PER_GROUP, MOST_GROUPS = 10, 10
"""Runs of a group of values, and groups at most. Each name of a choice needs as many runs on average."""
DETECTED = 1e-3
"""Probability below which a dependency counts as detected: one in a thousand pairs is a false one."""


@dataclass(frozen=True)
class Dependency:
    """Detected dependency of one metric on one parameter.

    Attributes
    ----------
    parameter, metric : str
    rank_correlation : float or None
        −1 to 1; None for names from a choice.
    strength : float
        0 to 1.
    runs : int
        Runs that have a value of both.
    """

    parameter: str
    metric: str
    rank_correlation: float | None
    strength: float
    runs: int


def is_known(values: np.ndarray) -> np.ndarray:
    """Return where (n,) numbers are finite, or where texts are not None: (n,) bool."""
    if values.dtype == object:
        return np.array([value is not None for value in values], bool)
    return np.isfinite(values)


def dependencies(values: Mapping[str, Sequence[Any] | np.ndarray], metrics: Mapping[str, np.ndarray]) -> list[Dependency]:
    """Return the dependencies of metrics on parameters that are detected, the strongest first.

    Parameters
    ----------
    values : mapping of str to (n,) sequence
        Varied values, numbers or texts; None for a run without the parameter.
    metrics : mapping of str to (n,) float
        NaN for a run in which the metric has no value.
    """
    found = []
    for parameter, given in values.items():
        is_choice = any(isinstance(value, str) for value in given)
        column = np.asarray(given, object if is_choice else float)
        for metric, numbers in metrics.items():
            known = np.isfinite(numbers) & is_known(column)
            kinds = len(np.unique(column[known]))
            is_repeated = not is_choice or RUNS_PER_GROUP * kinds <= known.sum()  # else names come too seldom for a test
            if known.sum() >= LEAST_RUNS and is_repeated and kinds > 1 and np.ptp(numbers[known]) > 0:
                correlation, strength, probability = _tests(column[known], numbers[known])
                if probability < DETECTED:
                    found.append(Dependency(parameter, metric, correlation, strength, int(known.sum())))
    return sorted(found, key=lambda one: (-one.strength, one.metric, one.parameter))


def _tests(column: np.ndarray, numbers: np.ndarray) -> tuple[float | None, float, float]:
    """Return rank correlation, strength, and the probability of what was found, or more, without a dependency."""
    from scipy.stats import kruskal, rankdata, spearmanr

    if column.dtype == object:
        _, place = np.unique(column, return_inverse=True)
    else:
        groups = np.clip(len(column) // RUNS_PER_GROUP, 2, MOST_GROUPS)
        place = ((rankdata(column) - 0.5) / len(column) * groups).astype(int)  # equal numbers share a group
    apart = [numbers[place == group] for group in np.unique(place)]
    test = kruskal(*apart) if len(apart) > 1 else None
    between = 0.0 if test is None else (float(test.statistic) - len(apart) + 1) / (len(column) - len(apart))
    strength, probability = float(np.sqrt(np.clip(between, 0.0, 1.0))), 1.0 if test is None else float(test.pvalue)
    if column.dtype == object:
        return None, strength, probability
    ranked = spearmanr(column, numbers)
    correlation = float(ranked.statistic)
    return correlation, max(strength, abs(correlation)), 2 * min(probability, float(ranked.pvalue))
