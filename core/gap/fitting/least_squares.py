# SPDX-License-Identifier: GPL-3.0-or-later
"""Nonlinear least squares on several trials at once, with common parameters and parameters of single texels.

The fit takes Levenberg–Marquardt steps on normal equations that are summed per trial. A parameter of single texels acts on its
own texel only. Its column of the Jacobian therefore costs one evaluation for all texels together, and its block of the
equations is block-diagonal: the common parameters are solved for first (Schur complement).

For cross-validation stretches are left out by taking their equations out of the sum. One Newton step from the common fit gives
the fit without them (Beirami et al., "On optimal generalizability in parametric learning", NeurIPS 2017).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ...compiled.kernels import kernel
from ...model.sensor_parameters import SensorParameters
from ..forward.predictor import Model, Predictor

DIFFERENCE_STEP = 1e-3
"""Step of finite differences in the coordinate of a parameter (see :meth:`FreeParameter.to_coordinate`)."""
QUANTIZED_DIFFERENCE_STEP = 0.03
"""The same for models with quantised readings: a staircase has a slope only over distances that cross its edges."""
TEXEL_PRECISION = 10.0
"""Prior precision (inverse variance) of a parameter of single texels about its resting value, in its coordinate.

It lets the gain of a texel without data vary by ± 0.3.
"""
BASE, RECORDING = -1, -2
"""In place of an effect's index: a parameter of the base model, and a number of recordings."""
FRICTION_LEVEL = "mus and mud"
"""Both friction coefficients as one free parameter that scales them alike."""
GRADIENT_BLOCKS = 12
"""Number of blocks of time per stretch in which gradients are summed; a block is long against the correlation of the noise."""
LEAST_INFORMATION = 0.1
"""Least share of a parameter's information in all trials that some trials must have for the parameter to be fitted to them."""
FIRST_DAMPING, LEAST_DAMPING = 1e-3, 1e-9
"""Levenberg–Marquardt damping at the start, and its lower bound."""
DAMPING_UP, DAMPING_DOWN, RAISED_DAMPING = 10.0, 0.2, 1e-4
"""Factors after a step that fails and after one that succeeds, and the least damping after one that fails."""
TRIES_PER_STEP = 6
LARGEST_LOG_STEP = 2.0
"""Largest step of a parameter on a logarithmic scale: a factor of e²."""


@dataclass(frozen=True)
class FreeParameter:
    """A parameter that is fitted: one number, or one for each texel.

    Attributes
    ----------
    effect : int
        Index of the effect in the model's stack; :data:`BASE` for a parameter of the base model, :data:`RECORDING` for a number
        of recordings.
    name : str
    low, high : float or (n,) float
        Bounds; equal where a texel keeps its value.
    log : bool
        True if it is fitted on a logarithmic scale.
    scale : float
        A change that matters, for parameters that are not on a logarithmic scale.
    per_texel : bool
    resting_value : float
        Mean of the prior of a parameter of single texels (see :data:`TEXEL_PRECISION`).
    tied : tuple of str
        Other parameters of the base model that keep their ratio to it.
    """

    effect: int
    name: str
    low: Any
    high: Any
    log: bool = False
    scale: float = 1.0
    per_texel: bool = False
    resting_value: float = 0.0
    tied: tuple[str, ...] = ()

    def to_coordinate(self, value: np.ndarray | float) -> np.ndarray:
        """Return the coordinate of a value in the fit: its logarithm, or its ratio to the scale."""
        value = self._inside(np.asarray(value, float))
        return np.log(value) if self.log else value / self.scale

    def from_coordinate(self, coordinate: np.ndarray | float) -> np.ndarray:
        """Return the value at a coordinate, inside the bounds."""
        value = np.exp(np.clip(coordinate, -700, 700)) if self.log else np.asarray(coordinate) * self.scale
        return self._inside(value)

    def number_count(self, texels: int) -> int:
        """Return how many numbers are fitted."""
        return int(np.broadcast_to(np.less(self.low, self.high), texels if self.per_texel else 1).sum())

    def _inside(self, value: np.ndarray) -> np.ndarray:
        """The value inside the bounds; `numpy.clip` takes five times as long for single numbers."""
        return np.minimum(np.maximum(value, self.low), self.high)


