# SPDX-License-Identifier: GPL-3.0-or-later
"""What is missing in a sensor's model: recordings are checked, the base model is refitted, effects are looked for, and what was
found is put into words: names with a confidence, rivals that would do as well, what is ruled out and why.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...effects.engine.registry import library
from ...jobs.progress import Job, Progress
from ...model.effect import Effect
from ...model.sensor_parameters import LINEAR
from ..dataset.rig import Rig
from ..fitting.heteroscedastic_noise import proportional_noise
from ..fitting.least_squares import FRICTION_LEVEL, FRICTION_PARAMETERS, Fit, fit, free_base_parameters, held_out_squares
from ..fitting.noise_floor import SHORTEST_STRETCH, ChannelNoise, Coverage, coverage, force_noise, reading_noise
from ..fitting.residual_tests import ResidualStructure, residual_structure
from ..fitting.spectral_lines import SpectralLine, strongest_line
from ..forward.predictor import Model, Predictor
from .candidates import NOT_FITTED, Scales, candidates, scales_of
from .confidence import EXPLAINED, UNSURE_CONFIDENCE, is_doubtful, least_share, may_absorb_misfit, unsure_names
from .forward_selection import (
    FORCES,
    LEAST_IMPROVEMENT,
    LEAST_STRUCTURE,
    READINGS,
    ForwardSelection,
    NoiseFloor,
    SelectionState,
    SelectionStep,
    friction_kinds,
    means_of,
)
from .identifiability import SPREADING, curvature_ratio, hardly_distinguishable, indistinguishable, unidentifiable
from .screening import ViewSet, view_set_of

RIVAL_RATIO = 1.35
"""A rival is one that leaves at most so many times as much of the gap as the best does, and closes nearly as much."""
HARDLY_DISTINGUISHABLE_RATIO = 3.0
"""The same for those that are much alike (see :func:`.identifiability.hardly_distinguishable`)."""


@dataclass(frozen=True)
class Finding:
    """An effect that was found.

    Attributes
    ----------
    effect : int
        Index in the model's stack.
    name, form : str
    confidence : float
    rivals : tuple of str
        Kinds that explain as much.
    next_best : str
        The kind that came nearest to it, "" where none did, and
    leaves : float
        how many times as much of the gap that one leaves.
    """

    effect: int
    name: str
    form: str
    confidence: float
    rivals: tuple[str, ...]
    next_best: str = ""
    leaves: float = np.inf


@dataclass
class Diagnosis:
    """All that was found out about a rig."""

    rig: Rig
    predictors: list[Predictor]
    noise: tuple[ChannelNoise, ChannelNoise]
    full: tuple[float, float]
    coverage: Coverage
    scales: Scales
    base: Fit
    best: Fit
    base_structure: ResidualStructure
    structure: ResidualStructure
    verdict: str = "no gap"
    findings: list[Finding] = field(default_factory=list)
    ambiguous: list[tuple[str, ...]] = field(default_factory=list)
    ruled_out: list[tuple[str, str]] = field(default_factory=list)
    line: SpectralLine | None = None

    def of(self, use: str) -> list[Predictor]:
        """Return the predictors of the trials of one use."""
        return [p for p in self.predictors if p.trial.use == use]


def base_parameters_to_search(rig: Rig, predictors: Sequence[Predictor]) -> list[str]:
    """Return which of the base model's own numbers are free while effects are looked for.

    Of depth and pose the readings tell only gain times stiffness: in newtons, or where the rig gives the gain, that is `k`.
    """
    names = identified_base_parameters(rig, predictors)
    return [name for name in names if name not in FRICTION_PARAMETERS] + (
        friction_parameters_to_search(rig) if set(FRICTION_PARAMETERS) & set(names) else []
    )


def identified_base_parameters(rig: Rig, predictors: Sequence[Predictor]) -> list[str]:
    """Return which of the base model's own numbers these recordings tell."""
    read = any(p.trial.reading is not None for p in predictors)
    pressed = any(p.trial.stimulus != "force" for p in predictors)
    loaded = any(p.trial.stimulus == "force" for p in predictors)
    dragged = any(p.trial.force is not None and p.stimulus.slide.any() for p in predictors)
    felt = any(p.trial.force is not None for p in predictors)
    own_unit = rig.parameters.unit != "N"
    names: list[str] = []
    if pressed:
        names += ["k", "cn"] if rig.parameters.normal_law == LINEAR else ["k"]
        if own_unit and read and "gain" not in rig.given and not felt:
            names.remove("k")
            names.append("gain")
        elif own_unit and read and (felt or loaded):
            names.append("gain")
    if loaded and read and "gain" not in names:
        names.append("gain")
    if own_unit and read:
        names.append("zero")
    if dragged:
        names += FRICTION_PARAMETERS
    return names


