# SPDX-License-Identifier: GPL-3.0-or-later
"""What is estimated directly from the readings: which texels are dead, and quantization steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...model.sensor import Effect
from ..fitting.least_squares import FreeParameter, TrialView
from ..forward.contact_phases import relative_load
from ..forward.predictor import Model
from .candidates import Candidate
from .companded_steps import CHARACTERISTIC_NOISE, LEAST_CHARACTERISTIC, companded_steps

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
LEAST_READINGS = 400
"""Number of changing readings from which on steps are looked for."""
COARSEST_FREQUENCY, FREQUENCY_STEP, STEP_IN_NOISE = 5.0, 0.12, 2.5
"""Frequencies of the search for fine steps, in units of one over the range: from a fifth of the range (coarser steps are seen
as levels) to steps of 2.5 standard deviations of the noise."""
MOST_FREQUENCIES = 20000
AS_CLEAR = 0.9
"""Of a power and a logarithm the one counts behind which steps are seen best, and the other if its characteristic function
reaches this share. Chosen by eye from 40 readings behind companding converters."""


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


def quantization_starts(values: np.ndarray, views: Sequence[TrialView], candidate: Candidate) -> list[Effect]:
    """Return the effect with each step in which the readings may be quantised; empty if they seem not to be.

    Few levels that all samples share are seen at once; uneven steps stand for several even ones. Readings with finer steps q
    have a characteristic function that is large at the frequency 1/q, whatever their distribution (Widrow and Kollár,
    Quantization Noise, 2008). Constant readings would look the same, so only changing samples are used.

    Parameters
    ----------
    values : (n,) float
        Readings that change (see :meth:`.view_set.ViewSet.moving_readings`).
    views : sequence of TrialView
        All texels and samples.
    candidate : Candidate
        The form of the effect.
    """
    if len(values) < LEAST_READINGS:
        return []
    levels, rest = few_levels(values), unloaded_reading(views)
    if candidate.form.name == "companding":
        return _companding_starts(values - rest, candidate) if levels is None else companding_starts(levels, rest, candidate)
    if candidate.form.name == "power":
        return _power_starts(values - rest, candidate) if levels is None else power_starts(levels, rest, candidate)
    if levels is not None:
        apart = np.diff(levels)
        tried = np.unique([np.median(apart), apart.mean(), apart.max(), float(np.average(apart, weights=apart))])
        return [Effect(candidate.name, candidate.form.name, {"step": float(step)}) for step in tried]
    step = even_steps(values, views[0].noise[0])
    return [] if step is None else [Effect(candidate.name, candidate.form.name, {"step": step})]


def _companding_starts(above_rest: np.ndarray, candidate: Candidate) -> list[Effect]:
    """Steps behind a logarithm that are seen in many levels."""
    seen = companded_steps(above_rest)
    found = [one for one in seen if one.logarithmic and one.strength >= AS_CLEAR * seen[0].strength and one.bend > 0.0]
    return [effect for one in found for effect in _roundings(candidate, {"scale": one.scale, "growth": one.growth})]


def _power_starts(above_rest: np.ndarray, candidate: Candidate) -> list[Effect]:
    """Steps behind a power that are seen in many levels."""
    seen = companded_steps(above_rest)
    bounds = {p.name: p for p in candidate.form.parameters}["exponent"]
    found = [one for one in seen if not one.logarithmic and one.strength >= AS_CLEAR * seen[0].strength]
    found = [one for one in found if bounds.low <= one.exponent <= bounds.high]
    return [effect for one in found for effect in _roundings(candidate, {"first": one.first, "exponent": one.exponent})]


def _roundings(candidate: Candidate, values: dict[str, float]) -> list[Effect]:
    """The effect of a converter that cuts off, and of one that rounds to the nearest."""
    return [Effect(candidate.name, candidate.form.name, {**values, "rounding": share}) for share in (0.0, 0.5)]


def even_steps(values: np.ndarray, noise: float) -> float | None:
    """Return the even step of readings by their characteristic function, in the sensor's unit; None if none is seen."""
    return _even_steps_kept(np.ascontiguousarray(values, float).tobytes(), noise)