def value_of(model: Model, free: FreeParameter) -> np.ndarray | float:
    """Return the value of a free parameter in a model: a number, or (n,) float for a parameter of single texels."""
    if free.effect == RECORDING:
        return model.recordings[free.name]
    if free.effect == BASE:
        return float(getattr(model.parameters, free.name))
    return np.asarray(model.effects[free.effect].values[free.name], float)


def coordinates_of(model: Model, free: Sequence[FreeParameter]) -> list[np.ndarray]:
    """Return the coordinates of a model's free parameters, each a float or (n,) float."""
    return [item.to_coordinate(value_of(model, item)) for item in free]


def with_coordinates(model: Model, free: Sequence[FreeParameter], at: Sequence[np.ndarray]) -> Model:
    """Return a model with free parameters at other coordinates."""
    return with_values(model, free, [item.from_coordinate(x) for item, x in zip(free, at, strict=True)])


def with_values(model: Model, free: Sequence[FreeParameter], values: Sequence[np.ndarray | float]) -> Model:
    """Return a model with other values of its free parameters.

    Tied parameters follow. `mud` is lowered to `mus` if it would exceed it.
    """
    base: dict[str, Any] = {}
    recordings = dict(model.recordings)
    stacks: dict[int, dict[str, float | tuple[float, ...]]] = {}
    for item, value in zip(free, values, strict=True):
        if item.effect == RECORDING:
            recordings[item.name] = float(value)
        elif item.effect == BASE:
            base[item.name] = float(value)
            grows = float(value) / max(float(getattr(model.parameters, item.name)), 1e-12) if item.tied else 1.0
            base |= {name: grows * float(getattr(model.parameters, name)) for name in item.tied}
        else:
            plain = tuple(np.asarray(value).tolist()) if item.per_texel else float(value)
            stacks.setdefault(item.effect, {})[item.name] = plain
    changed = any(getattr(model.parameters, name) != value for name, value in base.items())
    parameters = replace(model.parameters, **base) if changed else model.parameters
    if parameters.mud > parameters.mus:
        parameters = replace(parameters, mud=parameters.mus)
    effects = list(model.effects)
    for index, new in stacks.items():
        old = effects[index].values
        if any(old[name] != value for name, value in new.items()):
            effects[index] = replace(effects[index], values={**old, **new})
    return Model(parameters, tuple(effects), recordings)