def friction_parameters_to_search(rig: Rig) -> list[str]:
    """Return which of the base model's numbers of friction are free while effects are looked for.

    By how much friction falls from rest to sliding, and over which speeds, is itself a law of Stribeck's, and `ct` a viscous
    friction: were they free, there would be nothing left of these two effects to find. Where a rig states them, another fall
    or another drag is such an effect, and the level of friction alone is a better number.
    """
    p = rig.parameters
    names = list(FRICTION_PARAMETERS)
    if {"mus", "mud", "x0"} <= rig.given and p.mus > 0:
        names = [FRICTION_LEVEL, *(name for name in names if name not in ("mus", "mud", "x0"))]
    if "ct" in rig.given:
        names.remove("ct")
    return names


def prepared(rig: Rig) -> tuple[list[Predictor], tuple[ChannelNoise, ChannelNoise], tuple[float, float]]:
    """Compute what the texels meet in each trial, and measure noise and range."""
    predictors = [Predictor(trial, rig) for trial in rig.trials]
    readings = [p.trial.reading for p in predictors if p.trial.reading is not None]
    forces = [p.trial.force for p in predictors if p.trial.force is not None]
    full = _range(readings), _range(forces)
    noise = reading_noise(predictors, full[0]), force_noise(predictors, full[1])
    return predictors, noise, full


def _range(arrays: Sequence[np.ndarray]) -> float:
    """Range of what was measured, all trials and channels together; 1 where nothing was."""
    if not arrays:
        return 1.0
    high, low = max(float(np.nanmax(a)) for a in arrays), min(float(np.nanmin(a)) for a in arrays)
    return max(high - low, 1e-12)


def start_model(rig: Rig, predictors: Sequence[Predictor]) -> Model:
    """Return the rig's own parameters; gain and zero that it leaves open are guessed from the readings."""
    p = rig.parameters
    if p.unit == "N" or "gain" in rig.given:
        return Model(p)
    base = Model(replace(p, gain=1.0, zero=0.0))
    x, y = [], []
    for predictor in predictors:
        if predictor.trial.reading is not None:
            good = np.isfinite(predictor.trial.reading)
            x.append(predictor.predict(base).reading[good])
            y.append(predictor.trial.reading[good])
    if not x:
        return Model(p)
    gain, zero = np.polyfit(np.concatenate(x), np.concatenate(y), 1)
    if not np.isfinite(gain) or gain == 0:
        gain = 1.0
    return Model(replace(p, gain=float(gain), zero=p.zero if "zero" in rig.given else float(zero)))


def diagnose(rig: Rig) -> Job[Diagnosis]:
    """Find out what the base model misses in a rig.

    Yields
    ------
    Progress
        While it works; closing the generator stops it.

    Returns
    -------
    Diagnosis
    """
    total = 1000
    yield Progress("contacts of every trial", 0, total)
    predictors, noise, full = prepared(rig)
    fitted = [p for p in predictors if p.trial.use == "fit"]
    view_set = view_set_of(fitted, (noise[0].deviation, noise[1].deviation))
    yield Progress("base model", 40, total)
    start = start_model(rig, fitted)
    base = fit(
        view_set.whole,
        start,
        free_base_parameters(start.parameters, base_parameters_to_search(rig, fitted), full[0]),
        max_steps=40,
        tolerance=1e-7,
    )
    before = _structure(view_set, base)
    scales = scales_of(fitted, base.model)
    result = Diagnosis(rig, predictors, noise, full, coverage(fitted), scales, base, base, before, before)
    for progress in _select_effects(result, view_set):
        yield Progress(progress[0], 60 + int(940 * progress[1]), total)
    return result


def _structure(view_set: ViewSet, found: Fit) -> ResidualStructure:
    width = len(view_set.whole[0].predictor.rig.texels)
    residuals = [share.residual(found.model) for share in view_set.whole]
    if not any(
        share.predictor.trial.reading is not None for share in view_set.whole
    ):  # forces alone: three channels for texels
        return _force_structure(view_set, residuals)
    return residual_structure([share.predictor for share in view_set.whole], [r[:, :width] for r in residuals])


