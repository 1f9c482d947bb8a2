# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests for structure in a residual: does it contain more than noise, and what does it depend on?

Regressions on features of the trials are fitted to some trials and judged on the others. Noise of other trials cannot be
predicted, however coloured it is, as long as each texel has its own. A share of the residual that can be predicted is
structure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..forward.contact_phases import features, missing_readings, relative_load
from ..forward.predictor import Predictor

LEAST_STRUCTURE = 0.03
"""Share of a residual that can be predicted, below which the residual is noise."""


@dataclass(frozen=True)
class ResidualStructure:
    """Share of a residual's mean square that can be predicted.

    Attributes
    ----------
    total : float
        By all features together.
    shares : dict of str to float
        By each group of :data:`~.contact_phases.FEATURES` alone.
    """

    total: float
    shares: dict[str, float]

    @property
    def strongest(self) -> str:
        """The group of features that predicts most."""
        return max(self.shares, key=lambda name: self.shares[name]) if self.shares else ""


def residual_structure(predictors: Sequence[Predictor], residuals: Sequence[np.ndarray]) -> ResidualStructure:
    """Find out on which features residuals depend.

    Parameters
    ----------
    predictors : sequence of Predictor
        Of the trials.
    residuals : sequence of (T, n) float
        In units of the noise; zero if a value is missing.
    """
    if len(predictors) == 1:  # the halves of a single trial serve as two trials
        predictors, residuals, halves = [predictors[0]] * 2, [residuals[0]] * 2, True
    else:
        halves = False
    found = [features(predictor, residual) for predictor, residual in zip(predictors, residuals, strict=True)]
    sizes = {name: len(columns) for groups in found for name, columns in groups.items()}
    folds = []
    for number, (predictor, groups, residual) in enumerate(zip(predictors, found, residuals, strict=True)):
        table = _table(groups, sizes, residual.shape)
        missing = missing_readings(predictor)
        if missing is not None:
            table[:, missing] = 0.0
        part = slice(None)
        if halves:
            middle = len(residual) // 2
            part = slice(None, middle) if number == 0 else slice(middle, None)
        folds.append((table[:, part].reshape(len(table), -1), residual[part]))
    total = sum(float(np.vdot(r, r)) for _, r in folds)
    if total <= 0:
        return ResidualStructure(0.0, dict.fromkeys(sizes, 0.0))
    sums = [(x @ x.T, x @ r.ravel()) for x, r in folds]
    shares, start = {}, 0
    for name, size in sizes.items():
        shares[name] = _share_predicted(folds, sums, np.arange(start, start + size), total)
        start += size
    everything = _share_predicted(folds, sums, np.arange(start), total)
    if residuals[0].shape[1] > 1 and not halves:
        shares["texel"] = _share_predicted_by_texel(predictors, [r for _, r in folds], total)
        everything = 1.0 - (1.0 - max(everything, 0.0)) * (1.0 - max(shares["texel"], 0.0))
    return ResidualStructure(max(everything, *shares.values(), 0.0), {name: max(share, 0.0) for name, share in shares.items()})


def _table(groups: dict[str, np.ndarray], sizes: dict[str, int], shape: tuple[int, ...]) -> np.ndarray:
    """Features of one trial (p, T, n); zero for a group that only other trials have, such as depth beside no contact."""
    return np.concatenate([groups.get(name, np.zeros((size, *shape))) for name, size in sizes.items()])


def _share_predicted(
    folds: list[tuple[np.ndarray, np.ndarray]], sums: list[tuple[np.ndarray, np.ndarray]], use: np.ndarray, total: float
) -> float:
    """Share of the squares that a ridge regression on some features predicts in folds that it has not seen."""
    left = 0.0
    for i, (x, r) in enumerate(folds):
        a = sum((s[0] for j, s in enumerate(sums) if j != i), np.zeros(sums[0][0].shape))[np.ix_(use, use)]
        b = sum((s[1] for j, s in enumerate(sums) if j != i), np.zeros(len(sums[0][1])))[use]
        weights = np.linalg.solve(a + np.diag(1e-3 * np.diag(a) + 1e-9 * (1.0 + np.trace(a))), b)
        miss = r.ravel() - weights @ x[use]
        left += float(np.vdot(miss, miss))
    return 1.0 - left / total


def _share_predicted_by_texel(predictors: Sequence[Predictor], residuals: Sequence[np.ndarray], total: float) -> float:
    """The same for a constant and a gain of each texel."""
    parts = []
    for predictor, r in zip(predictors, residuals, strict=True):
        d, missing = relative_load(predictor.stimulus), missing_readings(predictor)
        known = np.ones(d.shape) if missing is None else (~missing).astype(float)
        d = d * known
        parts.append(np.stack([known.sum(axis=0), d.sum(axis=0), (d * d).sum(axis=0), r.sum(axis=0), (d * r).sum(axis=0)]))
    left = 0.0
    for i, (predictor, r) in enumerate(zip(predictors, residuals, strict=True)):
        one, d1, d2, r1, rd = sum(p for j, p in enumerate(parts) if j != i)
        # Ridge regression: texels that were hardly loaded get small coefficients.
        one, d2 = one * 1.01 + 1.0, d2 * 1.01 + 1.0
        det = one * d2 - d1 * d1
        offset, gain = (d2 * r1 - d1 * rd) / det, (one * rd - d1 * r1) / det
        miss = r - offset - gain * relative_load(predictor.stimulus)
        missing = missing_readings(predictor)
        if missing is not None:
            miss[missing] = 0.0
        left += float(np.vdot(miss, miss))
    return 1.0 - left / total