@dataclass(frozen=True)
class TrialView:
    """A part of a trial: some texels and samples, with the residual of any model on them.

    Attributes
    ----------
    predictor : Predictor
    subset : (c,) int or None
        Texels; None for all. Only the whole set is right for effects that couple texels.
    samples : slice
    noise : (float, float)
        Standard deviation of readings and of forces, in their units.
    stretch_count : int
        Number of stretches of time into which the trial is cut if a part of it has to be left out of a fit.
    with_forces : bool
        True if measured net forces are part of the residual.
    force_weight : float
        Weight of the squares of forces relative to those of readings; each force counts as so many values.
    """

    predictor: Predictor
    subset: np.ndarray | None = None
    samples: slice = field(default_factory=lambda: slice(None))
    noise: tuple[float, float] = (1.0, 1.0)
    stretch_count: int = 1
    with_forces: bool = True
    force_weight: float = 1.0

    def stretches(self, residual: np.ndarray) -> list[slice]:
        """Return the stretches of time that are left out one after the other, as rows of a residual."""
        edges = np.linspace(0, len(residual), self.stretch_count + 1).astype(int)
        return [slice(a, b) for a, b in pairwise(edges)]

    @property
    def texels(self) -> np.ndarray:
        """Indices of the texels, (c,) int."""
        return np.arange(len(self.predictor.rig.texels)) if self.subset is None else self.subset

    @cached_property
    def _measured(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Measured readings of the texels, and net forces; None for what was not measured or is no part of the residual."""
        reading, force = self.predictor.trial.reading, self.predictor.trial.force if self.with_forces else None
        if reading is not None:
            reading = np.ascontiguousarray(reading[:, self.texels][self.samples], dtype=float)
        return reading, None if force is None else np.ascontiguousarray(force[self.samples], dtype=float)

    def residual(self, model: Model) -> np.ndarray:
        """Return measured minus predicted values in units of the noise, (T, c + 3); zero if a value is missing.

        The first c columns are readings of the texels, the last three components of the net force times the root of
        their weight.
        """
        predicted = self.predictor.predict(model, self.subset, self.with_forces)
        reading, force = self._measured
        width = len(self.texels)
        out = np.zeros((len(self.predictor.trial.time[self.samples]), width + 3))
        if reading is not None:
            write_differences(reading, np.ascontiguousarray(predicted.reading[self.samples]), self.noise[0], out, 0)
        if predicted.force is not None and force is not None:
            unit = self.noise[1] / np.sqrt(self.force_weight)
            write_differences(force, np.ascontiguousarray(predicted.force[self.samples]), unit, out, width)
        return out

    @cached_property
    def counts(self) -> np.ndarray:
        """Number of measured values of readings and of forces, (2,) float, those of forces by their weight."""
        reading, force = (0 if part is None else np.isfinite(part).sum() for part in self._measured)
        return np.array([reading, self.force_weight * force], float)

    def squares(self, residual: np.ndarray) -> np.ndarray:
        """Return the sum of squares of readings and of forces in a residual or a part of it, (2,) float."""
        width = len(self.texels)
        return np.array([_sum_of_squares(residual[:, :width]), _sum_of_squares(residual[:, width:])])


@kernel
def write_differences(measured, predicted, noise, out, first):  # type: ignore[no-untyped-def]
    """Write measured minus predicted values in units of the noise into the columns from `first` on, zero for missing ones."""
    for i in range(measured.shape[0]):
        for j in range(measured.shape[1]):
            value = measured[i, j]
            out[i, first + j] = (value - predicted[i, j]) / noise if np.isfinite(value) else 0.0


@kernel
def write_quotients(before, after, change, out):  # type: ignore[no-untyped-def]
    """Write the difference of two residuals (T, c) over a change of each column (c,)."""
    for i in range(before.shape[0]):
        for j in range(before.shape[1]):
            out[i, j] = (before[i, j] - after[i, j]) / change[j]


@dataclass
class NormalEquations:
    """Normal equations ``A x = g`` of one stretch of a trial, for p common parameters and m parameters of each of n texels.

    Attributes
    ----------
    common, common_gradient : (p, p), (p,) float
        Block of A of the common parameters, and their part of g.
    coupling : (n, m, p) float
        Blocks of A between the parameters of each texel and the common ones.
    texel, texel_gradient : (n, m, m), (n, m) float
        Blocks of A of each texel's own parameters, and their part of g.
    sse : float
        Sum of squares of the residual.
    gradients : (blocks, n + 3, p) float
        Parts of `common_gradient` from each texel and each component of the force, by blocks of time. There are no blocks in
        the steps of a fit, which does not need them.
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
        Sum of squares of the residuals of each trial, of readings and of forces, in units of the noise.
    count : (trials, 2) float
        Number of measured values, as they are weighted.
    equations : list of list of NormalEquations, or None
        At the end of the fit, by trial and stretch.
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
    """Fit the free parameters of a model by Levenberg–Marquardt steps.

    Parameters
    ----------
    views : sequence of TrialView
    model : Model
        Where the fit starts.
    free : sequence of FreeParameter
    max_steps : int
    tolerance : float
        The fit ends when the sum of squares decreases by less than this share of it.
    frozen : int
        Derivatives by the first `frozen` parameters are computed once and kept for all steps, unless no step with them leads
        down. This takes more steps and ends at the same place.
    with_equations : bool
        True if the normal equations at the end are wanted as well.
    initial_derivatives : sequence of (frozen or more, T, c + 3) float, optional
        Derivatives by the first parameters, for each view, near the start.
    """
    free = tuple(free)
    point = _Point(views, model, free, coordinates_of(model, free))
    tables = [np.empty((len(free), *residual.shape)) for residual in point.residuals]
    damping, known = FIRST_DAMPING, 0 if initial_derivatives is None else frozen
    for table, first in zip(tables, initial_derivatives or (), strict=initial_derivatives is not None):
        table[:frozen] = first[:frozen]
    complete = False  # whether the tables hold all derivatives at the point, or a step away that changed next to nothing
    for _ in range(max_steps):
        parts = list(zip(views, point.residuals, tables, strict=True))
        for view, residual, table in parts:
            derivatives(view, point.model, free, point.at, residual, table, known)
        complete = known == 0
        total = summed_equations([_equations_of(view, free, table, residual) for view, residual, table in parts])
        better, damping = _better_point(views, free, point, total, damping)
        if better is None:
            if complete:
                break
            known, damping = 0, FIRST_DAMPING
            continue
        little = point.objective - better.objective < tolerance * better.objective
        point, damping = better, max(damping * DAMPING_DOWN, LEAST_DAMPING)
        if little and (complete or not with_equations):
            break
        complete = False
        known = 0 if little else frozen  # with frozen derivatives steps may become small long before the minimum
    equations = _equations_by_stretch(views, free, point, tables, complete) if with_equations else None
    squares = np.array([view.squares(r) for view, r in zip(views, point.residuals, strict=True)])
    return Fit(point.model, free, squares, np.array([view.counts for view in views]), equations)


def _better_point(
    views: Sequence[TrialView], free: tuple[FreeParameter, ...], point: _Point, total: NormalEquations, damping: float
) -> tuple[_Point | None, float]:
    """Raise the damping until a step leads down; the point after that step and the damping, or None if no step does."""
    for _ in range(TRIES_PER_STEP):
        tried = _Point(views, point.model, free, _after_step(total, free, point.at, damping))
        if tried.objective < point.objective:
            return tried, damping
        damping = max(damping * DAMPING_UP, RAISED_DAMPING)
    return None, damping


def _equations_by_stretch(
    views: Sequence[TrialView], free: tuple[FreeParameter, ...], point: _Point, tables: list[np.ndarray], complete: bool
) -> list[list[NormalEquations]]:
    """Normal equations of each stretch of each trial; derivatives are computed again unless the tables are `complete`."""
    equations = []
    for view, residual, table in zip(views, point.residuals, tables, strict=True):
        if not complete:
            derivatives(view, point.model, free, point.at, residual, table, 0)
        rows = view.stretches(residual)
        equations.append([_equations_of(view, free, table[:, part], residual[part], GRADIENT_BLOCKS) for part in rows])
    return equations


class _Point:
    """A point of a fit: coordinates of the free parameters, the model there, its residuals and the objective."""

    def __init__(self, views: Sequence[TrialView], model: Model, free: Sequence[FreeParameter], at: list[np.ndarray]):
        self.at, self.model = at, with_coordinates(model, free, at)
        self.residuals = [view.residual(self.model) for view in views]
        self.objective = sum(map(_sum_of_squares, self.residuals)) + _prior_penalty(free, at)


def _prior_penalty(free: Sequence[FreeParameter], at: list[np.ndarray]) -> float:
    """Squares that the prior adds for parameters of single texels away from their resting values."""
    return sum(
        TEXEL_PRECISION * float(np.sum((x - item.to_coordinate(item.resting_value)) ** 2))
        for item, x in zip(free, at, strict=True)
        if item.per_texel
    )


def derivatives(
    view: TrialView,
    model: Model,
    free: Sequence[FreeParameter],
    at: list[np.ndarray],
    residual: np.ndarray,
    table: np.ndarray,
    known: int,
) -> None:
    """Write by how much a step along each free parameter lowers the residual into a table.

    Parameters
    ----------
    view : TrialView
    model : Model
    free : tuple of FreeParameter
    at : list of float or (n,) float
        Coordinates of the free parameters in the model.
    residual : (T, c + 3) float
        Of the model.
    table : (p, T, c + 3) float
        Written to; for a parameter of single texels each column is the derivative by that of its own texel.
    known : int
        The first `known` derivatives are in the table already.
    """
    step = QUANTIZED_DIFFERENCE_STEP if model.is_stepped else DIFFERENCE_STEP
    here = [item.from_coordinate(x) for item, x in zip(free, at, strict=True)]
    for i, item in list(enumerate(free))[known:]:
        ahead = item.to_coordinate(item.from_coordinate(at[i] + step))
        # At a bound the difference is taken inwards.
        moved = np.where(ahead - at[i] > 0.5 * step, ahead, item.to_coordinate(item.from_coordinate(at[i] - step)))
        change = moved - at[i]
        of_texels = np.broadcast_to(change, (len(view.predictor.rig.texels),))[view.texels]
        over = np.append(of_texels, [np.inf if item.per_texel else change] * 3)
        over[over == 0.0] = np.inf
        values = [*here[:i], item.from_coordinate(moved), *here[i + 1 :]]
        write_quotients(residual, view.residual(with_values(model, free, values)), over, table[i])


def _equations_of(
    view: TrialView, free: Sequence[FreeParameter], table: np.ndarray, residual: np.ndarray, blocks: int = 0
) -> NormalEquations:
    """Normal equations of some rows of a trial, with the gradients of so many blocks of time."""
    own_each = np.array([item.per_texel for item in free], bool)
    common, local = (table[~own_each], table[own_each]) if own_each.any() else (table, table[:0])
    flat = common.reshape(len(common), residual.size)  # there may be none, where all of the base model is known
    n, texels, width = len(view.predictor.rig.texels), view.texels, len(view.texels)
    m, own = len(local), local[:, :, :width]
    b, c, h = np.zeros((n, m, len(common))), np.zeros((n, m, m)), np.zeros((n, m))
    if m:
        h[texels] = np.einsum("mtn,tn->nm", own, residual[:, :width])
        c[texels] = np.einsum("mtn,ktn->nmk", own, own)
        b[texels] = np.einsum("mtn,ptn->nmp", own, common[:, :, :width])
    starts = np.unique(np.linspace(0, len(residual), blocks, endpoint=False).astype(int))
    gradients = np.zeros((len(starts), n + 3, len(common)))
    if blocks:
        per_column = np.add.reduceat(common * residual, starts, axis=1).transpose(1, 2, 0)
        gradients[:, texels], gradients[:, n:] = per_column[:, :width], per_column[:, width:]
    return NormalEquations(flat @ flat.T, flat @ residual.ravel(), b, c, h, _sum_of_squares(residual), gradients)


def summed_equations(equations: Sequence[NormalEquations]) -> NormalEquations:
    """Return the sum of normal equations; the gradients by blocks are those of the first."""
    names = ("common", "common_gradient", "coupling", "texel", "texel_gradient", "sse")
    return replace(equations[0], **{name: sum(getattr(one, name) for one in equations) for name in names})


def _reduced_equations(
    t: NormalEquations, free: Sequence[FreeParameter], at: list[np.ndarray], damping: float, held: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Eliminate the parameters of single texels from damped normal equations (Schur complement).

    With `held`, (n, m) bool, those of some texels keep their values, and the prior of the others is about where they are:
    what a part of the trials says nothing about stays as the whole of them and the prior have it.

    Returns the matrix (p, p) and right-hand side (p,) of the common parameters. Of the parameters of single texels it returns
    how they follow the common ones (n, m, p), and their step if these stay (n, m).
    """
    m = t.texel_gradient.shape[1]
    a = t.common + damping * np.diag(np.diag(t.common)) + 1e-12 * (1.0 + np.trace(t.common)) * np.eye(len(t.common))
    if not m:
        return a, t.common_gradient, np.zeros((0, 0, len(a))), np.zeros((0, 0))
    local = [(item, x) for item, x in zip(free, at, strict=True) if item.per_texel]
    h = t.texel_gradient - TEXEL_PRECISION * np.stack([x - item.to_coordinate(item.resting_value) for item, x in local], axis=1)
    loads, coupling = damping * _texel_information(t) + TEXEL_PRECISION, t.coupling
    c = t.texel + np.einsum("nm,mk->nmk", loads, np.eye(m))
    if held is not None:
        moves = ~held
        h, coupling = t.texel_gradient * moves, coupling * moves[:, :, None]
        c = np.where(moves[:, :, None] & moves[:, None], c, np.eye(m))
    follow, alone = np.linalg.solve(c, coupling), np.linalg.solve(c, h[:, :, None])[:, :, 0]
    a, rhs = a - np.einsum("nmp,nmq->pq", coupling, follow), t.common_gradient - np.einsum("nmp,nm->p", coupling, alone)
    return a, rhs, follow, alone


def _after_step(
    total: NormalEquations,
    free: Sequence[FreeParameter],
    at: list[np.ndarray],
    damping: float,
    whole: NormalEquations | None = None,
) -> list[np.ndarray]:
    """Coordinates after a step that solves damped normal equations, inside the bounds; steps of logarithms are limited.

    With the equations of the `whole` of the trials there is no step in directions, and of parameters of single texels, about
    which these equations have too little information.
    """
    held = None if whole is None else _texel_information(total) <= LEAST_INFORMATION * _texel_information(whole)
    a, rhs, follow, alone = _reduced_equations(total, free, at, damping, held)
    if whole is None:
        common = np.linalg.lstsq(a, rhs, rcond=1e-13)[0]
    else:
        # The directions are those in which the information of the whole is one, and that of these equations its share.
        known = _reduced_equations(whole, free, at, 0.0, held)[0]
        inverse = np.linalg.inv(np.linalg.cholesky(known + 1e-10 * np.diag(np.diag(known)) + 1e-300 * np.eye(len(known))))
        share, turned = np.linalg.eigh(inverse @ a @ inverse.T)
        along = inverse.T @ turned
        weight = np.where(share > LEAST_INFORMATION, 1.0 / np.maximum(share, LEAST_INFORMATION), 0.0)
        common = along @ (weight * (along.T @ rhs))
    shared, own = iter(common), iter((alone - follow @ common).T)
    moved = []
    for x, item in zip(at, free, strict=True):
        change = next(own if item.per_texel else shared)
        if item.log:
            change = np.clip(change, -LARGEST_LOG_STEP, LARGEST_LOG_STEP)
        moved.append(item.to_coordinate(item.from_coordinate(x + change)))
    return moved


def _texel_information(equations: NormalEquations) -> np.ndarray:
    """Information about each parameter of each texel, (n, m) float."""
    return np.diagonal(equations.texel, axis1=1, axis2=2)


def cross_fitted(found: Fit, views: Sequence[TrialView], seen: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return residuals of every stretch under a fit that has not seen it: of two folds of alternating ones, that to the other.

    Parameters about which a fold has too little information keep their values. If the Newton step does not even fit the other
    fold better, it is shortened, at last to nothing.

    Parameters
    ----------
    found : Fit
        With equations.
    views : sequence of TrialView
        To which it was fitted.
    seen : sequence of (T, c + 3) float
        Its residuals.
    """
    if found.equations is None or not found.free:
        return list(seen)
    free, at = found.free, coordinates_of(found.model, found.free)
    whole = summed_equations([one for trial in found.equations for one in trial])
    stretches = [view.stretches(residual) for view, residual in zip(views, seen, strict=True)]
    out = [residual.copy() for residual in seen]
    for fold in (0, 1):
        total = summed_equations([one for trial in found.equations for one in trial[1 - fold :: 2]])
        before, damping = total.sse + _prior_penalty(free, at), 1e-6
        for _ in range(3):
            moved = _after_step(total, free, at, damping, whole)
            model = with_coordinates(found.model, free, moved)
            residuals = [view.residual(model) for view in views]
            fitted = [r[part] for r, parts in zip(residuals, stretches, strict=True) for part in parts[1 - fold :: 2]]
            if sum(map(_sum_of_squares, fitted)) + _prior_penalty(free, moved) <= before * (1.0 + 1e-9):
                for unseen, r, parts in zip(out, residuals, stretches, strict=True):
                    for part in parts[fold::2]:
                        unseen[part] = r[part]
                break
            damping = max(1e-2, 30.0 * damping)
    return out


def _sum_of_squares(residual: np.ndarray) -> float:
    return float(np.einsum("ij,ij->", residual, residual))


def free_base_parameters(parameters: SensorParameters, wanted: Sequence[str], full: float) -> list[FreeParameter]:
    """Return free parameters of the base model.

    Parameters
    ----------
    parameters : SensorParameters
        Where they start.
    wanted : sequence of str
        Their names; :data:`FRICTION_LEVEL` is one parameter for both friction coefficients.
    full : float
        Range of the readings, in the sensor's unit.
    """

    def free(name: str) -> FreeParameter:
        if name == FRICTION_LEVEL:
            return FreeParameter(BASE, "mus", 1e-3, 20.0, scale=0.1, tied=("mud",))
        value = float(getattr(parameters, name))
        if name in ("k", "sigma0", "x0"):
            return FreeParameter(BASE, name, value * 1e-5, value * 1e5, log=True)
        low, high, scale = {
            "cn": (0.0, 10.0 * parameters.k, 0.01 * parameters.k),
            "gain": (-1e6 * abs(value), 1e6 * abs(value), abs(value)),
            "zero": (-100 * full - abs(value), 100 * full + abs(value), full),
            "mus": (0.0, 20.0, 0.1),
            "mud": (0.0, 20.0, 0.1),
        }.get(name, (0.0, 1e6, max(value, 1e-3)))
        return FreeParameter(BASE, name, low, high, scale=scale)

    return list(map(free, wanted))
