# SPDX-License-Identifier: GPL-3.0-or-later
"""Two methods that learn from simulations what hides in a rig: a classifier, and approximate Bayesian computation.

Both see the features of :mod:`._simulated` and learn from the same simulations, on which their few settings are chosen, too. A
method is a function of the path of a rig that returns names of effects and a probability: no names where nothing is hidden,
:data:`UNKNOWN` where something is that it cannot name.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from ._simulated import LABELS, features, read, simulations

UNKNOWN = ("unknown",)
"""Said where something is hidden and nobody knows what."""


def _said(shares: np.ndarray, threshold: float) -> tuple[tuple[str, ...], float]:
    """Names whose share reaches a threshold, and the probability of just these, as if effects came independently."""
    over = shares >= threshold
    names = tuple(name for name, told in zip(LABELS, over, strict=True) if told and name != "nothing")
    if not names:
        nothing = float(shares[-1])
        return ((), nothing) if over[-1] else (UNKNOWN, 1.0 - nothing)
    effects = shares[:-1]
    return names, float(np.prod(np.where(over[:-1], effects, 1.0 - effects)))


def _threshold(shares: np.ndarray, holds: np.ndarray) -> tuple[float, float]:
    """Return the threshold at which most simulated cases are named exactly, and what share of them is."""
    grid = np.round(np.arange(0.15, 0.75, 0.05), 2)
    exact = [float(((shares >= level)[:, :-1] == holds[:, :-1]).all(axis=1).mean()) for level in grid]
    best = int(np.argmax(exact))
    return float(grid[best]), exact[best]


@functools.lru_cache(maxsize=1)
def _forest() -> tuple[Callable[[np.ndarray], np.ndarray], float]:
    """Trees learnt from the simulations, and the threshold that does best on the trees that have not seen a simulation."""
    try:
        from sklearn.ensemble import ExtraTreesClassifier
    except ImportError:
        raise SystemExit("The classifier needs scikit-learn: install it with `pip install scikit-learn`.") from None
    values, holds = simulations()
    forest = ExtraTreesClassifier(600, min_samples_leaf=2, max_features=0.3, bootstrap=True, oob_score=True, random_state=0)
    varied = holds.any(axis=0) & ~holds.all(axis=0)
    forest.fit(values, holds[:, varied].astype(int))

    def shares(one: np.ndarray) -> np.ndarray:
        found = holds.all(axis=0).astype(float)
        found[varied] = [p[0, 1] for p in forest.predict_proba(one[None])]
        return found

    unseen = holds.astype(float)
    unseen[:, varied] = np.nan_to_num(forest.oob_decision_function_[:, 1, :])
    threshold, exact = _threshold(unseen, holds)
    print(f"classifier: threshold {threshold}, {exact:.0%} of unseen simulations exact", file=sys.stderr, flush=True)
    return shares, threshold


def classifier(rig: Path) -> tuple[tuple[str, ...], float]:
    """Say what extremely randomised trees (Geurts, Ernst and Wehenkel 2006) have learnt from the simulations."""
    shares, threshold = _forest()
    return _said(shares(features(*read(rig))), threshold)


def _spread(values: np.ndarray) -> np.ndarray:
    """(p,) float: the median deviation of each feature, by which distances are measured."""
    spread = np.median(np.abs(values - np.median(values, axis=0)), axis=0)
    return np.where(spread > 1e-6, spread, values.std(axis=0) + 1e-6)


def _votes(one: np.ndarray, values: np.ndarray, spread: np.ndarray, holds: np.ndarray, count: int) -> np.ndarray:
    """(labels,) float: votes of the nearest simulations, the nearer the more (Epanechnikov's kernel: Beaumont et al. 2002)."""
    apart = (np.clip((values - one) / spread, -10.0, 10.0) ** 2).mean(axis=1)
    near = np.argsort(apart)[: count + 1]
    weight = np.maximum(1.0 - apart[near[:-1]] / max(float(apart[near[-1]]), 1e-30), 1e-6)
    votes: np.ndarray = np.clip(weight @ holds[near[:-1]] / weight.sum(), 0.0, 1.0)
    return votes


@functools.lru_cache(maxsize=1)
def _crowd() -> tuple[Callable[[np.ndarray], np.ndarray], float]:
    """Votes of as many simulations, and the threshold, as do best on simulations that are left out."""
    values, holds = simulations()
    spread, numbers = _spread(values), np.arange(len(values))
    best = (0, 0.0, -1.0)
    for count in (4, 8, 16, 32):
        left_out = [_votes(values[i], values[numbers != i], spread, holds[numbers != i], count) for i in numbers]
        threshold, exact = _threshold(np.stack(left_out), holds)
        best = max(best, (count, threshold, exact), key=lambda one: one[2])
    said = f"nearest simulated: {best[0]} vote, threshold {best[1]}, {best[2]:.0%} of unseen simulations exact"
    print(said, file=sys.stderr, flush=True)
    return (lambda one: _votes(one, values, spread, holds, best[0])), best[1]


def nearest_simulated(rig: Path) -> tuple[tuple[str, ...], float]:
    """Approximate Bayesian computation (Beaumont, Zhang and Balding 2002): the nearest simulations vote on what is hidden."""
    shares, threshold = _crowd()
    return _said(shares(features(*read(rig))), threshold)


METHODS: dict[str, Callable[[Path], tuple[Iterable[str], float]]] = {
    "classifier": classifier,
    "nearest simulated": nearest_simulated,
}
