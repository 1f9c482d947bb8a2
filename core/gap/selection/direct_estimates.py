# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read off the recordings rather than fitted to them: which texels are dead, and in which steps readings come."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model.effect import Effect
from ..fitting.least_squares import TrialView
from ..forward.contact_phases import relative_load
from ..forward.predictor import Model
from .candidates import Candidate

MOST_LEVELS = 48
"""Values of all readings together up to which they are steps: noise alone makes thousands."""


def unresponsive_texels(views: Sequence[TrialView], model: Model, candidate: Candidate, texels: int) -> Effect | None:
    """Return the effect with those texels dead that hardly follow the model although it loads them; None when all follow.

    One that goes to a rail as soon as it is touched is as dead: loaded it reads the same always, and far from what it should.
    """
    pairs = [(view.predictor.predict(model).reading, view.predictor.trial.reading) for view in views]
    known = [(a, b) for a, b in pairs if b is not None]
    if not known:
        return None
    noise = views[0].noise[0]
    predicted, measured = ((np.concatenate(side) - model.parameters.zero) / noise for side in zip(*known, strict=True))
    good = np.isfinite(measured)
    loaded = (predicted**2 * good).sum(axis=0) > 200.0  # by so much that the noise cannot hide whether it answers
    if loaded.sum() < 4:
        return None
    slope, level, railed = np.full(texels, np.nan), np.zeros(texels), np.zeros(texels, bool)
    for i in np.flatnonzero(loaded):
        x, y = predicted[good[:, i], i], measured[good[:, i], i]
        slope[i] = (x - x.mean()) @ (y - y.mean()) / max(float((x - x.mean()) @ (x - x.mean())), 1e-12)
        pressed = np.abs(x) > 0.5 * np.abs(x).max()
        level[i] = np.median(y[pressed])
        should, does = (float(np.subtract(*np.quantile(a[pressed], (0.75, 0.25)))) for a in (x, y))
        railed[i] = should > 20.0 and does < 0.15 * should and abs(level[i]) > 3.0 * float(np.abs(x[pressed]).max())
    silent = railed | (loaded & (slope < 0.15 * np.nanmedian(slope[~railed])))
    if not silent.any() or silent.sum() > 0.4 * loaded.sum():
        return None
    values = {"dead": silent.astype(float), "level": np.where(silent, level * noise + model.parameters.zero, 0.0)}
    own = [q.name for q in candidate.form.parameters]
    return Effect(candidate.name, candidate.form.name, {name: tuple(values[name].tolist()) for name in own})


def quantization_starts(views: Sequence[TrialView], model: Model, candidate: Candidate) -> list[Effect]:
    """Return the effect with each step in which the readings may come, if they do.

    A handful of values that all samples share is seen at once; uneven steps stand for several even ones. Readings in finer
    steps of q have a characteristic function that is large at the frequency 1/q, however they are spread otherwise (Widrow and
    Kollár, Quantization Noise, 2008). Held values would look alike: only samples that change are taken.
    """
    values = moving_readings(views, model)
    if len(values) < 400:
        return []
    levels = few_levels(values)
    if candidate.form.name == "companding":
        return [] if levels is None else companding_starts(levels, unloaded_reading(views) - model.parameters.zero, candidate)
    if levels is not None:
        apart = np.diff(levels)
        tried = np.unique([np.median(apart), apart.mean(), apart.max(), float(np.average(apart, weights=apart))])
        return [Effect(candidate.name, candidate.form.name, {"step": float(step)}) for step in tried]
    noise, full = views[0].noise[0], float(np.ptp(values))
    frequency = np.arange(5.0 / full, 1.0 / (2.5 * noise), 0.12 / full)  # coarser steps than a fifth are seen by eye
    if not 2 < len(frequency) < 20000:
        return []
    size = np.array([abs(np.exp(2j * np.pi * f * values).mean()) for f in frequency])
    if size.max() < 0.2 + 5.0 / np.sqrt(len(values)):
        return []
    best = frequency[int(np.argmax(size))]  # harmonics are smaller: noise blurs them more
    fine = best + np.linspace(-0.12, 0.12, 49) / full
    top = fine[int(np.argmax([abs(np.exp(2j * np.pi * f * values).mean()) for f in fine]))]
    return [Effect(candidate.name, candidate.form.name, {"step": float(1.0 / top)})]


def companding_starts(levels: np.ndarray, rest: float, candidate: Candidate) -> list[Effect]:
    """Return the effect whose steps are those between some levels above the one at rest: ``A (exp(b k) - 1)`` for the k-th."""
    above = levels[levels > rest + 1e-9] - rest
    if len(above) < 3:
        return []
    growth = np.geomspace(0.01, 3.0, 200)
    lattice = np.expm1(growth[:, None] * np.arange(1, len(above) + 1))
    scale = lattice @ above / (lattice * lattice).sum(axis=1)
    best = int(np.argmin(((above - scale[:, None] * lattice) ** 2).sum(axis=1)))
    return [Effect(candidate.name, candidate.form.name, {"scale": float(scale[best]), "growth": float(growth[best])})]


def coarsest_step(views: Sequence[TrialView], model: Model) -> float:
    """Return the largest step in which readings come, in the sensor's unit; 0 where there are none that can be seen."""
    levels = few_levels(moving_readings(views, model))
    return 0.0 if levels is None else float(np.diff(levels).max())


def moving_readings(views: Sequence[TrialView], model: Model) -> np.ndarray:
    """Return some thousand readings, less the zero, of samples at which the model changes by more than the noise."""
    moving = [np.zeros(0)]
    for view in views:
        reading = view.predictor.trial.reading
        if reading is not None:
            change = np.abs(np.gradient(view.predictor.predict(model).reading, axis=0))
            moving.append(reading[(change > 0.5 * view.noise[0]) & np.isfinite(reading)])
    values = np.concatenate(moving) - model.parameters.zero
    return values[:: max(1, len(values) // 6000)]


def unloaded_reading(views: Sequence[TrialView]) -> float:
    """Return the median of what is read while nothing touches."""
    found = []
    for view in views:
        reading = view.predictor.trial.reading
        if reading is not None:
            found.append(reading[(relative_load(view.predictor.stimulus) <= 0) & np.isfinite(reading)])
    return float(np.median(np.concatenate(found))) if any(map(len, found)) else 0.0


def few_levels(values: np.ndarray) -> np.ndarray | None:
    """Return the values between which readings jump, in order, if they have so few that noise did not make them; else None."""
    levels = np.unique(np.round(values, 12))
    return levels if 3 <= len(levels) <= MOST_LEVELS and len(values) >= 20 * len(levels) else None
