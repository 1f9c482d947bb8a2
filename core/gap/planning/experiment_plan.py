# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment of a rig: which kinds its recordings cannot separate, and the programme that separates a pair best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.engine.registry import library
from ...effects.engine.specification import FIT
from ...errors import ParameterError
from ...jobs import Job, Progress
from ...model.sensor import Effect
from ..base.base_model import free_parameters, prepared, start_model
from ..base.contact_heights import with_starting_heights
from ..base.quantities import friction_kinds
from ..candidates.candidates import DIRECTLY_ESTIMATED, NOT_FITTED, candidates, scales_of
from ..dataset.rig import Rig
from ..fitting.identifiability import unidentifiable
from ..fitting.least_squares import FreeParameter
from ..fitting.noise_floor import ChannelNoise, coverage
from ..forward.predictor import Model, Predictor, predictors_of
from ..selection.findings import Diagnosis
from .paths import Ground, Limits, Trajectory, Wishes
from .separation import Separation, Signals

Pair = tuple[str, str]
"""A kind that acts, and a rival."""


@dataclass(frozen=True)
class PlannedExperiment:
    """A further recording that separates kinds of effects, along the trajectory of the programme that was chosen.

    `before` and `after` separate each kind and each other one, by the recordings alone and with the further one. Without net
    forces in the recordings `has_forces` is false, and the further one has none.
    """

    programme: str
    trajectory: Trajectory
    before: tuple[Separation, ...]
    after: tuple[Separation, ...]
    limits: Limits
    has_forces: bool


@dataclass(frozen=True)
class ExperimentPlan:
    """Kinds that recordings separate, and the next experiment.

    Attributes
    ----------
    separations : tuple of Separation
        For each kind that the recordings could show and each other kind.
    cannot_show : dict of str to str
        Kinds that these recordings cannot show, each with the reason.
    experiment : PlannedExperiment or None
        None if the recordings separate all kinds.
    """

    separations: tuple[Separation, ...]
    cannot_show: dict[str, str]
    experiment: PlannedExperiment | None


def plan_experiment(rig: Rig, wishes: Wishes) -> Job[ExperimentPlan]:
    """Compute which kinds the fitted recordings of a rig separate, and choose the programme that separates an open pair best.

    Nothing is fitted: only their stimulus, their noise and the rig's own parameters count.

    Parameters
    ----------
    rig : Rig
    wishes : Wishes

    Yields
    ------
    Progress

    Returns
    -------
    ExperimentPlan

    Raises
    ------
    FileError
        The recordings do not fit their stimulus, see :func:`.base_model.prepared`.
    ParameterError
        A limit or a kind that is wanted has no meaning here.
    """
    yield Progress("contacts of every trial", 0, 100)
    rig = with_starting_heights(rig)
    predictors = predictors_of(rig.trials, rig)
    noise, _ = prepared(rig, predictors)
    fitted = [predictor for predictor in predictors if predictor.trial.use == "fit"]
    start = start_model(rig, fitted)
    can_show = {*(one.name for one in candidates(fitted, start)), *DIRECTLY_ESTIMATED, *NOT_FITTED, *friction_kinds()}
    reasons = unidentifiable(coverage(fitted))
    cannot_show = {name: reasons.get(name, "these recordings cannot show it") for name in library() if name not in can_show}
    ground = Ground(predictors, wishes.limits(predictors))
    full = scales_of(fitted, start).reading
    search = _Search(ground, fitted, start, free_parameters(rig, fitted, start, full), noise)
    shown = [kind for kind in search.kinds if kind not in cannot_show]
    for name in wishes.between:
        if name not in search.kinds:
            problem = "No trajectory is planned for" if name in library() else "There is no effect"
            raise ParameterError(f"{problem} '{name}': choose from {', '.join(sorted(search.kinds))}.")
    if len(set(wishes.between)) == 1:
        raise ParameterError(f"'{wishes.between[0]}' stands alone: name another effect to separate it from.")
    experiment, separations = yield from search.run(wishes.between or tuple(shown), choose_pair=not wishes.between)
    return ExperimentPlan(tuple(one for one in separations if one.kind in shown), cannot_show, experiment)


def plan_after(result: Diagnosis, wishes: Wishes | None = None) -> Job[PlannedExperiment | None]:
    """Plan the experiment that separates the kinds of a diagnosis which it leaves ambiguous.

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
        None if nothing is ambiguous, or only kinds between which no experiment can be planned.
    """
    yield Progress("planning the next experiment", 0, 100)
    wishes, fitted = wishes or Wishes(), result.of("fit")
    try:
        ground = Ground(result.predictors, wishes.limits(result.predictors))
    except ParameterError:
        return None  # the sentence says what to record; a limit that nobody gave is no reason to fail
    base = replace(result.base.model, parameters=result.best.model.parameters)
    search = _Search(ground, fitted, base, result.base.free, result.noise)
    groups = [tuple(name for name in group if name in search.kinds) for group in result.ambiguous]
    kinds = next((group for group in groups if len(group) > 1), ())
    own = [result.best.model.effects[one.effect] for one in result.findings if one.rivals]
    known = {one.name: one for one in [*own, *(other for found in result.findings for other in found.alternatives)]}
    return (yield from search.run(kinds, choose_pair=False, known=known))[0] if kinds else None


