# SPDX-License-Identifier: GPL-3.0-or-later
"""How well recordings would tell kinds of effects with one recording more, and the search for the best one.

The columns of all kinds over a planned trajectory are added to the sums of products of those over the recordings. From these
follows, as for the recordings alone, which share of a kind's signal another kind cannot imitate.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from ..forward.predictor import Predictor
from ..kinds.distinguishability import Comparison
from ..kinds.recorded import Recorded
from .outlook import Outlook, mean_log_sureness, outlooks
from .paths import Ground, Trajectory
from .programmes import Programme, changed, random_programme, usual_programmes

RANDOM_PROGRAMMES, CHANGES = 24, 72
"""Random programmes beside the usual ones, and random changes of the best ones. Chosen by eye."""
BEST_KEPT = 4
"""Number of best programmes of which one is changed at a time."""

Question = frozenset[tuple[str, str]]
"""Directions of kinds, each with the kind to distinguish it from."""


@dataclass(frozen=True)
class Design:
    """A trajectory and what it tells.

    Attributes
    ----------
    trajectory : Trajectory
    programme : Programme
    before, after : tuple of Outlook
        Of the question, by the recordings alone and with the trajectory.
    """

    trajectory: Trajectory
    programme: Programme
    before: tuple[Outlook, ...]
    after: tuple[Outlook, ...]

    @property
    def value(self) -> float:
        """The more, the better."""
        return mean_log_sureness(self.after)


class DesignSpace:
    """Recordings, limits and the kinds to distinguish.

    Parameters
    ----------
    recorded : Recorded
    fitted : sequence of Predictor
        The recordings that are fitted.
    ground : Ground
    kinds : sequence of str

    Attributes
    ----------
    before : list of Outlook
        Of every signal and every other kind.
    """

    def __init__(self, recorded: Recorded, fitted: Sequence[Predictor], ground: Ground, kinds: Sequence[str]):
        self.recorded, self.fitted, self.ground = recorded, list(fitted), ground
        self._comparison = Comparison(recorded, set(kinds))
        self.before = outlooks(self._comparison.distinctions(), self.fitted)

    def told(self, trajectory: Trajectory, question: Question) -> list[Outlook]:
        """Return how well the recordings and a planned one answer a question."""
        trial = trajectory.as_trial(self.ground.like)
        further = Predictor(trial, self.ground.rig)
        return outlooks(self._comparison.distinctions(trial, question), [*self.fitted, further])

    def design(self, programme: Programme, question: Question) -> Design:
        """Return what the trajectory of a programme tells."""
        trajectory = self.ground.trajectory(programme)
        before = tuple(one for one in self.before if (one.distinction.signal, one.other) in question)
        return Design(trajectory, programme, before, tuple(self.told(trajectory, question)))


def best_design(space: DesignSpace, question: Question) -> Generator[float, None, Design]:
    """Look for the trajectory that answers a question best: of usual and random programmes, and of changes of the best.

    Parameters
    ----------
    space : DesignSpace
    question : Question

    Yields
    ------
    share : float
        How much of the work is done.

    Returns
    -------
    Design
    """
    rng, span = np.random.default_rng(0), space.ground.span
    programmes = [*usual_programmes(span), *(random_programme(span, rng) for _ in range(RANDOM_PROGRAMMES))]
    total = len(programmes) + CHANGES
    found: list[Design] = []
    for number, programme in enumerate(programmes):
        yield number / total
        found.append(space.design(programme, question))
    found = sorted(found, key=lambda one: -one.value)[:BEST_KEPT]
    for number in range(CHANGES):
        yield (len(programmes) + number) / total
        parent = found[int(rng.integers(len(found)))]
        child = space.design(changed(parent.programme, span, rng), question)
        found = sorted([*found, child], key=lambda one: -one.value)[:BEST_KEPT]
    return found[0]
