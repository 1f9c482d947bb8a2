# SPDX-License-Identifier: GPL-3.0-or-later
"""How sure one may be that a kind is told from another one, and what recordings have to contain for it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..fitting.noise_floor import coverage
from ..forward.predictor import Predictor
from ..kinds.distinguishability import Distinction
from ..selection.identifiability import indistinguishable, unidentifiable

EVEN_MARGIN, STEEPNESS = 0.3, 1.0
"""Margin at which a kind is told in half of the cases, and how the odds grow with the margin. Chosen by eye."""
LEAST_MARGIN = 1e-3
"""Smaller margins count as this."""
NOT_SHOWN = 0.2
"""Largest sureness without what a kind is known by: the workflow then names none of both, however well one fits. By eye."""


@dataclass(frozen=True)
class Outlook:
    """What becomes of one question.

    Attributes
    ----------
    distinction : Distinction
    is_shown : bool
        True if the recordings contain what the kind that acts is known by, such as an unloading, or a second place.
    """

    distinction: Distinction
    is_shown: bool

    @property
    def kind(self) -> str:
        """The kind that acts."""
        return self.distinction.signal.split("/")[0]

    @property
    def other(self) -> str:
        """The kind that it may be taken for."""
        return self.distinction.other

    @property
    def is_told(self) -> bool:
        """True if an effect of a usual size is distinguishable from the other kind."""
        return self.is_shown and self.distinction.is_told

    @property
    def sureness(self) -> float:
        """How probably the kind is told from the other one: of three cases with a margin of 0.6, about two."""
        odds = (max(self.distinction.margin, LEAST_MARGIN) / EVEN_MARGIN) ** STEEPNESS
        sure = float(odds / (1.0 + odds))
        return sure if self.is_shown else min(sure, NOT_SHOWN)


def outlooks(distinctions: Iterable[Distinction], predictors: Sequence[Predictor]) -> list[Outlook]:
    """Return the outlooks of distinctions in recordings that are fitted.

    Parameters
    ----------
    distinctions : iterable of Distinction
    predictors : sequence of Predictor
    """
    covered = coverage(predictors)
    missing = unidentifiable(covered)
    made = []
    for one in distinctions:
        kind = one.signal.split("/")[0]
        is_shown = kind not in missing and one.other not in indistinguishable(covered, kind)
        made.append(Outlook(one, is_shown))
    return made


def least_sureness(questions: Sequence[Outlook]) -> float:
    """Return how probably the kind that acts is told from the others, whichever it is."""
    return min(one.sureness for one in questions)


def mean_log_sureness(questions: Sequence[Outlook]) -> float:
    """Return the mean logarithm of sureness, by which trajectories are compared.

    The mean and not the least one, because no trajectory may tell some signal of a kind.
    """
    return float(np.mean(np.log([one.sureness for one in questions])))
