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

from ...effects.engine.registry import form_of
from ...model.effect import Effect
from ...model.sensor_parameters import SensorParameters
from ..forward.predictor import Model, Predictor

STEP = 1e-3
"""Of the finite differences: in the logarithm of a number, or as a share of the size of one that is not on a log scale."""


COARSE = 0.03
"""The same for models whose readings come in steps: a staircase has no slope but across its edges."""
PRIOR = 10.0
"""Inverse variance of a number per texel about its resting value, in its coordinate: a gain is within ± 0.3 unseen."""
FRICTION = ("mus", "mud", "sigma0", "x0", "ct")
"""Parameters of the base model that show in net forces alone."""
LEVEL = "mus and mud"
"""Both friction coefficients as one number, by which they grow alike."""
BLOCKS = 12
"""Blocks of time of each stretch in which gradients are summed, each long against the memory of the noise."""
TOLD = 0.1
"""Least share of what all recordings tell of a number that some of them must tell, to find it from them."""


@dataclass(frozen=True)
class Free:
    """One number that is fitted, or one per texel.

    Attributes
    ----------
    effect : int
        Index in the model's stack; -1 for a parameter of the base model.
    name : str
    low, high : float
    log : bool
    size : float
        A change that matters, for numbers that are not on a log scale.
    per_texel : bool
    rest : float
        Value from which a number per texel departs only as far as the recording says so (see :data:`PRIOR`).
    along : tuple of str
        Other parameters of the base model that keep their ratio to it.
    """

    effect: int
    name: str
    low: float
    high: float
    log: bool = False
    size: float = 1.0
    per_texel: bool = False
    rest: float = 0.0
    along: tuple[str, ...] = ()

    def to(self, value: np.ndarray | float) -> np.ndarray:
        """Value → coordinate of the fit."""
        value = np.clip(np.asarray(value, float), self.low, self.high)
        return np.log(value) if self.log else value / self.size

    def back(self, coordinate: np.ndarray | float) -> np.ndarray:
        """Coordinate → value, inside the bounds."""
        value = np.exp(np.clip(coordinate, -700, 700)) if self.log else np.asarray(coordinate) * self.size
        return np.clip(value, self.low, self.high)


def value_of(model: Model, free: Free) -> np.ndarray | float:
    """Return what a model has for a free number."""
    if free.effect < 0:
        return float(getattr(model.parameters, free.name))
    return np.asarray(model.effects[free.effect].values[free.name], float)


def changed(model: Model, free: Sequence[Free], values: Sequence[np.ndarray | float]) -> Model:
    """Return a model with other values for its free numbers."""
    base: dict[str, Any] = {}
    stacks: dict[int, dict[str, float | tuple[float, ...]]] = {}
    for item, value in zip(free, values, strict=True):
        if item.effect < 0:
            base[item.name] = float(value)
            grows = float(value) / max(float(getattr(model.parameters, item.name)), 1e-12) if item.along else 1.0
            base |= {name: grows * float(getattr(model.parameters, name)) for name in item.along}
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


def is_local(effect: Effect, name: str) -> bool:
    """Whether a parameter of an effect has a number for each texel."""
    return any(p.name == name and p.per_texel for p in form_of(effect.name, effect.form).parameters)


