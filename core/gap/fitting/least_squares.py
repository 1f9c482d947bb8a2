# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares for a model on several trials at once, with as many numbers per texel as it needs, and on trials left out.

The normal equations are summed per trial. A number per texel acts on its own texel only, so its column of the Jacobian for all
texels together costs one evaluation, and its block of the equations is diagonal: the common numbers are solved for first (Schur
complement). Leaving a trial out takes its share out of the sums; one Newton step from the common fit then gives the fit without
it (Beirami et al., "On optimal generalizability in parametric learning", NeurIPS 2017), and only the trial left out is
predicted anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...model.sensor_parameters import SensorParameters
from ..forward.predictor import Model, Predictor

DIFFERENCE_STEP = 1e-3
"""Of the finite differences: in the logarithm of a number, or as a share of the size of one that is not on a log scale."""


QUANTIZED_DIFFERENCE_STEP = 0.03
"""The same for models whose readings come in steps: a staircase has no slope but across its edges."""
TEXEL_PRECISION = 10.0
"""Inverse variance of a number per texel about its resting value, in its coordinate: a gain is within ± 0.3 unseen."""
FRICTION_PARAMETERS = ("mus", "mud", "sigma0", "x0", "ct")
"""Parameters of the base model that show in net forces alone."""
FRICTION_LEVEL = "mus and mud"
"""Both friction coefficients as one number, by which they grow alike."""
GRADIENT_BLOCKS = 12
"""Blocks of time of each stretch in which gradients are summed, each long against the memory of the noise."""
LEAST_INFORMATION = 0.1
"""Least share of what all recordings tell of a number that some of them must tell, to find it from them."""


@dataclass(frozen=True)
class FreeParameter:
    """One number that is fitted, or one per texel.

    Attributes
    ----------
    effect : int
        Index in the model's stack; -1 for a parameter of the base model.
    name : str
    low, high : float
    log : bool
    scale : float
        A change that matters, for numbers that are not on a log scale.
    per_texel : bool
    resting_value : float
        Value from which a number per texel departs only as far as the recording says so (see :data:`TEXEL_PRECISION`).
    tied : tuple of str
        Other parameters of the base model that keep their ratio to it.
    """

    effect: int
    name: str
    low: float
    high: float
    log: bool = False
    scale: float = 1.0
    per_texel: bool = False
    resting_value: float = 0.0
    tied: tuple[str, ...] = ()

    def to_coordinate(self, value: np.ndarray | float) -> np.ndarray:
        """Value → coordinate of the fit."""
        value = np.clip(np.asarray(value, float), self.low, self.high)
        return np.log(value) if self.log else value / self.scale

    def from_coordinate(self, coordinate: np.ndarray | float) -> np.ndarray:
        """Coordinate → value, inside the bounds."""
        value = np.exp(np.clip(coordinate, -700, 700)) if self.log else np.asarray(coordinate) * self.scale
        return np.clip(value, self.low, self.high)


def value_of(model: Model, free: FreeParameter) -> np.ndarray | float:
    """Return what a model has for a free number."""
    if free.effect < 0:
        return float(getattr(model.parameters, free.name))
    return np.asarray(model.effects[free.effect].values[free.name], float)


def with_values(model: Model, free: Sequence[FreeParameter], values: Sequence[np.ndarray | float]) -> Model:
    """Return a model with other values for its free numbers."""
    base: dict[str, Any] = {}
    stacks: dict[int, dict[str, float | tuple[float, ...]]] = {}
    for item, value in zip(free, values, strict=True):
        if item.effect < 0:
            base[item.name] = float(value)
            grows = float(value) / max(float(getattr(model.parameters, item.name)), 1e-12) if item.tied else 1.0
            base |= {name: grows * float(getattr(model.parameters, name)) for name in item.tied}
        else:
            plain = tuple(np.asarray(value).tolist()) if item.per_texel else float(value)
            stacks.setdefault(item.effect, {})[item.name] = plain
    parameters = replace(model.parameters, **base) if base else model.parameters
    if parameters.mud > parameters.mus:
        parameters = replace(parameters, mud=parameters.mus)
    effects = list(model.effects)
    for index, new in stacks.items():
        effects[index] = replace(effects[index], values={**effects[index].values, **new})
    return Model(parameters, tuple(effects))