def _force_structure(view_set: ViewSet, residuals: list[np.ndarray]) -> ResidualStructure:
    """The same where only the net force was measured: its largest component stands for all texels."""
    width = len(view_set.whole[0].predictor.rig.texels)
    total = np.sum([(r[:, width:] ** 2).sum(axis=0) for r in residuals], axis=0)
    axis = width + int(np.argmax(total))
    return residual_structure(
        [s.predictor for s in view_set.whole], [np.tile(r[:, axis : axis + 1], (1, width)) for r in residuals]
    )


def _select_effects(result: Diagnosis, view_set: ViewSet) -> Iterator[tuple[str, float]]:
    """Add effects to the base model while they earn their place; write everything into `result`."""
    base = SelectionState(result.base, held_out_squares(view_set.whole, result.base))
    start = base.means
    noise = np.array([min(1.0, start[READINGS]), min(_force_noise_unloaded(view_set, result.base), start[FORCES])])
    floor = NoiseFloor(start, noise, result.base.count.sum(axis=0).astype(float))
    explainer = ForwardSelection(view_set, result.scales, result.coverage, floor)
    state = yield from explainer.run(base, partial(_structure, view_set))
    state = replace(state, fit=_refitted_base(result, view_set, state.fit))
    result.best, result.structure = state.fit, _structure(view_set, state.fit)
    result.line = strongest_line(view_set.whole, state.fit.model)
    main, mean = floor.main_quantity, float(state.means[floor.main_quantity])
    least = min(start[main] * (1.0 - result.base_structure.total), mean * (1.0 - result.structure.total))
    floor.noise[main] = float(np.clip(least, 0.8, 1.0))
    if result.structure.total < LEAST_STRUCTURE and result.line is None:
        noise_effect = proportional_noise(view_set.whole, state.fit.model)
        if noise_effect is not None:  # then all that is left is noise
            result.best = replace(state.fit, model=state.fit.model.with_effect(noise_effect))
            floor.noise[main] = max(floor.noise[main], mean)
    _conclude(result, state, floor)
    unsure = unsure_names(result, view_set, state, floor)
    result.findings = [
        replace(n, confidence=min(n.confidence, UNSURE_CONFIDENCE)) if n.name in unsure else n for n in result.findings
    ]
    _rule_out(result, state.first, floor)


def _refitted_base(result: Diagnosis, view_set: ViewSet, found: Fit) -> Fit:
    """The fit with all the base model's numbers free, as those that a rig states are rounded.

    Where an effect on friction was found they would take its part. There they stay, and only make the intervals as wide as
    what the recordings tell.
    """
    names = identified_base_parameters(result.rig, [share.predictor for share in view_set.whole])
    if set(names) == {item.name for item in found.free if item.effect < 0}:
        return found
    rubbed = any(effect.name in friction_kinds() for effect in found.model.effects)
    free = free_base_parameters(found.model.parameters, names, result.full[READINGS])
    free += [item for item in found.free if item.effect >= 0]
    return fit(view_set.whole, found.model, free, max_steps=0 if rubbed else 10, tolerance=1e-5)


def _force_noise_unloaded(view_set: ViewSet, found: Fit) -> float:
    """Mean square of the forces' residual while nothing touches; at least 1, which is what white noise has."""
    squares = []
    for share in view_set.whole:
        stimulus = share.predictor.stimulus
        load = stimulus.load
        rest = ~(load > 0).any(axis=1)
        if share.with_forces and share.predictor.trial.force is not None and rest.sum() >= SHORTEST_STRETCH:
            squares.append(share.residual(found.model)[rest, -3:] ** 2)
    return max(float(np.concatenate(squares).mean()), 1.0) if squares else 1.0


def _conclude(result: Diagnosis, state: SelectionState, floor: NoiseFloor) -> None:
    """Write verdict, names and rivals."""
    effects = result.best.model.effects
    fitted = [effect for effect in effects if effect.name != "noise"]
    closed = [floor.closed_share(state.means, quantity) for quantity in (READINGS, FORCES)]
    is_open = any(floor.has_gap(quantity) and closed[quantity] < EXPLAINED for quantity in (READINGS, FORCES))
    result.verdict = _verdict(result, floor, is_open)
    curvature = curvature_ratio(result.of("fit"), result.best.model)
    for index, effect in enumerate(effects):
        others, leaves = _alternatives(effect, state, {e.name for e in effects})
        rivals = _rivals(effect, state, result.coverage, curvature, others, floor)
        weight = 1.0 / (1.0 + sum(ratio**-4.0 for ratio in others.values()))
        share = closed[floor.quantity_for(effect.name)] if fitted else 1.0
        confidence = weight * (0.5 + 0.5 * share if share >= least_share(effect.name, leaves) else 0.5 * share)
        bent = is_open and may_absorb_misfit(effect, state)
        if rivals or (len(fitted) > 1 and (bent or is_doubtful(effect, state, fitted, floor))):
            confidence = min(confidence, UNSURE_CONFIDENCE)
        if rivals:
            result.ambiguous.append((effect.name, *rivals))
        nearest = min(others, key=lambda name: others[name], default="")
        result.findings.append(
            Finding(index, effect.name, effect.form, round(confidence, 3), rivals, nearest, leaves.get(nearest, np.inf))
        )


