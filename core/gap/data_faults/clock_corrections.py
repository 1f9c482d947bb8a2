# SPDX-License-Identifier: GPL-3.0-or-later
"""Put the responses of a recording on the clock of its stimulus, to a fraction of a sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..dataset.rig import Rig
from ..dataset.shift_peak import peak_offset
from ..dataset.trial import Trial
from ..forward.stimulus import Stimulus, stimulus_of

MOST_UNEVEN = 0.02
"""Largest deviation of the steps of an even clock from their mean, as a share of it."""
REACH, SHIFTS = 1.5, 25
"""Samples on either side of a shift within which it is refined, and the number of shifts that are tried there."""
LEADS = np.concatenate([[0.0], np.geomspace(1e-3, 0.1, 13)])
"""Seconds by which a viscous response may lead its load: damping divided by stiffness."""
MOST_CHANNELS, MOST_SAMPLES, LEAST_SAMPLES, MOST_LOADS = 12, 3000, 64, 1_000_000
"""Channels, samples (most and least) and loads of a recording from which a shift is refined."""
MOST_KNOWN = 0.9
"""Share of the samples of the best known channel that a channel has to have."""
SMOOTHING = 0.1
"""Seconds over which changes are taken."""


def moved(trial: Trial, source: np.ndarray) -> Trial:
    """Return a trial with its responses at other times (T,); those that were not recorded are missing."""
    right = np.clip(np.searchsorted(trial.time, source), 1, len(trial.time) - 1)
    share = (source - trial.time[right - 1]) / (trial.time[right] - trial.time[right - 1])
    margin = 1e-6 * trial.step
    outside = (source < trial.time[0] - margin) | (source > trial.time[-1] + margin)
    share = np.where(outside, np.nan, share)[:, None]

    def at_source(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else (1.0 - share) * values[right - 1] + share * values[right]

    return replace(trial, reading=at_source(trial.reading), force=at_source(trial.force))


def with_shift(trial: Trial, shift: float) -> Trial:
    """Return a trial whose responses were late by a constant shift (s) without it.

    Responses are moved by whole samples and the stimulus by the rest: motion is smooth where responses have kinks, at the
    beginnings and ends of contact.
    """
    steps = np.diff(trial.time)
    step = float(steps.mean())
    if np.ptp(steps) > MOST_UNEVEN * step:
        return moved(trial, trial.time + shift)
    whole = round(shift / step)
    source = np.arange(len(trial.time)) + whole
    known = (source >= 0) & (source < len(trial.time))

    def at_source(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else np.where(known[:, None], values[np.where(known, source, 0)], np.nan)

    by_samples = replace(trial, reading=at_source(trial.reading), force=at_source(trial.force))
    return _with_stimulus_at(by_samples, trial.time + whole * step - shift)


def refined_shifts(rig: Rig, trials: Sequence[Trial], shifts: Sequence[float]) -> list[float]:
    """Return constant shifts (s) of some trials to a fraction of a sample.

    A viscous response comes earlier than its load. It is told from a shift by the beginnings and ends of contact, so contacts
    are computed again for each shift, and changes of the response are compared with those of load and rate together. All
    trials have the same ratio of both, because the sensor is the same. A part of this lead may be left in the shifts, the
    same in all trials, where the recordings do not tell: then the viscosity is fitted too small, and nothing else changes.
    """
    tables, tried = [], []
    for trial, shift in zip(trials, shifts, strict=True):
        table, grid = _explained(rig, with_shift(trial, shift))
        tables.append(table)
        tried.append(grid)
    peaks = [[_peak(column, grid) for column in table.T] for table, grid in zip(tables, tried, strict=True)]
    best = int(np.argmax([sum(value for _, value in of_lead) for of_lead in zip(*peaks, strict=True)]))
    return [shift + of_trial[best][0] for shift, of_trial in zip(shifts, peaks, strict=True)]


def _explained(rig: Rig, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Share of the response's changes that load and rate explain at each further shift and lead, and these shifts (s)."""
    trial = _busiest_part(rig, trial)
    grid = np.linspace(-REACH, REACH, SHIFTS) * trial.step
    stimulus = stimulus_of(trial, rig)
    channels = None if trial.reading is None else strongest_channels(stimulus, MOST_CHANNELS)
    response = net_force_along_normal(stimulus) if trial.reading is None else trial.reading[:, channels]
    width = max(1, round(SMOOTHING / trial.step))
    good = np.isfinite(response).all(axis=1)
    both = good[width:] & good[:-width]
    if both.sum() < LEAST_SAMPLES or not response.shape[1]:
        return np.zeros((SHIFTS, len(LEADS))), np.zeros(SHIFTS)

    def changes(values: np.ndarray) -> np.ndarray:
        found: np.ndarray = (values[width:] - values[:-width])[both]
        return found

    y = changes(response)
    table = np.empty((SHIFTS, len(LEADS)))
    for row, shift in zip(table, grid, strict=True):
        other = stimulus_of(_with_stimulus_at(trial, trial.time - shift), rig)
        load, rate = (one if channels is None else one[:, channels] for one in (other.load, other.rate))
        for i, lead in enumerate(LEADS):
            force = np.maximum(load + lead * rate, 0.0)  # a contact does not pull
            x = changes(force.sum(axis=1, keepdims=True) if channels is None else force)
            row[i] = float(((x * y).sum(axis=0) ** 2 / np.maximum((x * x).sum(axis=0), 1e-300)).sum())
    return table / max(float((y * y).sum()), 1e-300), grid