@dataclass(frozen=True)
class Share:
    """The part of a trial that is looked at: texels and samples, with weights that are zero where a value is missing.

    Attributes
    ----------
    predictor : Predictor
    columns : (c,) int or None
        Texels; None: all, also to the effects that let texels feel their neighbours.
    rows : slice
    noise : (float, float)
        Standard deviation of readings and of forces, in their units.
    parts : int
        Into how many stretches of time the trial is cut for judging on what was not seen.
    forces : bool
        Whether net forces count where they were measured.
    """

    predictor: Predictor
    columns: np.ndarray | None = None
    rows: slice = field(default_factory=lambda: slice(None))
    noise: tuple[float, float] = (1.0, 1.0)
    parts: int = 1
    forces: bool = True

    def stretches(self, residual: np.ndarray) -> list[slice]:
        """Return the stretches of time that are left out in turn, as rows of a residual."""
        edges = np.linspace(0, len(residual), self.parts + 1).astype(int)
        return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]

    @property
    def texels(self) -> np.ndarray:
        """(c,) int."""
        return np.arange(len(self.predictor.rig.texels)) if self.columns is None else self.columns

    @cached_property
    def _measured(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Readings of the texels, and where they are missing if any is."""
        reading = self.predictor.trial.reading
        if reading is None:
            return None, None
        reading = reading[:, self.texels][self.rows]
        missing = ~np.isfinite(reading)
        return reading, missing if missing.any() else None

    def residual(self, model: Model) -> np.ndarray:
        """Measured minus predicted in units of the noise, (T, c + 3); zero where nothing was measured."""
        trial = self.predictor.trial
        predicted = self.predictor.predict(model, self.columns, self.forces)
        reading, missing = self._measured
        width = len(self.texels)
        out = np.zeros((len(trial.time[self.rows]), width + 3))
        if reading is not None:
            np.subtract(reading, predicted.reading[self.rows], out=out[:, :width])
            out[:, :width] /= self.noise[0]
            if missing is not None:
                out[:, :width][missing] = 0.0
        if predicted.force is not None:
            out[:, width:] = np.nan_to_num((trial.force - predicted.force)[self.rows] / self.noise[1])
        return out

    @cached_property
    def counts(self) -> np.ndarray:
        """How many values were measured, (2,) int: of readings, and of forces."""
        trial, number = self.predictor.trial, np.zeros(2, int)
        if trial.reading is not None:
            number[0] = np.isfinite(trial.reading[self.rows][:, self.texels]).sum()
        if trial.force is not None and self.forces:
            number[1] = np.isfinite(trial.force[self.rows]).sum()
        return number

    def squares(self, residual: np.ndarray) -> np.ndarray:
        """Sum of squares of (some samples of) a residual, (2,) float: of readings, and of forces."""
        width = len(self.texels)
        return np.array([_square(residual[:, :width]), _square(residual[:, width:])])


@dataclass
class Sums:
    """Normal equations of one trial: p common numbers, m per texel on n texels.

    Attributes
    ----------
    a, g : (p, p), (p,)
    b : (n, m, p)
    c, h : (n, m, m), (n, m)
    sse : float
    gradients : (blocks, n + 3, p)
        Share in `g` of each texel, and of each component of the force, by blocks of time.
    """

    a: np.ndarray
    g: np.ndarray
    b: np.ndarray
    c: np.ndarray
    h: np.ndarray
    sse: float
    gradients: np.ndarray


@dataclass
class Fit:
    """A fitted model.

    Attributes
    ----------
    model : Model
    free : tuple of Free
    sse : (trials, 2) float
        Sum of squares per trial, of readings and of forces, in units of the noise.
    count : (trials, 2) int
    sums : list of list of Sums, or None
        By trial and stretch.
    """

    model: Model
    free: tuple[Free, ...]
    sse: np.ndarray
    count: np.ndarray
    sums: list[list[Sums]] | None = None

    @property
    def mean(self) -> float:
        """Mean square of the residual in units of the noise's variance."""
        return float(self.sse.sum() / max(self.count.sum(), 1))


def fit(
    shares: Sequence[Share],
    model: Model,
    free: Sequence[Free],
    turns: int = 15,
    tolerance: float = 1e-5,
    held: int = 0,
    judged: bool = True,
    begun: Sequence[np.ndarray] | None = None,
) -> Fit:
    """Fit a model's free numbers by Levenberg–Marquardt steps.

    Parameters
    ----------
    shares : sequence of Share
    model : Model
        Where to start.
    free : sequence of Free
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
    counts = np.array([share.counts for share in shares])
    at = [item.to(value_of(model, item)) for item in free]
    model = changed(model, free, [item.back(x) for item, x in zip(free, at, strict=True)])
    residuals = [share.residual(model) for share in shares]
    best = sum(map(_square, residuals)) + _penalty(free, at)
    tables = [np.empty((len(free), *residual.shape)) for residual in residuals]
    damping, known, turn = 1e-3, 0, 0
    if begun is not None:
        known = held
        for table, first in zip(tables, begun, strict=True):
            table[:held] = first[:held]
    while turn < turns:
        turn += 1
        for share, residual, table in zip(shares, residuals, tables, strict=True):
            derivatives(share, model, free, at, residual, table, known)
        parts = zip(shares, residuals, tables, strict=True)
        total = total_of([_sum_of(share, free, table, residual) for share, residual, table in parts])
        improved = False
        for _ in range(6):
            moved = _moved(at, free, _step([total], free, at, damping))
            trial = changed(model, free, [item.back(x) for item, x in zip(free, moved, strict=True)])
            fresh = [share.residual(trial) for share in shares]
            found = sum(map(_square, fresh)) + _penalty(free, moved)
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
        if little and (known == 0 or not judged):
            break
        known = 0 if little else held  # held derivatives may lead nowhere long before the end
    sums = None
    if judged:
        sums = []
        for share, residual, table in zip(shares, residuals, tables, strict=True):
            derivatives(share, model, free, at, residual, table, 0)
            rows = share.stretches(residual)
            sums.append([_sum_of(share, free, table[:, part], residual[part]) for part in rows])
    squares = np.array([share.squares(r) for share, r in zip(shares, residuals, strict=True)])
    return Fit(model, free, squares, counts, sums)


def _penalty(free: tuple[Free, ...], at: list[np.ndarray]) -> float:
    """What numbers per texel pay for leaving their resting value."""
    return sum(PRIOR * float(np.sum((x - item.to(item.rest)) ** 2)) for item, x in zip(free, at, strict=True) if item.per_texel)


def flattened(sums: Sequence[Sequence[Sums]]) -> list[Sums]:
    """Return the equations of all stretches of all trials in one list."""
    return [one for trial in sums for one in trial]


def _moved(at: list[np.ndarray], free: tuple[Free, ...], step: list[np.ndarray]) -> list[np.ndarray]:
    """The next point: no number on a log scale by more than a factor of e², all inside their bounds."""
    moved = []
    for x, item, change in zip(at, free, step, strict=True):
        if item.log:
            change = np.clip(change, -2.0, 2.0)
        moved.append(item.to(item.back(x + change)))
    return moved


def derivatives(
    share: Share,
    model: Model,
    free: tuple[Free, ...],
    at: list[np.ndarray],
    residual: np.ndarray,
    table: np.ndarray,
    known: int,
) -> None:
    """Write what a step along each free number takes off the residual into `table` (p, T, c + 3), but the first `known`."""
    step = COARSE if any(effect.name == "quantization" for effect in model.effects) else STEP
    for i, item in list(enumerate(free))[known:]:
        ahead = item.to(item.back(at[i] + step))
        moved = list(at)
        # At a bound the difference is taken inwards.
        moved[i] = np.where(ahead - at[i] > 0.5 * step, ahead, item.to(item.back(at[i] - step)))
        change = moved[i] - at[i]
        values = [f.back(x) for f, x in zip(free, moved, strict=True)]
        np.subtract(residual, share.residual(changed(model, free, values)), out=table[i])
        if item.per_texel:
            scale = np.broadcast_to(change, (len(share.predictor.rig.texels),))[share.texels]
            table[i, :, :-3] /= np.where(np.abs(scale) > 0, scale, np.inf)
            table[i, :, -3:] = 0.0
        else:
            table[i] /= float(change) if float(change) != 0.0 else np.inf


def _sum_of(share: Share, free: tuple[Free, ...], table: np.ndarray, residual: np.ndarray) -> Sums:
    own_each = np.array([item.per_texel for item in free], bool)
    common, local = (table[~own_each], table[own_each]) if own_each.any() else (table, table[:0])
    flat = common.reshape(len(common), -1)
    n, texels, width = len(share.predictor.rig.texels), share.texels, len(share.texels)
    m = len(local)
    b, c, h = np.zeros((n, m, len(common))), np.zeros((n, m, m)), np.zeros((n, m))
    own = local[:, :, :width]
    if m:
        h[texels] = np.einsum("mtn,tn->nm", own, residual[:, :width])
        c[texels] = np.einsum("mtn,ktn->nmk", own, own)
        b[texels] = np.einsum("mtn,ptn->nmp", own, common[:, :, :width])
    starts = np.unique(np.linspace(0, len(residual), BLOCKS, endpoint=False).astype(int))
    gradients = np.zeros((len(starts), n + 3, len(common)))
    per_column = np.add.reduceat(common * residual, starts, axis=1).transpose(1, 2, 0)
    gradients[:, texels], gradients[:, n:] = per_column[:, :width], per_column[:, width:]
    return Sums(flat @ flat.T, flat @ residual.ravel(), b, c, h, _square(residual), gradients)


def total_of(sums: Sequence[Sums]) -> Sums:
    """Add equations up, all but their gradients by blocks."""
    first = sums[0]
    names = ("a", "g", "b", "c", "h", "sse")
    return replace(first, **{name: sum(getattr(s, name) for s in sums) for name in names})


def _reduced(sums: Sequence[Sums], free: tuple[Free, ...], at: list[np.ndarray], damping: float) -> tuple[np.ndarray, ...]:
    """The damped normal equations of the common numbers, a (p, p) and rhs (p,), and how those per texel follow from them."""
    t = total_of(sums)
    m = t.h.shape[1]
    a = t.a + damping * np.diag(np.diag(t.a)) + 1e-12 * (1.0 + np.trace(t.a)) * np.eye(len(t.a))
    if not m:
        return a, t.g, np.zeros((0, 0, len(a))), np.zeros((0, 0))
    loads = np.einsum("nmm->nm", t.c)
    local = [(item, x) for item, x in zip(free, at, strict=True) if item.per_texel]
    h = t.h - PRIOR * np.stack([x - item.to(item.rest) for item, x in local], axis=1)
    c = t.c + np.einsum("nm,mk->nmk", damping * loads + PRIOR, np.eye(m))
    follow, alone = np.linalg.solve(c, t.b), np.linalg.solve(c, h[:, :, None])[:, :, 0]
    return a - np.einsum("nmp,nmq->pq", t.b, follow), t.g - np.einsum("nmp,nm->p", t.b, alone), follow, alone


def _step(
    sums: Sequence[Sums], free: tuple[Free, ...], at: list[np.ndarray], damping: float, known: np.ndarray | None = None
) -> list[np.ndarray]:
    """Solve the damped normal equations; a step per free number, in its coordinate.

    With `known` (p, p), the matrix of all recordings, there is no step along what these sums tell too little of.
    """
    a, rhs, follow, alone = _reduced(sums, free, at, damping)
    if known is None:
        common = np.linalg.lstsq(a, rhs, rcond=1e-13)[0]
    else:
        share, along = _shares(a, known)
        weight = np.where(share > TOLD, 1.0 / np.maximum(share, TOLD), 0.0)
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


def _shares(a: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each of some directions (columns), which share of what is known of it is in `a`; ``known`` is one along them."""
    inverse = np.linalg.inv(np.linalg.cholesky(known + 1e-10 * np.diag(np.diag(known)) + 1e-300 * np.eye(len(known))))
    share, turned = np.linalg.eigh(inverse @ a @ inverse.T)
    return share, inverse.T @ turned


def held_out(shares: Sequence[Share], found: Fit) -> np.ndarray:
    """Sum of squares of each trial, of readings and of forces, predicted by a fit that has not seen it, (trials, 2) float.

    A whole trial is left out at a time. Where the others tell too little of some number (those of friction, where only one
    trial slides; those per texel), or there is one trial only, it is a stretch of a trial; what the rest does not tell even
    then stays as it is. A step that would not even fit the others better is shortened, at last to nothing.
    """
    if found.sums is None:
        return found.sse.copy()
    free, at = found.free, [item.to(value_of(found.model, item)) for item in found.free]
    known, *_ = _reduced(flattened(found.sums), free, at, 0.0)
    local = any(item.per_texel for item in free)
    errors = np.zeros((len(shares), 2))
    for left, share in enumerate(shares):
        others = [one for i, trial in enumerate(found.sums) for one in trial if i != left]
        whole = bool(others) and not local and _shares(_reduced(others, free, at, 0.0)[0], known)[0].min(initial=1.0) > TOLD
        for parts in [list(range(share.parts))] if whole else [[part] for part in range(share.parts)]:
            errors[left] += _unseen(shares, found, left, parts, known)
    return errors


def _unseen(shares: Sequence[Share], found: Fit, left: int, parts: list[int], known: np.ndarray) -> np.ndarray:
    """Squares of some stretches of one trial under the fit to everything else."""
    assert found.sums is not None
    free, at = found.free, [item.to(value_of(found.model, item)) for item in found.free]

    def of_left(residual: np.ndarray) -> np.ndarray:
        rows = shares[left].stretches(residual)
        squares: np.ndarray = np.sum([shares[left].squares(residual[rows[part]]) for part in parts], axis=0)
        return squares

    sums = [one for i, trial in enumerate(found.sums) for j, one in enumerate(trial) if i != left or j not in parts]
    if not sums:
        return of_left(shares[left].residual(found.model))
    before, damping = sum(one.sse for one in sums) + _penalty(free, at), 1e-6
    for _ in range(3):
        moved = _moved(at, free, _step(sums, free, at, damping, known))
        tried = changed(found.model, free, [item.back(x) for item, x in zip(free, moved, strict=True)])
        residuals = [share.residual(tried) for share in shares]
        own = of_left(residuals[left])
        if sum(map(_square, residuals)) - own.sum() + _penalty(free, moved) <= before * (1.0 + 1e-9):
            return own
        damping = max(1e-2, 30.0 * damping)
    return of_left(shares[left].residual(found.model))


def _square(residual: np.ndarray) -> float:
    return float(np.einsum("ij,ij->", residual, residual))


def base_numbers(parameters: SensorParameters, wanted: Sequence[str], full: float) -> list[Free]:
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
        value = float(getattr(p, "mus" if name == LEVEL else name))
        if name in ("k", "sigma0", "x0"):
            made.append(Free(-1, name, value * 1e-5, value * 1e5, log=True))
        elif name == "cn":
            made.append(Free(-1, name, 0.0, 10.0 * p.k, size=0.01 * p.k))
        elif name == "gain":
            size = abs(value)
            made.append(Free(-1, name, -1e6 * size, 1e6 * size, size=size))
        elif name == "zero":
            made.append(Free(-1, name, -100 * full - abs(value), 100 * full + abs(value), size=full))
        elif name == LEVEL:
            made.append(Free(-1, "mus", 1e-3, 20.0, size=0.1, along=("mud",)))
        elif name in ("mus", "mud"):
            made.append(Free(-1, name, 0.0, 20.0, size=0.1))
        else:
            made.append(Free(-1, name, 0.0, 1e6, size=max(value, 1e-3)))
    return made
