# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment of a rig: which kinds its recordings cannot tell apart, and the trajectory that tells a pair best."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.engine.registry import library
from ...errors import ParameterError
from ...jobs.progress import Job, Progress
from ..dataset.rig import Rig
from ..fitting.least_squares import BASE
from ..forward.predictor import Predictor
from ..kinds.distinguishability import COMPARED_KINDS
from ..kinds.recorded import recorded
from ..selection.findings import Diagnosis
from ..selection.unfitted import unfitted
from .design import Design, DesignSpace, Question, best_design
from .limits import Limits, limits_of
from .outlook import Outlook, least_sureness
from .paths import Ground
from .programmes import random_programme, usual_programmes

TRIED_RANDOM = 6
"""Random programmes that are tried beside the usual ones to see which pairs an experiment can tell at all."""
TOLD_BY_EXPERIMENT = 0.75
"""Sureness from which on an experiment can tell a pair."""
TOTAL = 1000


@dataclass(frozen=True)
class PlannedExperiment:
    """A further recording that tells kinds of effects apart.

    Attributes
    ----------
    kinds : tuple of str
        What it is to tell apart.
    design : Design
    limits : Limits
    """

    kinds: tuple[str, ...]
    design: Design
    limits: Limits

    @property
    def sure_before(self) -> float:
        """How probably the kind that acts is told from the others by the recordings alone, whichever it is."""
        return least_sureness(self.design.before)

    @property
    def sure_after(self) -> float:
        """The same with the further recording."""
        return least_sureness(self.design.after)


@dataclass(frozen=True)
class ExperimentPlan:
    """What recordings can tell, and the next experiment.

    Attributes
    ----------
    outlooks : tuple of Outlook
        For each kind, in each of its directions, and each other kind.
    cannot_show : dict of str to str
        Kinds that these recordings cannot show, each with the reason.
    experiment : PlannedExperiment or None
        None if the recordings tell all kinds apart.
    """

    outlooks: tuple[Outlook, ...]
    cannot_show: dict[str, str]
    experiment: PlannedExperiment | None

    @property
    def signals(self) -> tuple[str, ...]:
        """What the outlooks are about, in the order in which kinds act."""
        return tuple(dict.fromkeys(one.distinction.signal for one in self.outlooks))

    def taken_for(self, signal: str) -> list[Outlook]:
        """Return the kinds that a signal may be taken for, the likeliest first."""
        open_ones = [one for one in self.outlooks if one.distinction.signal == signal and not one.is_told]
        return sorted(open_ones, key=lambda one: one.sureness)


@dataclass(frozen=True)
class Wishes:
    """What the user wants of an experiment; None and empty are decided from the recordings.

    Attributes
    ----------
    between : tuple of str
        Kinds that it is to tell apart.
    depth : float or None
        See :class:`.limits.Limits`, as for those below.
    speed : float or None
    duration : float or None
    area : (float, float, float, float) or None
    """

    between: tuple[str, ...] = ()
    depth: float | None = None
    speed: float | None = None
    duration: float | None = None
    area: tuple[float, float, float, float] | None = None

    def limits(self, predictors: Sequence[Predictor]) -> Limits:
        """Return the limits of an experiment after some recordings."""
        return limits_of(predictors, self.depth, self.speed, self.duration, self.area)


def plan_experiment(rig: Rig, wishes: Wishes | None = None) -> Job[ExperimentPlan]:
    """Compute which kinds the fitted recordings of a rig can tell apart, and the recording that tells the open pair best.

    Nothing is fitted: only their stimulus, their noise and the rig's own parameters count.

    Parameters
    ----------
    rig : Rig
    wishes : Wishes, optional

    Yields
    ------
    Progress

    Returns
    -------
    ExperimentPlan

    Raises
    ------
    ParameterError
        A limit or a kind that is wanted has no meaning here.
    """
    wishes = wishes or Wishes()
    yield Progress("contacts of every trial", 0, TOTAL)
    known = unfitted(rig)
    compared = (known.shown | known.cannot_show.keys()) & COMPARED_KINDS
    _check_kinds(wishes.between, compared)
    yield Progress("signals of every kind", 100, TOTAL)
    seen = recorded(known.fitted, known.start, known.free, known.channels)
    ground = Ground(known.predictors, wishes.limits(known.predictors))
    space = DesignSpace(seen, known.fitted, ground, sorted(compared))
    yield Progress("pairs that an experiment can separate", 300, TOTAL)
    question = _question_of(space, wishes.between) if wishes.between else _open_question(space)
    experiment = None
    if question:
        experiment = yield from _planned(space, question, 500)
    return ExperimentPlan(tuple(space.before), known.cannot_show, experiment)