def _busiest_part(rig: Rig, trial: Trial) -> Trial:
    """The stretch of a trial in which loads change most, short enough."""
    most = int(np.clip(MOST_LOADS // len(rig.surface), 4 * LEAST_SAMPLES, MOST_SAMPLES))
    if len(trial.time) <= most:
        return trial
    change = np.abs(np.diff(stimulus_of(trial, rig).load, axis=0, prepend=0.0)).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(change)])
    first = int(np.argmax(total[most:] - total[:-most]))
    parts = {name: getattr(trial, name) for name in ("time", "position", "quaternion", "level", "slide", "reading", "force")}
    kept: dict[str, Any] = {name: None if one is None else one[first : first + most] for name, one in parts.items()}
    return replace(trial, **kept)


def strongest_channels(stimulus: Stimulus, most: int) -> np.ndarray:
    """Return the channels with readings whose loads change most."""
    assert stimulus.trial.reading is not None
    share = np.isfinite(stimulus.trial.reading).mean(axis=0)
    known = share > MOST_KNOWN * share.max()
    strength = np.where(known, (np.diff(stimulus.load, axis=0) ** 2).sum(axis=0), -1.0)
    chosen = np.argsort(-strength)[:most]
    found: np.ndarray = chosen[strength[chosen] > 0]
    return found


def net_force_along_normal(stimulus: Stimulus) -> np.ndarray:
    """Return the net force along the mean normal of the contacts, (T, 1)."""
    assert stimulus.trial.force is not None
    normal = np.array([0.0, 0.0, -1.0]) if stimulus.normal is None else stimulus.normal.mean(axis=(0, 1))
    return np.nan_to_num(stimulus.trial.force @ normal)[:, None]


def _peak(values: np.ndarray, shifts: np.ndarray) -> tuple[float, float]:
    """Place and value of the maximum, between the shifts by a parabola."""
    best = int(np.argmax(values))
    away = peak_offset(values, best)
    above = 0.25 * (values[best + 1] - values[best - 1]) * away if away else 0.0
    return float(shifts[best] + away * (shifts[1] - shifts[0])), float(values[best] + above)


def _with_stimulus_at(trial: Trial, source: np.ndarray) -> Trial:
    """A trial with its stimulus at other times (T,), less than two samples away."""

    def at_source(values: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(source, trial.time, column) for column in values.T], axis=1)

    quaternion = None if trial.quaternion is None else at_source(trial.quaternion)
    if quaternion is not None:
        quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    return replace(
        trial,
        position=None if trial.position is None else at_source(trial.position),
        quaternion=quaternion,
        level=None if trial.level is None else at_source(trial.level[:, None])[:, 0],
        slide=at_source(trial.slide),
    )