def _verdict(result: Diagnosis, floor: NoiseFloor, is_open: bool) -> str:
    """One word on the whole; `is_open` where much of what the base model lacks is left."""
    effects = result.best.model.effects
    if all(effect.name == "noise" for effect in effects) and effects:
        return "explained"
    if effects:
        return "unexplained" if is_open else "explained"
    mean, gap = float(floor.base[floor.main_quantity]), floor.gap(floor.main_quantity)
    quiet = result.base_structure.total < LEAST_STRUCTURE and (mean < 2.0 or gap < LEAST_IMPROVEMENT) and result.line is None
    return "no gap" if quiet and not (floor.both and floor.has_gap(FORCES)) else "unexplained"


def _alternatives(effect: Effect, state: SelectionState, taken: set[str]) -> tuple[dict[str, float], dict[str, float]]:
    """How many times as bad as an effect each other kind is in its place, and how many times as much it leaves, by name."""
    step = state.steps.get(effect.name, SelectionStep([], []))
    own = step.of(effect.name)
    others: dict[str, float] = {}
    leaves: dict[str, float] = {}
    for one, left in zip(step.ranked, step.remaining, strict=True):
        name = one.candidate.name
        if name not in taken and not (effect.name == "dead-texels" and one.candidate.has_texel_parameters):
            others[name] = min(step.times_worse(left, effect.name), others.get(name, np.inf))
            leaves[name] = min(left / own, leaves.get(name, np.inf))
    return others, leaves


def _rivals(
    effect: Effect, state: SelectionState, covered: Coverage, curvature: float, others: dict[str, float], floor: NoiseFloor
) -> tuple[str, ...]:
    """Kinds that would do as well, or that these recordings cannot tell from it; `others` as from :func:`_alternatives`."""
    taken = {e.name for e in state.fit.model.effects}
    own = state.steps.get(effect.name, SelectionStep([], [])).of(effect.name)
    hit = effect.name in SPREADING and own < 2.0 * floor.unresolved(
        floor.quantity_for(effect.name)
    )  # leaves nothing: the sensor's own
    akin = () if hit else hardly_distinguishable(covered, effect.name)
    near = [name for name, ratio in others.items() if ratio < (HARDLY_DISTINGUISHABLE_RATIO if name in akin else RIVAL_RATIO)]
    return tuple(
        dict.fromkeys([*near, *(name for name in indistinguishable(covered, effect.name, curvature) if name not in taken)])
    )


def _rule_out(result: Diagnosis, alone: SelectionStep, floor: NoiseFloor) -> None:
    """Say of each kind why it was not named; `alone` are those that were fitted on top of the base model."""
    tried: dict[str, float] = {}
    for one in alone.ranked:
        name = one.candidate.name
        closed = floor.closed_share(means_of(one.held_out, one.fit), floor.quantity_for(name))
        tried[name] = max(tried.get(name, 0.0), closed)
    named = {name for pair in result.ambiguous for name in pair} | {n.name for n in result.findings}
    looked = {c.name for c in candidates(result.of("fit"), result.base.model)}
    for kind in library().values():
        if kind.name in named:
            continue
        if kind.name in NOT_FITTED:
            why = "what is left does not tremble the more, the larger the reading"
        elif kind.name not in looked:
            why = unidentifiable(result.coverage).get(kind.name, "these recordings cannot show it")
        elif kind.name in tried and result.verdict != "no gap":
            why = f"alone it closes {tried[kind.name]:.0%} of the squared gap on unseen trials"
        elif result.verdict == "no gap":
            why = "nothing is left for it to explain"
        else:
            why = "a first look promised far less than what was fitted"
        result.ruled_out.append((kind.name, why))
