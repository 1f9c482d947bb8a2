# SPDX-License-Identifier: GPL-3.0-or-later
"""What is estimated directly from the readings: which texels are dead, and quantization steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from ...effects.engine.registry import kind_of
from ...effects.engine.specification import Form
from ...model.sensor import Effect, Value
from ..fitting.least_squares import FreeParameter, TrialView
from ..forward.contact_phases import relative_load
from ..forward.predictor import Model
from .candidates import Candidate

MOST_LEVELS = 48
"""Most distinct values of all readings for them to be quantization levels; noise alone makes thousands."""
SAMPLES_PER_LEVEL = 20
"""Least number of readings for each of these values."""
LEAST_LOADED_SQUARE = 200.0
"""Sum of squares of the predicted reading, in units of the noise, from which on a texel is loaded enough to be judged."""
LEAST_LOADED_TEXELS = 4
LEAST_SLOPE = 0.15
"""A texel is dead if its slope of measured over predicted readings is below this share of the median slope."""
PRESSED_SHARE = 0.5
"""A texel counts as pressed above this share of its largest predicted reading."""
LEAST_SPREAD, LEAST_SPREAD_SHARE, RAIL_DISTANCE = 20.0, 0.15, 3.0
"""A pressed texel is stuck at a rail if its predicted reading spreads by more than `LEAST_SPREAD` standard deviations of the
noise, its measured reading by less than `LEAST_SPREAD_SHARE` of that, and if it is `RAIL_DISTANCE` times as large as
predicted."""
MOST_DEAD_SHARE = 0.4
"""If a larger share of the loaded texels seems dead, the model is wrong and not the texels."""
SAME_LEVEL = 1e-9
"""Share of the largest reading within which values are the same but for rounding."""
LEAST_LEVELS, LEAST_REPEATS = 3, 2.0
"""Fewest levels, and how often each is read on average: then most of them are among the readings."""
MOST_MISFIT = 0.25
"""Most by which the number of a level is off: half way between a whole number and what is as near to the next. Levels are
exact: in 24 sets of them the right form leaves less than 1e-4, others leave 0.04 (of six levels) to 0.45 and more."""
ROUNDING = "rounding"
"""Name of the share of a step that a converter rounds up, which its levels do not show. Its steps are counted from the
reading without load."""
FINEST, COARSEST, GRID, MOST_ROUNDS = 1e-3, 10.0, 32, 20
"""Bounds of the parameters of levels in the reading's unit, as multiples of the smallest distance and of the largest level;
number of starting values along each; and most iterations of numbering the levels and fitting. With them the numbers of all
levels of powers from 0.3 to 2.5 and of logarithms are right if a tenth of 8 to 2000 levels is missing."""


def unresponsive_texels(views: Sequence[TrialView], model: Model, candidate: Candidate, texels: int) -> Effect | None:
    """Return the effect for texels that hardly follow the model although they are loaded; None if all follow.

    A texel that goes to a rail at the first touch is dead too: loaded it always reads the same, far from what it should.

    Parameters
    ----------
    views : sequence of TrialView
    model : Model
    candidate : Candidate
        The form of the effect.
    texels : int
        Number of texels.
    """
    pairs = [(view.predictor.predict(model).reading, view.predictor.trial.reading) for view in views]
    known = [(a, b) for a, b in pairs if b is not None]
    if not known:
        return None
    noise = views[0].noise[0]
    predicted, measured = ((np.concatenate(side) - model.parameters.zero) / noise for side in zip(*known, strict=True))
    good = np.isfinite(measured)
    loaded = (predicted**2 * good).sum(axis=0) > LEAST_LOADED_SQUARE
    if loaded.sum() < LEAST_LOADED_TEXELS:
        return None
    slope, level, railed = np.full(texels, np.nan), np.zeros(texels), np.zeros(texels, bool)
    for i in np.flatnonzero(loaded):
        x, y = predicted[good[:, i], i], measured[good[:, i], i]
        slope[i] = (x - x.mean()) @ (y - y.mean()) / max(float((x - x.mean()) @ (x - x.mean())), 1e-12)
        pressed = np.abs(x) > PRESSED_SHARE * np.abs(x).max()
        level[i] = np.median(y[pressed])
        should, does = (float(np.subtract(*np.quantile(a[pressed], (0.75, 0.25)))) for a in (x, y))
        railed[i] = (
            should > LEAST_SPREAD
            and does < LEAST_SPREAD_SHARE * should
            and abs(level[i]) > RAIL_DISTANCE * float(np.abs(x[pressed]).max())
        )
    silent = railed | (loaded & (slope < LEAST_SLOPE * np.nanmedian(slope[~railed])))
    if not silent.any() or silent.sum() > MOST_DEAD_SHARE * loaded.sum():
        return None
    values = {"dead": silent.astype(float), "level": np.where(silent, level * noise + model.parameters.zero, 0.0)}
    own = [q.name for q in candidate.form.parameters]
    return Effect(candidate.name, candidate.form.name, {name: tuple(values[name].tolist()) for name in own})


def of_silent_texels(free: Sequence[FreeParameter], effect: Effect) -> Iterator[FreeParameter]:
    """Yield the parameters of an effect, free for its dead texels alone, which may follow a share of their load."""
    silent = np.asarray(effect.values["dead"]) > 0.0
    for item in free:
        value = np.asarray(effect.values[item.name])
        low = 1.0 - LEAST_SLOPE if item.name == "dead" else item.low
        yield replace(item, low=np.where(silent, low, value), high=np.where(silent, item.high, value))


def quantization_starts(values: np.ndarray, views: Sequence[TrialView], model: Model, candidate: Candidate) -> list[Effect]:
    """Return the effect with the levels of a converter that readings show; empty if they show none, or those of another form.

    Noise repeats no value, so values that repeat are the levels of a converter. Where they are nearer to each other than the
    noise is large, they hide in it. Levels of a converter that is in no form are given to the form that comes nearest.

    Parameters
    ----------
    values : (n,) float
        Readings that change (see :meth:`.view_set.ViewSet.moving_readings`).
    views : sequence of TrialView
        All texels and samples.
    model : Model
        Whose zero is the reading without load where none was recorded.
    candidate : Candidate
        The form of the effect.
    """
    levels, count = distinct(values)
    levels = levels[count > 1]
    is_hidden = len(levels) < LEAST_LEVELS or np.median(np.diff(levels)) < views[0].noise[0]
    if is_hidden or len(values) < LEAST_REPEATS * len(levels):
        return []
    rest = unloaded_reading(views)
    is_whole = rest is not None and few_levels(values)
    found = _levels_by_form(levels.tobytes(), model.parameters.zero if rest is None else rest, is_whole, candidate.name)
    least = min((misfit for _, misfit in found.values()), default=0.0)
    own, misfit = found.get(candidate.form.name, ({}, np.inf))
    if misfit > max(MOST_MISFIT, least):
        return []
    shares = [{ROUNDING: share} for share in (0.0, 0.5)] if ROUNDING in candidate.form.defaults() else [{}]
    return [Effect(candidate.name, candidate.form.name, {**own, **share}) for share in shares]


@lru_cache(maxsize=4)
def _levels_by_form(raw: bytes, rest: float, is_whole: bool, kind: str) -> dict[str, tuple[dict[str, Value], float]]:
    """Parameters and misfit (see :func:`level_parameters`) of each form of a converter, for levels given as bytes.

    Even steps are counted from the lowest level, those of the other forms from the reading without load.
    """
    levels, found = np.frombuffer(raw), {}
    for form in kind_of(kind).forms:
        change = levels - (rest if ROUNDING in form.defaults() else levels[0])
        change = change if change[-1] >= -change[0] else -change[::-1]
        sizes = change[change > SAME_LEVEL * change[-1]]
        if form.level_number is not None and len(sizes) >= len(form.parameters) and len(sizes) > 1:
            found[form.name] = level_parameters(sizes, form, is_whole)
    return found


def level_parameters(sizes: np.ndarray, form: Form, is_whole: bool) -> tuple[dict[str, Value], float]:
    """Return the parameters of a converter with which its levels have whole numbers (:attr:`.specification.Form.level_number`),
    and by how much one of them is off at most.

    If some levels may be missing, the parameters start where neighbours are nearest to a distance of one, by absolute
    deviations. Then each distance is a whole number, and least squares fit the parameters to the sums of these.

    Parameters
    ----------
    sizes : (k,) float, increasing
        Distances of levels from the reading without load, above zero, in the sensor's unit.
    form : Form
    is_whole : bool
        True if none is missing: they are numbered one after the other.
    """
    own = [p for p in form.parameters if p.name != ROUNDING]
    in_units = FINEST * min(sizes[0], float(np.diff(sizes).min())), COARSEST * sizes[-1]
    bounds = [in_units if p.unit == "unit" else (p.low or 1e-2 / len(sizes), p.high) for p in own]
    low, high = np.log(np.transpose(bounds))

    def values(at: np.ndarray) -> dict[str, Value]:
        return {p.name: float(value) for p, value in zip(own, np.exp(at), strict=True)}

    def numbers(at: np.ndarray) -> np.ndarray:
        assert form.level_number is not None
        return form.level_number(sizes, values(at))

    def whole(at: np.ndarray) -> np.ndarray:
        if is_whole:
            return np.arange(1.0, len(sizes) + 1.0)
        return np.cumsum(np.maximum(np.round(np.diff(numbers(at), prepend=0.0)), 1.0))

    def miss(at: np.ndarray) -> np.ndarray:
        return np.log(numbers(at) / whole(at) if is_whole else np.maximum(np.diff(numbers(at)), 1e-9))

    grid = np.stack(np.meshgrid(*np.linspace(low, high, GRID).T), axis=-1).reshape(-1, len(own))
    start = min(grid, key=lambda at: float(np.abs(miss(at)).sum()))
    at, before = least_squares(miss, start, bounds=(low, high), loss="soft_l1", f_scale=0.1).x, np.zeros(0)
    for _ in range(MOST_ROUNDS):
        if np.array_equal(aims := whole(at), before):
            break
        at, before = least_squares(lambda x, aims=aims: numbers(x) - aims, at, bounds=(low, high)).x, aims
    return values(at), float(np.abs(numbers(at) - before).max())


def unloaded_reading(views: Sequence[TrialView]) -> float | None:
    """Return the median reading without load; None if none was recorded."""
    found = []
    for view in views:
        reading = view.predictor.trial.reading
        if reading is not None:
            found.append(reading[(relative_load(view.predictor.stimulus) <= 0) & np.isfinite(reading)])
    return float(np.median(np.concatenate(found))) if any(map(len, found)) else None


def few_levels(values: np.ndarray) -> bool:
    """Return whether readings have so few distinct values, and repeat them so often, that noise did not make them."""
    count = len(distinct(values)[0])
    return LEAST_LEVELS <= count <= MOST_LEVELS and len(values) >= SAMPLES_PER_LEVEL * count


def distinct(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct values of readings, in order, and how often each is read; values that rounding sets apart are one."""
    size = float(np.abs(values).max(initial=0.0)) or 1.0
    _, first, count = np.unique(np.round(values / (size * SAME_LEVEL)), return_index=True, return_counts=True)
    return values[first], count