@lru_cache(maxsize=2)
def _even_steps_kept(raw: bytes, noise: float) -> float | None:
    """Levels of readings given as bytes. Several forms ask for the steps of the same readings."""
    values = np.frombuffer(raw)
    full = float(np.ptp(values))
    if full == 0.0:
        return None
    frequency = np.arange(COARSEST_FREQUENCY / full, 1.0 / (STEP_IN_NOISE * noise), FREQUENCY_STEP / full)
    if not 2 < len(frequency) < MOST_FREQUENCIES:
        return None
    size = _characteristic_function(values, frequency)
    if size.max() < LEAST_CHARACTERISTIC + CHARACTERISTIC_NOISE / np.sqrt(len(values)):
        return None
    best = frequency[int(np.argmax(size))]  # harmonics are smaller, because noise blurs them more
    fine = best + np.linspace(-FREQUENCY_STEP, FREQUENCY_STEP, 49) / full
    return float(1.0 / fine[int(np.argmax([abs(np.exp(2j * np.pi * f * values).mean()) for f in fine]))])


def _characteristic_function(values: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Magnitude of the characteristic function of values (n,) at evenly spaced frequencies (m,)."""
    phase = np.exp(2j * np.pi * frequency[0] * values)
    turn = np.exp(2j * np.pi * (frequency[1] - frequency[0]) * values)
    size = np.empty(len(frequency))
    for i in range(len(frequency)):
        size[i] = abs(phase.mean())
        phase *= turn  # twenty times as fast as an exponential; twenty thousand products are off by 1e-12
    return size


def companding_starts(levels: np.ndarray, rest: float, candidate: Candidate) -> list[Effect]:
    """Return the effect with the growing steps that fit a few levels best: ``A (exp(b k) - 1)`` for the k-th level above rest;
    once cut off and once rounded. Empty if there are too few levels.
    """
    above = levels[levels > rest + 1e-9] - rest
    if len(above) < 3:
        return []
    growth = np.geomspace(0.01, 3.0, 200)
    lattice = np.expm1(growth[:, None] * np.arange(1, len(above) + 1))
    scale, best = _nearest_lattice(lattice, above)
    return _roundings(candidate, {"scale": scale, "growth": float(growth[best])})


def power_starts(levels: np.ndarray, rest: float, candidate: Candidate) -> list[Effect]:
    """Return the effect with the steps behind a power that fit a few levels best: ``s k^(1/p)`` for the k-th level above rest;
    once cut off and once rounded. Empty if there are too few levels.
    """
    above = levels[levels > rest + 1e-9] - rest
    if len(above) < 3:
        return []
    bounds = {p.name: p for p in candidate.form.parameters}["exponent"]
    exponent = np.geomspace(max(bounds.low, 0.2), bounds.high, 200)
    lattice = np.arange(1, len(above) + 1) ** (1.0 / exponent[:, None])
    first, best = _nearest_lattice(lattice, above)
    return _roundings(candidate, {"first": first, "exponent": float(exponent[best])})


def _nearest_lattice(lattice: np.ndarray, above: np.ndarray) -> tuple[float, int]:
    """Factor and number of the lattice (m, k) that comes nearest to levels (k,) after a factor."""
    scale = lattice @ above / (lattice * lattice).sum(axis=1)
    best = int(np.argmin(((above - scale[:, None] * lattice) ** 2).sum(axis=1)))
    return float(scale[best]), best


def unloaded_reading(views: Sequence[TrialView]) -> float:
    """Return the median reading without load."""
    found = []
    for view in views:
        reading = view.predictor.trial.reading
        if reading is not None:
            found.append(reading[(relative_load(view.predictor.stimulus) <= 0) & np.isfinite(reading)])
    return float(np.median(np.concatenate(found))) if any(map(len, found)) else 0.0


def few_levels(values: np.ndarray) -> np.ndarray | None:
    """Return the distinct values of readings, in order, if they are so few that noise did not make them; else None."""
    size = float(np.abs(values).max(initial=0.0)) or 1.0
    levels = values[np.unique(np.round(values / size, 9), return_index=True)[1]]
    return levels if 3 <= len(levels) <= MOST_LEVELS and len(values) >= SAMPLES_PER_LEVEL * len(levels) else None