class _Search:
    """The programmes of a ground, and the kinds that the recordings or one of them could show."""

    def __init__(
        self,
        ground: Ground,
        fitted: Sequence[Predictor],
        model: Model,
        free: Sequence[FreeParameter],
        noise: tuple[ChannelNoise, ChannelNoise],
    ):
        self._ground, self._fitted, self._model, self._free, self._noise = ground, list(fitted), model, free, noise
        has_readings = any(p.trial.reading is not None for p in self._fitted)
        self._has_forces = any(p.trial.force is not None for p in self._fitted)
        self._further: dict[str, tuple[Trajectory, Predictor]] = {}
        for name, programme in ground.programmes().items():
            trajectory = ground.trajectory(programme)
            samples = len(trajectory.trial.time)
            reading = np.zeros((samples, len(ground.rig.texels))) if has_readings else None
            force = np.zeros((samples, 3)) if self._has_forces else None
            trial = replace(trajectory.trial, reading=reading, force=force)
            self._further[name] = trajectory, Predictor(trial, ground.rig)
        every = [*self._fitted, *(further for _, further in self._further.values())]
        found, more = ([one for one in candidates(seen, model) if one.kind.found_by == FIT] for seen in (self._fitted, every))
        names = {one.name for one in found}
        self._candidates = [*found, *(one for one in more if one.name not in names)]
        self.kinds = tuple(dict.fromkeys(one.name for one in self._candidates))

    def run(
        self, kinds: Sequence[str], choose_pair: bool, known: Mapping[str, Effect] | None = None
    ) -> Job[tuple[PlannedExperiment | None, list[Separation]]]:
        """Return the experiment for some kinds, or for the pair of them that is worth it, and what recordings separate.

        Kinds that were fitted are `known` as they are. Others come in all their forms, as do parameters of single texels.
        """
        forms = {name: one.form for name, one in (known or {}).items()}
        fitted = [one for one in self._candidates if one.form.name == forms.get(one.name) and not one.has_texel_parameters]
        known = {one.name: known[one.name] for one in fitted} if known else {}
        tried = [one for one in self._candidates if one.name not in known or one.form.name == forms[one.name]]
        tried = tried if choose_pair else [one for one in tried if one.name in kinds]
        signals = Signals(self._model, self._free, tried, self._fitted, self._noise, known)
        products = signals.products(self._fitted)
        yield Progress("signals of every kind", 20, 100)
        pairs = [(kind, other) for kind in kinds for other in kinds if kind != other]
        before = {pair: signals.separation(products, *pair) for pair in pairs}
        wanted = [pair for pair in pairs if not (choose_pair and before[pair].is_separated and before[pair[::-1]].is_separated)]
        if not wanted:
            return None, list(before.values())
        after: dict[str, dict[Pair, Separation]] = {}
        for number, (name, (_, further)) in enumerate(self._further.items()):
            yield Progress(f"the programme '{name}'", 20 + 80 * number // len(self._further), 100)
            joined = products + signals.products([further])
            after[name] = {pair: signals.separation(joined, *pair) for pair in wanted}
        question = _worthwhile(wanted, before, after) if choose_pair else wanted
        # The mean logarithm of the separations counts, not the least one, because no programme may separate one of the pairs.
        worth = {name: np.mean([np.log(max(own[pair].deviations, 1e-3)) for pair in question]) for name, own in after.items()}
        best = max(worth, key=lambda name: worth[name])
        alone, together = (tuple(found[pair] for pair in question) for found in (before, after[best]))
        trajectory, limits = self._further[best][0], self._ground.limits
        experiment = PlannedExperiment(best, trajectory, alone, together, limits, self._has_forces)
        return experiment, list(before.values())


def _worthwhile(wanted: Sequence[Pair], before: dict[Pair, Separation], after: dict[str, dict[Pair, Separation]]) -> list[Pair]:
    """The pair that recordings separate least and that a programme separates; if none does, that which comes nearest."""

    def both(found: dict[Pair, Separation], pair: Pair) -> tuple[bool, float]:
        sides = found[pair], found[pair[::-1]]
        return all(one.is_separated for one in sides), min(one.share for one in sides)

    best = {pair: max(both(found, pair) for found in after.values()) for pair in wanted}
    can = [pair for pair in wanted if best[pair][0]]
    nearest = max(wanted, key=lambda pair: (best[pair], pair))
    chosen = min(can, key=lambda pair: (both(before, pair)[1], pair)) if can else nearest
    return [chosen, chosen[::-1]]
