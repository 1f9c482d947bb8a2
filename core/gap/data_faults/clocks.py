# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks of stimulus and response that are shifted: at which shift of some seconds their changes correlate best.

Changes and not values are compared, because creep, drift and hysteresis hardly move a change. Clocks that run apart are not
looked for: those of computers differ by less than 1e-4, which shifts the end of a recording of ten minutes by 0.06 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..dataset.shift_peak import peak_offset
from ..dataset.trial import Trial
from ..forward.stimulus import Stimulus
from .data_fault import Correction, DataFault

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
MOST_KNOWN = 0.9
"""Share of the samples of the best known channel that a channel has to have."""


@dataclass(frozen=True)
class Shift:
    """How late (s) a response is, and the correlation of its changes with those of the load: with this shift, and without."""

    late: float
    correlation: float
    unshifted: float


def find_clock_faults(stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Return the shifted clocks of some recordings."""
    known = {s.trial.name: shift for s in stimuli if (shift := shift_of(s)) is not None}
    typical = float(np.median([one.late for one in known.values()])) if known else 0.0
    shifts = {}
    for s in stimuli:
        shift = known.get(s.trial.name)
        if shift is None or not _is_clearly_better(shift.correlation, shift.unshifted):
            continue
        least = max(LEAST_SHIFT, LEAST_SHIFT_SAMPLES * s.trial.step)
        is_common = abs(shift.late - typical) < least
        if is_common and shift.late > LONGEST_LAG and _is_clearly_better(_correlation_of_lag(s, shift.late), shift.correlation):
            continue
        if shift.late < -least or shift.late > (max(LONGEST_LAG, least) if is_common else least):
            shifts[s.trial.name] = shift
    if not shifts:
        return []
    name = max(shifts, key=lambda one: shifts[one].correlation - shifts[one].unshifted)
    corrections: dict[str, Correction] = {one: partial(with_shift, late=shift.late) for one, shift in shifts.items()}
    return [DataFault("clock-shift", tuple(shifts), _sentence(shifts[name], name), corrections)]


def shift_of(stimulus: Stimulus) -> Shift | None:
    """Return how late the response of a recording is; None if that cannot be judged."""
    prepared = _changes(stimulus)
    if prepared is None:
        return None
    time, load, response, step = prepared
    most = int(min(LONGEST_SHIFT, LARGEST_SHIFT_SHARE * (time[-1] - time[0])) / step)
    size = np.sqrt(float((load * load).sum())) * np.sqrt(float((response * response).sum()))
    if most < 4 or size <= 0.0:
        return None
    padded = np.concatenate([np.zeros((most, load.shape[1])), response, np.zeros((most, load.shape[1]))])
    total = np.array([(load * padded[k : k + len(load)]).sum() for k in range(2 * most + 1)]) / size
    if -total.min() > total.max():  # a response that falls under load is as good as one that rises
        total = -total
    best = int(np.argmax(total))
    late = (best - most + peak_offset(total, best)) * step
    return Shift(late, float(total[best]), float(total[most])) if total[best] >= LEAST_CORRELATION else None


def _is_clearly_better(new: float, old: float) -> bool:
    """True if one correlation is so much larger than another one that this is no accident."""
    return new - old >= LEAST_GAIN and 1.0 - new < MOST_LEFT * (1.0 - old)


def _correlation_of_lag(stimulus: Stimulus, late: float) -> float:
    """Largest correlation of the changes of response and load behind low passes that delay the load about as much, s."""
    from scipy.signal import lfilter

    prepared = _changes(stimulus)
    if prepared is None:
        return 0.0
    _, load, response, step = prepared
    size, best = float((response * response).sum()), 0.0
    for stages in LAG_STAGES:
        for tau in LAG_TIMES * late / stages:
            keeps = float(np.exp(-step / tau))
            smeared = load
            for _ in range(stages):
                smeared = lfilter([1.0 - keeps], [1.0, -keeps], smeared, axis=0)
            product = abs(float((smeared * response).sum()))
            best = max(best, product / max(np.sqrt(float((smeared * smeared).sum()) * size), 1e-300))
    return best


def _changes(stimulus: Stimulus) -> tuple[np.ndarray, np.ndarray, np.ndarray, float] | None:
    """Even times, changes of load and of response on them (T, c), and the step; None without enough of either."""
    trial = stimulus.trial
    load, response = _signals(stimulus)
    good = np.isfinite(response).all(axis=1)
    if good.sum() < LEAST_SAMPLES or not load.any():
        return None
    step = max(trial.step, float(np.ptp(trial.time)) / MOST_SAMPLES)
    if np.ptp(trial.time) / step > 2 * MOST_SAMPLES:
        return None
    even = np.arange(trial.time[0], trial.time[-1], step)
    on_even = [
        np.stack([np.interp(even, trial.time[good], column[good]) for column in values.T], axis=1)
        for values in (load, response)
    ]
    width = max(1, round(SMOOTHING / step))
    if len(even) < width + LEAST_SAMPLES:
        return None
    x, y = (values[width:] - values[:-width] for values in on_even)
    return even[width:], x / max(float(np.abs(x).max()), 1e-300), y / max(float(np.abs(y).max()), 1e-300), step


def _signals(stimulus: Stimulus) -> tuple[np.ndarray, np.ndarray]:
    """Loads and responses (T, c) of the channels with the largest loads; the net force counts only without readings."""
    if stimulus.trial.reading is None:
        return stimulus.load.sum(axis=1, keepdims=True), _net_force_along_normal(stimulus)
    chosen = _strongest_channels(stimulus, MOST_CHANNELS)
    return stimulus.load[:, chosen], stimulus.trial.reading[:, chosen]


def _strongest_channels(stimulus: Stimulus, most: int) -> np.ndarray:
    """Channels with readings whose loads change most."""
    assert stimulus.trial.reading is not None
    share = np.isfinite(stimulus.trial.reading).mean(axis=0)
    known = share > MOST_KNOWN * share.max()
    strength = np.where(known, (np.diff(stimulus.load, axis=0) ** 2).sum(axis=0), -1.0)
    chosen = np.argsort(-strength)[:most]
    found: np.ndarray = chosen[strength[chosen] > 0]
    return found


def _net_force_along_normal(stimulus: Stimulus) -> np.ndarray:
    """Net force along the mean normal of the contacts, (T, 1)."""
    assert stimulus.trial.force is not None
    normal = np.array([0.0, 0.0, -1.0]) if stimulus.normal is None else stimulus.normal.mean(axis=(0, 1))
    return np.nan_to_num(stimulus.trial.force @ normal)[:, None]


def _sentence(shift: Shift, name: str) -> str:
    way = "after" if shift.late > 0 else "before"
    return (
        f"in '{name}.csv' the response comes {abs(shift.late):.3g} s {way} the stimulus "
        f"(correlation of their changes {shift.correlation:.2f}, unshifted {shift.unshifted:.2f})"
    )


def with_shift(trial: Trial, late: float) -> Trial:
    """Return a trial whose responses were late by a constant shift (s) with the stimulus at their time.

    The stimulus is moved, because motion is smooth where responses have noise, and kinks where contact begins and ends.
    Responses to a stimulus that was not recorded are missing.
    """
    source = trial.time - late
    margin = 1e-6 * trial.step
    outside = (source < trial.time[0] - margin) | (source > trial.time[-1] + margin)

    def known(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else np.where(outside[:, None], np.nan, values)

    def at_source(values: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(source, trial.time, column) for column in values.T], axis=1)

    quaternion = None if trial.quaternion is None else at_source(trial.quaternion)
    if quaternion is not None:
        quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    return replace(
        trial,
        reading=known(trial.reading),
        force=known(trial.force),
        position=None if trial.position is None else at_source(trial.position),
        quaternion=quaternion,
        level=None if trial.level is None else at_source(trial.level[:, None])[:, 0],
        slide=at_source(trial.slide),
    )
