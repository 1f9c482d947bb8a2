# SPDX-License-Identifier: GPL-3.0-or-later
"""How strongly metrics depend on what was varied: rank correlation and mutual information.

The rank correlation (Spearman 1904) sees what rises or falls throughout. The mutual information also sees what rises and falls
again, and names from a choice. It is estimated from equally filled bins, with the bias of empty chance taken off (Miller 1955),
and given as the correlation that two normal variables with the same information would have (Linfoot 1957): 0 to 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

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


def dependencies(values: Mapping[str, Sequence[object]], metrics: Mapping[str, np.ndarray]) -> list[Dependency]:
    """Return the dependencies of all metrics on all parameters, the strongest first.

    Parameters
    ----------
    values : mapping of str to (n,) sequence
        What was varied: numbers or texts; None for a run without the parameter.
    metrics : mapping of str to (n,) float
        NaN for a run in which the metric has no value.
    """
    found = []
    for parameter, column in values.items():
        for metric, numbers in metrics.items():
            known = np.isfinite(numbers) & np.array([value is not None for value in column], bool)
            own = [value for value, is_known in zip(column, known) if is_known]
            if len(own) >= LEAST_RUNS and _is_repeated(own) and len(set(own)) > 1 and np.ptp(numbers[known]) > 0:
                found.append(_dependency(parameter, metric, own, numbers[known]))
    return sorted(found, key=lambda one: (-one.strength, one.probability, one.metric, one.parameter))


def _is_repeated(own: Sequence[object]) -> bool:
    """Return False for names that come too seldom for a test."""
    return not _are_names(own) or RUNS_PER_NAME * len(set(own)) <= len(own)


def _are_names(own: Sequence[object]) -> bool:
    return any(isinstance(value, str) for value in own)


def _dependency(parameter: str, metric: str, own: list[object], numbers: np.ndarray) -> Dependency:
    from scipy.stats import chi2_contingency, spearmanr

    is_text = _are_names(own)
    cells = len(own) / RUNS_PER_CELL
    bins = int(np.clip(cells / len(set(own)) if is_text else np.sqrt(cells), 2, MOST_BINS))
    correlation, probability = None, 1.0
    if is_text:
        _, place = np.unique([str(value) for value in own], return_inverse=True)
    else:
        column = np.array(own, dtype=float)
        place = _equal_bins(column, bins)
        ranked = spearmanr(column, numbers)
        correlation, probability = float(ranked.statistic), float(ranked.pvalue)
    table = np.zeros((place.max() + 1, bins))
    np.add.at(table, (place, _equal_bins(numbers, bins)), 1)
    table = table[table.any(axis=1)][:, table.any(axis=0)]
    information = 0.0
    if min(table.shape) > 1:
        test = chi2_contingency(table, correction=False, lambda_="log-likelihood")
        excess = max(0.0, (float(test.statistic) - float(test.dof)) / (2 * len(own)))  # nats
        information = float(np.sqrt(1.0 - np.exp(-2.0 * excess)))
        probability = min(probability, float(test.pvalue))
    return Dependency(parameter, metric, correlation, information, min(1.0, probability * (1 if is_text else 2)), len(own))


def _equal_bins(numbers: np.ndarray, bins: int) -> np.ndarray:
    """Return the bin of each number, so that bins hold equally many; equal numbers share one."""
    from scipy.stats import rankdata

    return np.minimum(((rankdata(numbers) - 0.5) / len(numbers) * bins).astype(int), bins - 1)
