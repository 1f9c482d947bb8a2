# SPDX-License-Identifier: GPL-3.0-or-later
"""How strongly metrics depend on what was varied: rank correlation and mutual information.

The rank correlation (Spearman 1904) sees what rises or falls throughout. The mutual information also sees what rises and falls
again, and names from a choice. It is estimated from equally filled bins, with the bias of empty chance taken off (Miller 1955),
and given as the correlation that two normal variables with the same information would have (Linfoot 1957): 0 to 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

LEAST_RUNS = 8
"""Runs with a value below which nothing is said of a dependency."""
RUNS_PER_CELL, MOST_BINS = 5, 10
"""Runs that a cell of the table of bins should hold on average, and bins at most."""
RUNS_PER_NAME = 2 * RUNS_PER_CELL
"""Runs that each name of a choice needs on average: two bins of enough runs. What comes once tells nothing."""
DETECTED = 1e-3
"""Probability below which a dependency counts as detected: one in a thousand pairs is a false one."""


@dataclass(frozen=True)
class Dependency:
    """Dependency of one metric on one parameter.

    Attributes
    ----------
    parameter, metric : str
    rank_correlation : float or None
        −1 to 1; None for names from a choice.
    information : float
        0 to 1.
    probability : float
        Of what was found, or more, if the metric did not depend on the parameter: the smaller one of the two tests, doubled.
    runs : int
        Runs that have a value of both.
    """

    parameter: str
    metric: str
    rank_correlation: float | None
    information: float
    probability: float
    runs: int

    @property
    def strength(self) -> float:
        """The larger one of the two measures, 0 to 1; 0 for a dependency that was not detected."""
        return max(abs(self.rank_correlation or 0.0), self.information) if self.probability < DETECTED else 0.0


def dependencies(values: Mapping[str, Sequence[Any] | np.ndarray], metrics: Mapping[str, np.ndarray]) -> list[Dependency]:
    """Return the dependencies of all metrics on all parameters, the strongest first.

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
        has_value = np.array([value is not None for value in column]) if is_choice else np.isfinite(column)
        for metric, numbers in metrics.items():
            known = np.isfinite(numbers) & has_value
            kinds = len(set(column[known]))
            is_repeated = not is_choice or RUNS_PER_NAME * kinds <= known.sum()  # else names come too seldom for a test
            if known.sum() >= LEAST_RUNS and is_repeated and kinds > 1 and np.ptp(numbers[known]) > 0:
                found.append(_dependency(parameter, metric, column[known], numbers[known]))
    return sorted(found, key=lambda one: (-one.strength, one.probability, one.metric, one.parameter))


def _dependency(parameter: str, metric: str, column: np.ndarray, numbers: np.ndarray) -> Dependency:
    from scipy.stats import chi2_contingency, spearmanr

    is_choice, count = column.dtype == object, len(column)
    cells = count / RUNS_PER_CELL
    bins = int(np.clip(cells / len(set(column)) if is_choice else np.sqrt(cells), 2, MOST_BINS))
    correlation, probability = None, 1.0
    if is_choice:
        _, place = np.unique(column.astype(str), return_inverse=True)
    else:
        place = _equal_bins(column, bins)
        ranked = spearmanr(column, numbers)
        correlation, probability = float(ranked.statistic), float(ranked.pvalue)
    table = np.zeros((place.max() + 1, bins))
    np.add.at(table, (place, _equal_bins(numbers, bins)), 1)
    table = table[table.any(axis=1)][:, table.any(axis=0)]
    information = 0.0
    if min(table.shape) > 1:
        test = chi2_contingency(table, correction=False, lambda_="log-likelihood")
        excess = max(0.0, (float(test.statistic) - float(test.dof)) / (2 * count))  # nats
        information = float(np.sqrt(1.0 - np.exp(-2.0 * excess)))
        probability = min(probability, float(test.pvalue))
    return Dependency(parameter, metric, correlation, information, min(1.0, probability * (1 if is_choice else 2)), count)


def _equal_bins(numbers: np.ndarray, bins: int) -> np.ndarray:
    """Return the bin of each number, so that bins hold equally many; equal numbers share one."""
    from scipy.stats import rankdata

    return np.minimum(((rankdata(numbers) - 0.5) / len(numbers) * bins).astype(int), bins - 1)
