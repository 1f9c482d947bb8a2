# SPDX-License-Identifier: GPL-3.0-or-later
"""The check recordings decide: does an amended model also close the gap in recordings that were never fitted?

A fit can close the gap of the recordings that it has seen and still describe nothing but how these differ from each other. The
check recordings tell: there the amended model has to close at least half of the gap, and in none of them may it be worse than
the base model by more than the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..fitting.least_squares import TrialView
from ..forward.predictor import Model, Predictor
from .gap_sizes import FORCES, READINGS, GapSizes

LEAST_CHECK_GAP, LEAST_CHECK_SHARE = 0.1, 0.02
"""Least gap of the check recordings that can be judged: in units of the noise's variance, and as a share of the gap of the
fitted recordings. A smaller one does not show the effects: the rest of it is the difference of the noise from recording to
recording."""
CHECK_CLOSED = 0.5
"""Least share of the gap of the check recordings that the amended model must close."""
LARGEST_RISE, LARGEST_RISE_SHARE = 0.25, 0.02
"""Largest rise of a recording's mean square that counts as noise: in units of the noise's variance, and as a share of the mean
square before. Together with two standard errors of the difference."""
STANDARD_ERRORS = 2.0


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
        Largest rise of the mean squares that the noise explains.
    """

    name: str
    before: np.ndarray
    after: np.ndarray
    count: np.ndarray
    rise: np.ndarray

    def is_worse(self, quantity: int) -> bool:
        """Return whether readings or forces are predicted worse by more than their noise."""
        return bool(self.count[quantity] > 0 and self.after[quantity] > self.before[quantity] + self.rise[quantity])


@dataclass(frozen=True)
class CheckOutcome:
    """Comparison of an amended model with the check recordings.

    Attributes
    ----------
    recordings : tuple of CheckedRecording
    closed : (float or None, float or None)
        Share of the gap of the check recordings that the model closes, for readings and forces. Negative if the gap grows. None
        if there are no check recordings, or if they do not show the gap.
    """

    recordings: tuple[CheckedRecording, ...] = ()
    closed: tuple[float | None, float | None] = (None, None)

    def refutes(self, quantity: int) -> bool:
        """Return whether the amended model fails on readings or forces of the check recordings."""
        share = self.closed[quantity]
        return (share is not None and share < CHECK_CLOSED) or any(one.is_worse(quantity) for one in self.recordings)

    @property
    def is_refuted(self) -> bool:
        """True if the amended model fails on readings or forces."""
        return self.refutes(READINGS) or self.refutes(FORCES)

    @property
    def worst(self) -> CheckedRecording | None:
        """The recording that speaks most clearly against the amended model; None if none does."""

        def against(one: CheckedRecording) -> float:
            shares = [one.after[q] / max(one.before[q], 1e-300) for q in (READINGS, FORCES) if self.refutes(q) and one.count[q]]
            return max(shares, default=0.0)

        worse = [one for one in self.recordings if one.is_worse(READINGS) or one.is_worse(FORCES)]
        return max(worse or self.recordings, key=against) if self.is_refuted else None


def check_views(predictors: Sequence[Predictor], noise: tuple[float, float]) -> list[TrialView]:
    """Return views of the check recordings among some trials; `noise` are the deviations of readings and forces."""
    return [TrialView(p, noise=noise) for p in predictors if p.trial.use == "check"]


def checked(
    views: Sequence[TrialView], base: Model, amended: Model, gap_sizes: GapSizes, memory: tuple[float, float] = (1.0, 1.0)
) -> CheckOutcome:
    """Hold an amended model against the base model in recordings that were never fitted.

    Parameters
    ----------
    views : sequence of TrialView
        Of the check recordings.
    base, amended : Model
    gap_sizes : GapSizes
        Of the fitted recordings.
    memory : (float, float)
        Correlation time of the noise of readings and of forces, in samples.
    """
    recordings = tuple(checked_recording(view, base, amended, gap_sizes, memory) for view in views)
    count = np.sum([one.count for one in recordings], axis=0) if recordings else np.zeros(2)
    if not count.any():
        return CheckOutcome(recordings)
    before, after = (
        np.sum([getattr(one, name) * one.count for one in recordings], axis=0) / np.maximum(count, 1)
        for name in ("before", "after")
    )
    closed = [_closed(before[q], after[q], gap_sizes, q) if count[q] else None for q in (READINGS, FORCES)]
    return CheckOutcome(recordings, (closed[READINGS], closed[FORCES]))


def _closed(before: float, after: float, gap_sizes: GapSizes, quantity: int) -> float | None:
    """Share of the gap that is closed, noise removed; None if there is no gap to speak of."""
    noise = float(gap_sizes.noise[quantity])
    gap = before - noise
    least = max(LEAST_CHECK_GAP * noise, LEAST_CHECK_SHARE * gap_sizes.gap(quantity))
    if not gap_sizes.has_gap(quantity) or gap < (least if quantity == gap_sizes.main_quantity else noise):
        return None
    return float(min((before - after) / gap, 1.0))


def checked_recording(
    view: TrialView, base: Model, amended: Model, gap_sizes: GapSizes, memory: tuple[float, float]
) -> CheckedRecording:
    """Return how a base model and an amended one do in one recording; the arguments are those of :func:`checked`."""
    residuals = view.residual(base), view.residual(amended)
    count = view.counts.astype(float)
    before, after, apart = (view.squares(r) / np.maximum(count, 1.0) for r in (*residuals, residuals[0] - residuals[1]))
    # The difference of two squares is d² - 2 r d: the noise of r is the only chance in it.
    error = 2.0 * np.sqrt(gap_sizes.noise * np.maximum(memory, 1.0) * apart / np.maximum(count, 1.0))
    rise = LARGEST_RISE * gap_sizes.noise + LARGEST_RISE_SHARE * before + STANDARD_ERRORS * error
    return CheckedRecording(view.predictor.trial.name, before, after, count, rise)