def plan_after(result: Diagnosis, wishes: Wishes | None = None) -> Job[PlannedExperiment | None]:
    """Plan the experiment that tells the kinds of a diagnosis apart which it leaves ambiguous.

    Parameters
    ----------
    result : Diagnosis
    wishes : Wishes, optional

    Yields
    ------
    Progress

    Returns
    -------
    PlannedExperiment or None
        None if nothing is ambiguous, or only kinds between which no trajectory can be planned.
    """
    yield Progress("planning the next experiment", 0, TOTAL)
    wishes = wishes or Wishes()
    groups = [tuple(name for name in group if name in COMPARED_KINDS) for group in result.ambiguous]
    kinds = wishes.between or next((group for group in groups if len(group) > 1), ())
    if not kinds:
        return None
    fitted = result.of("fit")
    free = {item.name for item in result.base.free if item.effect == BASE}
    seen = recorded(fitted, result.base.model, free, result.noise)
    try:
        ground = Ground(result.predictors, wishes.limits(result.predictors))
    except ParameterError:
        return None  # the sentence says what to record; a limit that nobody gave is no reason to fail
    space = DesignSpace(seen, fitted, ground, kinds)
    question = _question_of(space, kinds)
    return (yield from _planned(space, question, 0)) if question else None


def _planned(space: DesignSpace, question: Question, begins: int) -> Generator[Progress, None, PlannedExperiment]:
    """The best experiment for a question, with only those kinds in the equations that it is about."""
    kinds = tuple(dict.fromkeys(name for signal, other in sorted(question) for name in (signal.split("/")[0], other)))
    steps = best_design(DesignSpace(space.recorded, space.fitted, space.ground, kinds), question)
    while True:
        try:
            share = next(steps)
        except StopIteration as stop:
            return PlannedExperiment(kinds, stop.value, space.ground.limits)
        yield Progress(f"a trajectory that separates {' from '.join(kinds)}", begins + int((TOTAL - begins) * share), TOTAL)


def _check_kinds(names: Sequence[str], compared: frozenset[str]) -> None:
    """Raise if no planned trajectory can distinguish some of the kinds."""
    for name in names:
        if name not in library():
            raise ParameterError(f"There is no effect '{name}': choose from {', '.join(sorted(compared))}.")
        if name not in compared:
            raise ParameterError(f"No trajectory is planned for '{name}': choose from {', '.join(sorted(compared))}.")
    if len(set(names)) == 1:
        raise ParameterError(f"'{names[0]}' stands alone: name another effect to separate it from.")


def _question_of(space: DesignSpace, kinds: Sequence[str]) -> Question:
    """What is asked about some kinds: which of them acts."""
    return frozenset((one.distinction.signal, one.other) for one in space.before if one.kind in kinds and one.other in kinds)


def _open_question(space: DesignSpace) -> Question:
    """The pair that the recordings tell least and that an experiment can tell; if none can, that which comes nearest."""
    pairs: dict[frozenset[str], list[Outlook]] = {}
    for one in space.before:
        if not one.is_told:
            pairs.setdefault(frozenset((one.kind, one.other)), []).append(one)
    if not pairs:
        return frozenset()
    wanted = frozenset((one.distinction.signal, one.other) for pair in pairs.values() for one in pair)
    rng, span = np.random.default_rng(0), space.ground.span
    programmes = [*usual_programmes(span), *(random_programme(span, rng) for _ in range(TRIED_RANDOM))]
    best = dict.fromkeys(pairs, 0.0)
    for programme in programmes:
        told = space.told(space.ground.trajectory(programme), wanted)
        for pair in pairs:
            of_pair = [one for one in told if {one.kind, one.other} == pair]
            best[pair] = max(best[pair], least_sureness(of_pair) if of_pair else 0.0)
    can = [pair for pair in pairs if best[pair] >= TOLD_BY_EXPERIMENT]
    if can:
        chosen = min(can, key=lambda pair: (least_sureness(pairs[pair]), sorted(pair)))
    else:
        chosen = max(pairs, key=lambda pair: (best[pair], sorted(pair)))
    return _question_of(space, tuple(chosen))