@dataclass(frozen=True)
class TrialView:
    """The part of a trial that is looked at: texels and samples, with weights that are zero where a value is missing.

    Attributes
    ----------
    predictor : Predictor
    subset : (c,) int or None
        Texels; None: all, also to the effects that let texels feel their neighbours.
    samples : slice
    noise : (float, float)
        Standard deviation of readings and of forces, in their units.
    stretch_count : int
        Into how many stretches of time the trial is cut for judging on what was not seen.
    with_forces : bool
        Whether net forces count where they were measured.
    """

    predictor: Predictor
    subset: np.ndarray | None = None
    samples: slice = field(default_factory=lambda: slice(None))
    noise: tuple[float, float] = (1.0, 1.0)
    stretch_count: int = 1
    with_forces: bool = True

    def stretches(self, residual: np.ndarray) -> list[slice]:
        """Return the stretches of time that are left out in turn, as rows of a residual."""
        edges = np.linspace(0, len(residual), self.stretch_count + 1).astype(int)
        return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]

    @property
    def texels(self) -> np.ndarray:
        """(c,) int."""
        return np.arange(len(self.predictor.rig.texels)) if self.subset is None else self.subset

    @cached_property
    def _measured(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Readings of the texels, and where they are missing if any is."""
        reading = self.predictor.trial.reading
        if reading is None:
            return None, None
        reading = reading[:, self.texels][self.samples]
        missing = ~np.isfinite(reading)
        return reading, missing if missing.any() else None

    def residual(self, model: Model) -> np.ndarray:
        """Measured minus predicted in units of the noise, (T, c + 3); zero where nothing was measured."""
        trial = self.predictor.trial
        predicted = self.predictor.predict(model, self.subset, self.with_forces)
        reading, missing = self._measured
        width = len(self.texels)
        out = np.zeros((len(trial.time[self.samples]), width + 3))
        if reading is not None:
            np.subtract(reading, predicted.reading[self.samples], out=out[:, :width])
            out[:, :width] /= self.noise[0]
            if missing is not None:
                out[:, :width][missing] = 0.0
        if predicted.force is not None:
            out[:, width:] = np.nan_to_num((trial.force - predicted.force)[self.samples] / self.noise[1])
        return out

    @cached_property
    def counts(self) -> np.ndarray:
        """How many values were measured, (2,) int: of readings, and of forces."""
        trial, number = self.predictor.trial, np.zeros(2, int)
        if trial.reading is not None:
            number[0] = np.isfinite(trial.reading[self.samples][:, self.texels]).sum()
        if trial.force is not None and self.with_forces:
            number[1] = np.isfinite(trial.force[self.samples]).sum()
        return number

    def squares(self, residual: np.ndarray) -> np.ndarray:
        """Sum of squares of (some samples of) a residual, (2,) float: of readings, and of forces."""
        width = len(self.texels)
        return np.array([_sum_of_squares(residual[:, :width]), _sum_of_squares(residual[:, width:])])


@dataclass
class NormalEquations:
    """Normal equations of one trial: p common numbers, m per texel on n texels.

    Attributes
    ----------
    common, common_gradient : (p, p), (p,)
    coupling : (n, m, p)
    texel, texel_gradient : (n, m, m), (n, m)
    sse : float
    gradients : (blocks, n + 3, p)
        Share in `g` of each texel, and of each component of the force, by blocks of time.
    """

    common: np.ndarray
    common_gradient: np.ndarray
    coupling: np.ndarray
    texel: np.ndarray
    texel_gradient: np.ndarray
    sse: float
    gradients: np.ndarray


@dataclass
class Fit:
    """A fitted model.

    Attributes
    ----------
    model : Model
    free : tuple of FreeParameter
    sse : (trials, 2) float
        Sum of squares per trial, of readings and of forces, in units of the noise.
    count : (trials, 2) int
    equations : list of list of NormalEquations, or None
        By trial and stretch.
    """

    model: Model
    free: tuple[FreeParameter, ...]
    sse: np.ndarray
    count: np.ndarray
    equations: list[list[NormalEquations]] | None = None

    @property
    def mean(self) -> float:
        """Mean square of the residual in units of the noise's variance."""
        return float(self.sse.sum() / max(self.count.sum(), 1))


def fit(
    views: Sequence[TrialView],
    model: Model,
    free: Sequence[FreeParameter],
    max_steps: int = 15,
    tolerance: float = 1e-5,
    frozen: int = 0,
    with_equations: bool = True,
    initial_derivatives: Sequence[np.ndarray] | None = None,
) -> Fit:
    """Fit a model's free numbers by Levenberg–Marquardt steps.

    Parameters
    ----------
    shares : sequence of TrialView
    model : Model
        Where to start.
    free : sequence of FreeParameter
    turns : int
        Most steps.
    tolerance : float
        Relative decrease of the sum of squares below which it ends.
    held : int
        Derivatives by so many of the first numbers are computed once and held for all steps, unless none leads down. It only
        takes more steps; where they end is the same.
    judged : bool
        Whether the normal equations at the end are wanted as well.
    begun : sequence of (held or more, T, c + 3) float, optional
        Derivatives by the first numbers, of each share, near where it starts.
    """
    free = tuple(free)
    counts = np.array([view.counts for view in views])
    at = [item.to_coordinate(value_of(model, item)) for item in free]
    model = with_values(model, free, [item.from_coordinate(x) for item, x in zip(free, at, strict=True)])
    residuals = [view.residual(model) for view in views]
    best = sum(map(_sum_of_squares, residuals)) + _prior_penalty(free, at)
    tables = [np.empty((len(free), *residual.shape)) for residual in residuals]
    damping, known, turn = 1e-3, 0, 0
    if initial_derivatives is not None:
        known = frozen
        for table, first in zip(tables, initial_derivatives, strict=True):
            table[:frozen] = first[:frozen]
    while turn < max_steps:
        turn += 1
        for view, residual, table in zip(views, residuals, tables, strict=True):
            derivatives(view, model, free, at, residual, table, known)
        parts = zip(views, residuals, tables, strict=True)
        total = summed_equations([_equations_of(view, free, table, residual) for view, residual, table in parts])
        improved = False
        for _ in range(6):
            moved = _point_after(at, free, _solved_step([total], free, at, damping))
            trial = with_values(model, free, [item.from_coordinate(x) for item, x in zip(free, moved, strict=True)])
            fresh = [view.residual(trial) for view in views]
            found = sum(map(_sum_of_squares, fresh)) + _prior_penalty(free, moved)
            if np.isfinite(found) and found < best:
                improved = True
                break
            damping = max(damping * 10.0, 1e-4)
        if not improved:
            if known == 0:
                break
            known, damping = 0, 1e-3
            continue
        gained = best - found
        at, model, residuals, best = moved, trial, fresh, found
        damping, little = max(damping * 0.2, 1e-9), gained < tolerance * best
        if little and (known == 0 or not with_equations):
            break
        known = 0 if little else frozen  # held derivatives may lead nowhere long before the end
    sums = None
    if with_equations:
        sums = []
        for view, residual, table in zip(views, residuals, tables, strict=True):
            derivatives(view, model, free, at, residual, table, 0)
            rows = view.stretches(residual)
            sums.append([_equations_of(view, free, table[:, part], residual[part]) for part in rows])
    squares = np.array([view.squares(r) for view, r in zip(views, residuals, strict=True)])
    return Fit(model, free, squares, counts, sums)


def _prior_penalty(free: tuple[FreeParameter, ...], at: list[np.ndarray]) -> float:
    """What numbers per texel pay for leaving their resting value."""
    return sum(
        TEXEL_PRECISION * float(np.sum((x - item.to_coordinate(item.resting_value)) ** 2))
        for item, x in zip(free, at, strict=True)
        if item.per_texel
    )


def all_equations(sums: Sequence[Sequence[NormalEquations]]) -> list[NormalEquations]:
    """Return the equations of all stretches of all trials in one list."""
    return [one for trial in sums for one in trial]


def _point_after(at: list[np.ndarray], free: tuple[FreeParameter, ...], step: list[np.ndarray]) -> list[np.ndarray]:
    """The next point: no number on a log scale by more than a factor of e², all inside their bounds."""
    moved = []
    for x, item, change in zip(at, free, step, strict=True):
        if item.log:
            change = np.clip(change, -2.0, 2.0)
        moved.append(item.to_coordinate(item.from_coordinate(x + change)))
    return moved


def derivatives(
    view: TrialView,
    model: Model,
    free: tuple[FreeParameter, ...],
    at: list[np.ndarray],
    residual: np.ndarray,
    table: np.ndarray,
    known: int,
) -> None:
    """Write what a step along each free number takes off the residual into `table` (p, T, c + 3), but the first `known`."""
    step = QUANTIZED_DIFFERENCE_STEP if any(effect.name == "quantization" for effect in model.effects) else DIFFERENCE_STEP
    for i, item in list(enumerate(free))[known:]:
        ahead = item.to_coordinate(item.from_coordinate(at[i] + step))
        moved = list(at)
        # At a bound the difference is taken inwards.
        moved[i] = np.where(ahead - at[i] > 0.5 * step, ahead, item.to_coordinate(item.from_coordinate(at[i] - step)))
        change = moved[i] - at[i]
        values = [f.from_coordinate(x) for f, x in zip(free, moved, strict=True)]
        np.subtract(residual, view.residual(with_values(model, free, values)), out=table[i])
        if item.per_texel:
            scale = np.broadcast_to(change, (len(view.predictor.rig.texels),))[view.texels]
            table[i, :, :-3] /= np.where(np.abs(scale) > 0, scale, np.inf)
            table[i, :, -3:] = 0.0
        else:
            table[i] /= float(change) if float(change) != 0.0 else np.inf


def _equations_of(view: TrialView, free: tuple[FreeParameter, ...], table: np.ndarray, residual: np.ndarray) -> NormalEquations:
    own_each = np.array([item.per_texel for item in free], bool)
    common, local = (table[~own_each], table[own_each]) if own_each.any() else (table, table[:0])
    flat = common.reshape(len(common), -1)
    n, texels, width = len(view.predictor.rig.texels), view.texels, len(view.texels)
    m = len(local)
    b, c, h = np.zeros((n, m, len(common))), np.zeros((n, m, m)), np.zeros((n, m))
    own = local[:, :, :width]
    if m:
        h[texels] = np.einsum("mtn,tn->nm", own, residual[:, :width])
        c[texels] = np.einsum("mtn,ktn->nmk", own, own)
        b[texels] = np.einsum("mtn,ptn->nmp", own, common[:, :, :width])
    starts = np.unique(np.linspace(0, len(residual), GRADIENT_BLOCKS, endpoint=False).astype(int))
    gradients = np.zeros((len(starts), n + 3, len(common)))
    per_column = np.add.reduceat(common * residual, starts, axis=1).transpose(1, 2, 0)
    gradients[:, texels], gradients[:, n:] = per_column[:, :width], per_column[:, width:]
    return NormalEquations(flat @ flat.T, flat @ residual.ravel(), b, c, h, _sum_of_squares(residual), gradients)


def summed_equations(sums: Sequence[NormalEquations]) -> NormalEquations:
    """Add equations up, all but their gradients by blocks."""
    first = sums[0]
    names = ("common", "common_gradient", "coupling", "texel", "texel_gradient", "sse")
    return replace(first, **{name: sum(getattr(s, name) for s in sums) for name in names})


def _reduced_equations(
    sums: Sequence[NormalEquations], free: tuple[FreeParameter, ...], at: list[np.ndarray], damping: float
) -> tuple[np.ndarray, ...]:
    """The damped normal equations of the common numbers, a (p, p) and rhs (p,), and how those per texel follow from them."""
    t = summed_equations(sums)
    m = t.texel_gradient.shape[1]
    a = t.common + damping * np.diag(np.diag(t.common)) + 1e-12 * (1.0 + np.trace(t.common)) * np.eye(len(t.common))
    if not m:
        return a, t.common_gradient, np.zeros((0, 0, len(a))), np.zeros((0, 0))
    loads = np.einsum("nmm->nm", t.texel)
    local = [(item, x) for item, x in zip(free, at, strict=True) if item.per_texel]
    h = t.texel_gradient - TEXEL_PRECISION * np.stack([x - item.to_coordinate(item.resting_value) for item, x in local], axis=1)
    c = t.texel + np.einsum("nm,mk->nmk", damping * loads + TEXEL_PRECISION, np.eye(m))
    follow, alone = np.linalg.solve(c, t.coupling), np.linalg.solve(c, h[:, :, None])[:, :, 0]
    return (
        a - np.einsum("nmp,nmq->pq", t.coupling, follow),
        t.common_gradient - np.einsum("nmp,nm->p", t.coupling, alone),
        follow,
        alone,
    )


def _solved_step(
    sums: Sequence[NormalEquations],
    free: tuple[FreeParameter, ...],
    at: list[np.ndarray],
    damping: float,
    known: np.ndarray | None = None,
) -> list[np.ndarray]:
    """Solve the damped normal equations; a step per free number, in its coordinate.

    With `known` (p, p), the matrix of all recordings, there is no step along what these sums tell too little of.
    """
    a, rhs, follow, alone = _reduced_equations(sums, free, at, damping)
    if known is None:
        common = np.linalg.lstsq(a, rhs, rcond=1e-13)[0]
    else:
        share, along = _information_shares(a, known)
        weight = np.where(share > LEAST_INFORMATION, 1.0 / np.maximum(share, LEAST_INFORMATION), 0.0)
        common = along @ (weight * (along.T @ rhs))
    own = alone - follow @ common
    step: list[np.ndarray] = []
    p = q = 0
    for item in free:
        if item.per_texel:
            step.append(own[:, q])
            q += 1
        else:
            step.append(common[p])
            p += 1
    return step


def _information_shares(a: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each of some directions (columns), which share of what is known of it is in `a`; ``known`` is one along them."""
    inverse = np.linalg.inv(np.linalg.cholesky(known + 1e-10 * np.diag(np.diag(known)) + 1e-300 * np.eye(len(known))))
    share, turned = np.linalg.eigh(inverse @ a @ inverse.T)
    return share, inverse.T @ turned


def held_out_squares(views: Sequence[TrialView], found: Fit) -> np.ndarray:
    """Sum of squares of each trial, of readings and of forces, predicted by a fit that has not seen it, (trials, 2) float.

    A whole trial is left out at a time. Where the others tell too little of some number (those of friction, where only one
    trial slides; those per texel), or there is one trial only, it is a stretch of a trial; what the rest does not tell even
    then stays as it is. A step that would not even fit the others better is shortened, at last to nothing.
    """
    if found.equations is None:
        return found.sse.copy()
    free, at = found.free, [item.to_coordinate(value_of(found.model, item)) for item in found.free]
    known, *_ = _reduced_equations(all_equations(found.equations), free, at, 0.0)
    local = any(item.per_texel for item in free)
    errors = np.zeros((len(views), 2))
    for left, view in enumerate(views):
        others = [one for i, trial in enumerate(found.equations) for one in trial if i != left]
        whole = (
            bool(others)
            and not local
            and _information_shares(_reduced_equations(others, free, at, 0.0)[0], known)[0].min(initial=1.0) > LEAST_INFORMATION
        )
        for parts in [list(range(view.stretch_count))] if whole else [[part] for part in range(view.stretch_count)]:
            errors[left] += _squares_left_out(views, found, left, parts, known)
    return errors


def _squares_left_out(views: Sequence[TrialView], found: Fit, left: int, parts: list[int], known: np.ndarray) -> np.ndarray:
    """Squares of some stretches of one trial under the fit to everything else."""
    assert found.equations is not None
    free, at = found.free, [item.to_coordinate(value_of(found.model, item)) for item in found.free]

    def of_left(residual: np.ndarray) -> np.ndarray:
        rows = views[left].stretches(residual)
        squares: np.ndarray = np.sum([views[left].squares(residual[rows[part]]) for part in parts], axis=0)
        return squares

    sums = [one for i, trial in enumerate(found.equations) for j, one in enumerate(trial) if i != left or j not in parts]
    if not sums:
        return of_left(views[left].residual(found.model))
    before, damping = sum(one.sse for one in sums) + _prior_penalty(free, at), 1e-6
    for _ in range(3):
        moved = _point_after(at, free, _solved_step(sums, free, at, damping, known))
        tried = with_values(found.model, free, [item.from_coordinate(x) for item, x in zip(free, moved, strict=True)])
        residuals = [view.residual(tried) for view in views]
        own = of_left(residuals[left])
        if sum(map(_sum_of_squares, residuals)) - own.sum() + _prior_penalty(free, moved) <= before * (1.0 + 1e-9):
            return own
        damping = max(1e-2, 30.0 * damping)
    return of_left(views[left].residual(found.model))


def _sum_of_squares(residual: np.ndarray) -> float:
    return float(np.einsum("ij,ij->", residual, residual))


def free_base_parameters(parameters: SensorParameters, wanted: Sequence[str], full: float) -> list[FreeParameter]:
    """Return the free numbers of the base model.

    Parameters
    ----------
    parameters : SensorParameters
        Where they start.
    wanted : sequence of str
    full : float
        Range of the readings, in the sensor's unit.
    """
    p, made = parameters, []
    for name in wanted:
        value = float(getattr(p, "mus" if name == FRICTION_LEVEL else name))
        if name in ("k", "sigma0", "x0"):
            made.append(FreeParameter(-1, name, value * 1e-5, value * 1e5, log=True))
        elif name == "cn":
            made.append(FreeParameter(-1, name, 0.0, 10.0 * p.k, scale=0.01 * p.k))
        elif name == "gain":
            size = abs(value)
            made.append(FreeParameter(-1, name, -1e6 * size, 1e6 * size, scale=size))
        elif name == "zero":
            made.append(FreeParameter(-1, name, -100 * full - abs(value), 100 * full + abs(value), scale=full))
        elif name == FRICTION_LEVEL:
            made.append(FreeParameter(-1, "mus", 1e-3, 20.0, scale=0.1, tied=("mud",)))
        elif name in ("mus", "mud"):
            made.append(FreeParameter(-1, name, 0.0, 20.0, scale=0.1))
        else:
            made.append(FreeParameter(-1, name, 0.0, 1e6, scale=max(value, 1e-3)))
    return made
