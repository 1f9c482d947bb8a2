# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks of stimulus and response that are shifted: at which shift of some seconds their changes correlate best.

Changes and not values are compared, because creep, drift and hysteresis hardly move a change. Clocks that run apart are not
looked for: those of computers differ by less than 1e-4, which shifts the end of a recording of ten minutes by 0.06 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..dataset.rig import Rig
from ..dataset.second_logger import peak_of
from ..dataset.trial import Trial, columns_at
from ..forward.stimulus import Stimulus, stimulus_of
from .data_fault import DataFault

LONGEST_SHIFT, LARGEST_SHIFT_SHARE = 3.0, 0.25
"""Longest shift that is looked for: seconds, and share of a recording."""
MOST_SAMPLES, MOST_CHANNELS = 3000, 12
"""Samples and channels per recording that are compared."""
LEAST_SAMPLES = 64
SMOOTHING = 0.1
"""Seconds over which changes are taken."""
LEAST_SHIFT, LEAST_SHIFT_SAMPLES = 0.1, 3.0
"""Smallest shift that is a fault: seconds, and samples. Lag, creep and loops of a sensor move its changes less."""
LONGEST_LAG = 0.3
"""Seconds by which a response may be late in all recordings: a sensor may be that slow (the effect `lag`)."""
LAG_STAGES = (1, 2, 3)
LAG_TIMES = np.geomspace(0.4, 2.5, 13)
"""Numbers of equal low passes in turn, and their whole delays in units of the shift, with which a sensor that lags is compared.
A lag smears the response, a shifted clock does not."""
LEAST_GAIN = 0.1
"""Least increase of the correlation of the changes by a shift."""
MOST_LEFT = 0.6
"""What lacks to a correlation of one must become less by this factor: in a recording that repeats itself, another period fits
about as well."""
LEAST_CORRELATION = 0.4
"""Least correlation of the changes, with the shift, from which a clock can be judged."""
REACH, SHIFTS = 1.5, 25
"""Samples on either side of a shift within which it is refined, and the number of shifts that are tried there."""
LEADS = np.concatenate([[0.0], np.geomspace(1e-3, 0.1, 13)])
"""Seconds by which a viscous response may lead its load: damping divided by stiffness."""
MOST_LOADS = 1_000_000
"""Loads of the part of a recording from which a shift is refined: each of its arrays has 8 MB."""
MOST_KNOWN = 0.9
"""Share of the samples of the best known channel that a channel has to have: a sample counts where all chosen ones have it."""


@dataclass(frozen=True)
class Shift:
    """How late (s) a response is, and the correlation of its changes with those of the load: with this shift, and without."""

    late: float
    correlation: float
    unshifted: float


