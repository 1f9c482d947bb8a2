# SPDX-License-Identifier: GPL-3.0-or-later
"""How the amended model does in recordings that were never fitted, one by one.

They choose no effect. One that is predicted worse than by the base model, or worse than the fitted recordings are, refutes the
amended model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.quantities import FORCES, READINGS
from .blocks import Blocks
from .rule_numbers import SIGNIFICANT_ERRORS
from .score import Hypothesis, Score


@dataclass(frozen=True)
class CheckedRecording:
    """How two models do in one recording that was never fitted.

    Attributes
    ----------
    name : str
    before, after : (2,) float
        Mean squares of the residuals of the base model and of the amended one, for readings and net forces, in units of the
        noise's variance.
    count : (2,) float
        Number of measured values.
    rise : (2,) float
        Largest rise of the mean squares that noise and the error of formulas explain.
    fitted : (2,) float
        What the amended model leaves on unseen stretches of the fitted recordings.
    """

    name: str
    before: np.ndarray
    after: np.ndarray
    count: np.ndarray
    rise: np.ndarray
    fitted: np.ndarray

    def is_worse(self, quantity: int) -> bool:
        """Return whether readings or forces are predicted worse than by the base model, or than in the fitted recordings."""
        most = min(self.before[quantity], self.fitted[quantity]) + self.rise[quantity]
        return bool(self.count[quantity] > 0 and self.after[quantity] > most)


@dataclass(frozen=True)
class CheckOutcome:
    """What the check recordings say of an amended model."""

    recordings: tuple[CheckedRecording, ...] = ()

    def refutes(self, quantity: int) -> bool:
        """Return whether the amended model fails on readings or forces of a check recording."""
        return any(one.is_worse(quantity) for one in self.recordings)

    @property
    def is_refuted(self) -> bool:
        """True if the amended model fails on readings or forces."""
        return self.refutes(READINGS) or self.refutes(FORCES)

    @property
    def worst(self) -> CheckedRecording | None:
        """The recording that speaks most clearly against the amended model; None if none does."""
        worse = [one for one in self.recordings if one.is_worse(READINGS) or one.is_worse(FORCES)]
        return max(worse, key=lambda one: float((one.after / np.maximum(one.before, 1e-300)).max()), default=None)


def checked(blocks: Blocks, score: Score, base: Hypothesis, best: Hypothesis) -> CheckOutcome:
    """Hold the amended model against the base model, and against the fitted recordings, in each check recording."""
    allowed = score.noise.error + score.parts(best)[1][0]
    views, found, is_fitted = blocks.views, [], blocks.recording < len(blocks.views.fitted)
    fitted = best.sums.left[is_fitted].sum(axis=0) / np.maximum(blocks.count[is_fitted].sum(axis=0), 1.0)
    for number, view in enumerate(views.check, start=len(views.fitted)):
        own = blocks.recording == number
        before, after, count = base.sums.left[own], best.sums.left[own], blocks.count[own]
        total = np.maximum(count.sum(axis=0), 1.0)
        apart = after - before - count * ((after - before).sum(axis=0) / total)
        error = np.sqrt((apart**2).sum(axis=0)) / total
        rise = SIGNIFICANT_ERRORS * error + allowed
        squares = before.sum(axis=0) / total, after.sum(axis=0) / total
        found.append(CheckedRecording(view.predictor.trial.name, *squares, count.sum(axis=0), rise, fitted))
    return CheckOutcome(tuple(found))