def find_clock_faults(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Return the shifted clocks of some recordings."""
    known = [(s, shift) for s in stimuli if (shift := shift_of(s)) is not None]
    typical = float(np.median([shift.late for _, shift in known])) if known else 0.0
    shifts = {}
    for s, shift in known:
        if not _is_clearly_better(shift.correlation, shift.unshifted):
            continue
        least = max(LEAST_SHIFT, LEAST_SHIFT_SAMPLES * s.trial.step)
        is_common = abs(shift.late - typical) < least
        if is_common and shift.late > LONGEST_LAG and _is_clearly_better(_correlation_of_lag(s, shift.late), shift.correlation):
            continue
        if shift.late < -least or shift.late > (max(LONGEST_LAG, least) if is_common else least):
            shifts[s.trial.name] = shift
    if not shifts:
        return []
    if "clock-shift" in rig.correct:
        exact = refined_shifts(rig, [s.trial for s in stimuli if s.trial.name in shifts], [s.late for s in shifts.values()])
        shifts = {name: replace(shifts[name], late=late) for name, late in zip(shifts, exact, strict=True)}
    name = max(shifts, key=lambda one: shifts[one].correlation - shifts[one].unshifted)
    shift, way = shifts[name], "after" if shifts[name].late > 0 else "before"
    said = (
        f"in '{name}.csv' the response comes {abs(shift.late):.3g} s {way} the stimulus "
        f"(correlation of their changes {shift.correlation:.2f}, unshifted {shift.unshifted:.2f})"
    )
    return [DataFault("clock-shift", tuple(shifts), said, lambda trial: with_shift(trial, shifts[trial.name].late))]


def shift_of(stimulus: Stimulus) -> Shift | None:
    """Return how late the response of a recording is; None if that cannot be judged."""
    prepared = _changes(stimulus)
    if prepared is None:
        return None
    time, load, response, step = prepared
    most = int(min(LONGEST_SHIFT, LARGEST_SHIFT_SHARE * (time[-1] - time[0])) / step)
    size = np.linalg.norm(load) * np.linalg.norm(response)
    if most < 4 or size <= 0.0:
        return None
    padded = np.pad(response, ((most, most), (0, 0)))
    total = np.array([(load * padded[k : k + len(load)]).sum() for k in range(2 * most + 1)]) / size
    if -total.min() > total.max():  # a response that falls under load is as good as one that rises
        total = -total
    best, away, _ = peak_of(total)
    late = (best - most + away) * step
    return Shift(late, float(total[best]), float(total[most])) if total[best] >= LEAST_CORRELATION else None


def refined_shifts(rig: Rig, trials: Sequence[Trial], shifts: Sequence[float]) -> list[float]:
    """Return constant shifts (s) of some trials to a fraction of a sample.

    A viscous response comes earlier than its load. Beginnings and ends of contact distinguish that from a shift, so contacts
    are computed again for each shift, and changes of the response are compared with those of load and rate together. All
    trials have the same ratio of both, because the sensor is the same. A part of this lead may be left in the shifts, the
    same in all trials: then the viscosity is fitted too small, and nothing else changes.
    """
    tables = [_explained(rig, trial, shift) for trial, shift in zip(trials, shifts, strict=True)]
    peaks = [[peak_of(column) for column in table.T] for table in tables]
    best = int(np.argmax([sum(value for *_, value in of_lead) for of_lead in zip(*peaks, strict=True)]))
    return [
        shift + (sum(of_trial[best][:2]) / (SHIFTS - 1) - 0.5) * 2.0 * REACH * trial.step
        for shift, trial, of_trial in zip(shifts, trials, peaks, strict=True)
    ]


def _explained(rig: Rig, trial: Trial, late: float) -> np.ndarray:
    """Share of the response's changes that load and rate explain, for each further shift and each lead."""
    moved = with_shift(trial, late)
    part = _busiest_part(rig, moved)
    response, channels = _response(stimulus_of(moved.part(part), rig))
    width = max(1, round(SMOOTHING / trial.step))
    good = np.isfinite(response).all(axis=1)
    both = good[width:] & good[:-width]
    table = np.zeros((SHIFTS, len(LEADS)))
    if both.sum() < LEAST_SAMPLES or not response.shape[1]:
        return table
    y = (response[width:] - response[:-width])[both]
    for row, shift in zip(table, late + np.linspace(-REACH, REACH, SHIFTS) * trial.step, strict=True):
        other = stimulus_of(with_shift(trial, float(shift)).part(part), rig)
        load, rate = (one if channels is None else one[:, channels] for one in (other.load, other.rate))
        for i, lead in enumerate(LEADS):
            force = np.maximum(load + lead * rate, 0.0)  # a contact does not pull
            force = force.sum(axis=1, keepdims=True) if channels is None else force
            x = (force[width:] - force[:-width])[both]
            row[i] = float(((x * y).sum(axis=0) ** 2 / np.maximum((x * x).sum(axis=0), 1e-300)).sum())
    return table / max(float((y * y).sum()), 1e-300)


def _busiest_part(rig: Rig, trial: Trial) -> slice:
    """The stretch of a trial in which loads change most, short enough."""
    most = int(np.clip(MOST_LOADS // len(rig.surface), 4 * LEAST_SAMPLES, MOST_SAMPLES))
    if len(trial.time) <= most:
        return slice(None)
    change = np.abs(np.diff(stimulus_of(trial, rig).load, axis=0, prepend=0.0)).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(change)])
    first = int(np.argmax(total[most:] - total[:-most]))
    return slice(first, first + most)


def _is_clearly_better(new: float, old: float) -> bool:
    """True if one correlation is so much larger than another one that this is no accident."""
    return new - old >= LEAST_GAIN and 1.0 - new < MOST_LEFT * (1.0 - old)


def _correlation_of_lag(stimulus: Stimulus, late: float) -> float:
    """Largest correlation of the changes of response and load behind low passes that delay the load about as much, s."""
    from scipy.signal import lfilter

    prepared = _changes(stimulus)
    assert prepared is not None, "its shift was found"
    _, load, response, step = prepared
    size, best = np.linalg.norm(response), 0.0
    for stages in LAG_STAGES:
        for tau in LAG_TIMES * late / stages:
            keeps = float(np.exp(-step / tau))
            smeared = load
            for _ in range(stages):
                smeared = lfilter([1.0 - keeps], [1.0, -keeps], smeared, axis=0)
            best = max(best, abs(float((smeared * response).sum())) / max(float(np.linalg.norm(smeared) * size), 1e-300))
    return best


def _changes(stimulus: Stimulus) -> tuple[np.ndarray, np.ndarray, np.ndarray, float] | None:
    """Even times, changes of load and of response at them (T, c), and their step; None without enough of either."""
    trial = stimulus.trial
    response, channels = _response(stimulus)
    load = stimulus.load.sum(axis=1, keepdims=True) if channels is None else stimulus.load[:, channels]
    good = np.isfinite(response).all(axis=1)
    if good.sum() < LEAST_SAMPLES or not load.any():
        return None
    step = max(trial.step, float(np.ptp(trial.time)) / MOST_SAMPLES)
    even = np.arange(trial.time[0], trial.time[-1], step)
    width = max(1, round(SMOOTHING / step))
    if len(even) < width + LEAST_SAMPLES:
        return None
    on_even = (columns_at(even, trial.time[good], values[good]) for values in (load, response))
    x, y = (values[width:] - values[:-width] for values in on_even)
    return even[width:], x / max(float(np.abs(x).max()), 1e-300), y / max(float(np.abs(y).max()), 1e-300), step


def _response(stimulus: Stimulus) -> tuple[np.ndarray, np.ndarray | None]:
    """Readings (T, c) and numbers of the channels whose loads change most; without readings the net force and None.

    The net force (T, 1) is that along the mean normal of the contacts.
    """
    trial = stimulus.trial
    if trial.reading is None:
        assert trial.force is not None
        normal = np.array([0.0, 0.0, -1.0]) if stimulus.normal is None else stimulus.normal.mean(axis=(0, 1))
        return np.nan_to_num(trial.force @ normal)[:, None], None
    share = np.isfinite(trial.reading).mean(axis=0)
    strength = np.where(share > MOST_KNOWN * share.max(), (np.diff(stimulus.load, axis=0) ** 2).sum(axis=0), -1.0)
    chosen = np.argsort(-strength)[:MOST_CHANNELS]
    chosen = chosen[strength[chosen] > 0]
    return trial.reading[:, chosen], chosen


def with_shift(trial: Trial, late: float) -> Trial:
    """Return a trial whose responses were late by a constant shift (s) with the stimulus at their time.

    The stimulus is moved, because motion is smooth where responses have noise, and kinks where contact begins and ends.
    Responses to a stimulus that was not recorded are missing.
    """
    source = trial.time - late
    margin = 1e-6 * trial.step
    outside = (source < trial.time[0] - margin) | (source > trial.time[-1] + margin)

    names = [name for name in ("position", "quaternion", "level", "travel") if getattr(trial, name) is not None]
    moved: dict[str, Any] = {name: columns_at(source, trial.time, getattr(trial, name)) for name in names}
    if "quaternion" in moved:
        moved["quaternion"] /= np.linalg.norm(moved["quaternion"], axis=1, keepdims=True)
    return replace(trial.without(outside), **moved)
