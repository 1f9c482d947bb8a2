# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples that a logger repeated, and readings at the rail of a converter.

All three faults show in values that are equal to the last digit while the load changes, which noise never lets happen. Nothing
is looked for where all readings are those of an untouched sensor: electronics that cut off below a threshold repeat these, and
that is a dead zone of the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..dataset.trial import Trial, runs
from ..forward.stimulus import Stimulus
from .data_fault import DataFault

MOVING = 0.05
"""Share of the fastest change of the load (95 % quantile) above which a load counts as moving."""
LEAST_STUCK, STUCK_SAMPLES, STUCK_MOVE = 0.2, 6, 0.1
"""A logger is stuck if nothing changes for this many seconds and samples while the load changes by this share of its largest
value."""
MOST_QUIET_REPEATS = 0.05
"""It is also stuck while the load rests, if otherwise at most this share of the samples repeats the one before."""
UNTOUCHED = 1e-3
"""Share of the largest load up to which nothing presses."""
LEAST_REPEATS, MOST_STEPS = 0.08, 4.0
"""Least share of moving samples that repeat the one before. The others change by more than so many steps of the converter."""
RAIL_RUN, RAIL_MOVE, LEAST_RAILED = 4, 0.05, 12
"""Samples in a row at the extreme value while the load changes by this share of the largest; least number of such samples."""
COARSE_STEPS, MOST_LEVELS = 2.5, 1000
"""Of readings with few levels, the load must change by this many times its range over their number: each level of a coarse
converter stays while the load changes. Levels are counted up to the second number."""


def find_sample_faults(stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Return stuck loggers, repeated samples and saturated converters of some recordings."""
    stuck: dict[str, np.ndarray] = {}
    repeated: dict[str, np.ndarray] = {}
    for s in stimuli:
        load = s.load.sum(axis=1)
        change = np.abs(np.diff(load, prepend=load[0]))
        moving = change > MOVING * np.quantile(change, 0.95)
        if not moving.any():
            continue
        equal = _equal_rows(s)
        frozen = _frozen(s, equal)
        if frozen.any():
            stuck[s.trial.name] = frozen
        elif moving.sum() >= 20 and (equal & moving).sum() > LEAST_REPEATS * moving.sum() and not _is_coarse(s, equal):
            repeated[s.trial.name] = equal
    faults = []
    if stuck:
        name, frozen = max(stuck.items(), key=lambda item: int(item[1].sum()))
        seconds = float(frozen.sum()) * next(s.trial.step for s in stimuli if s.trial.name == name)
        said = f"in '{name}.csv' no response changes for {seconds:.3g} s, to the last digit"
        faults.append(DataFault("stuck-logger", tuple(stuck), said, lambda trial: trial.without(stuck[trial.name])))
    if repeated:
        name, rows = max(repeated.items(), key=lambda item: float(item[1].mean()))
        said = f"in '{name}.csv' {rows.mean():.0%} of the samples repeat the responses of the sample before to the last digit"
        faults.append(DataFault("repeated-samples", tuple(repeated), said, lambda trial: trial.without(repeated[trial.name])))
    return [*faults, *_rails(stimuli)]


def _equal_rows(stimulus: Stimulus) -> np.ndarray:
    """Samples whose responses all equal the last known ones before, (T,) bool; channels that never change do not count."""
    values = np.concatenate(stimulus.trial.responses, axis=1)
    alive = np.fmax.reduce(values, axis=0) > np.fmin.reduce(values, axis=0)
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))[:, None]), axis=0)
    before, after = np.take_along_axis(values, last, axis=0)[:-1, alive], values[1:, alive]
    same = (before == after) | np.isnan(after)
    silent = ((after == _untouched(stimulus, values)[alive]) | np.isnan(after)).all(axis=1)
    return np.concatenate([[False], same.all(axis=1) & np.isfinite(after).any(axis=1) & ~silent])


def _untouched(stimulus: Stimulus, values: np.ndarray) -> np.ndarray:
    """Value of each channel of `values` (T, c) where nothing presses, or where it presses least, (c,) float; else NaN."""
    load = stimulus.load.sum(axis=1)
    free = values[load <= UNTOUCHED * load.max()]
    free = free if len(free) else values[[int(load.argmin())]]
    median, known = np.full(values.shape[1], np.nan), np.isfinite(free).any(axis=0)
    median[known] = np.nanmedian(free[:, known], axis=0)
    return median


def _frozen(stimulus: Stimulus, equal: np.ndarray) -> np.ndarray:
    """Samples of long runs of equal responses during which the load changes, (T,) bool."""
    load, found = stimulus.load.sum(axis=1), np.zeros(len(equal), bool)
    for start, stop in runs(equal):
        duration = stimulus.time[stop - 1] - stimulus.time[start - 1]
        if stop - start < STUCK_SAMPLES or duration < LEAST_STUCK:
            continue
        elsewhere = np.concatenate([equal[:start], equal[stop:]])
        never_rests = float(elsewhere.mean()) < MOST_QUIET_REPEATS if len(elsewhere) else False
        if never_rests or np.ptp(load[start - 1 : stop]) > STUCK_MOVE * load.max():
            found[start:stop] = True
    return found


def _is_coarse(stimulus: Stimulus, equal: np.ndarray) -> bool:
    """True if equal responses may be steps of a converter: between samples they change by a few steps only."""
    change = np.abs(np.diff(np.concatenate(stimulus.trial.responses, axis=1), axis=0))
    step = np.where(change > 0, change, np.inf).min(axis=0, initial=np.inf)
    fresh = np.where(np.isfinite(change), change, 0.0)[~equal[1:]]
    return not bool((np.quantile(fresh, 0.9, axis=0) > MOST_STEPS * step)[np.isfinite(step)].any())


def _rails(stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """A converter at its rail: readings that stay at the largest or smallest value of all while the load changes."""
    recorded = [(s, s.trial.reading) for s in stimuli if s.trial.reading is not None]
    if not recorded:
        return []
    values = [reading for _, reading in recorded]
    high, low = max(float(np.nanmax(v)) for v in values), min(float(np.nanmin(v)) for v in values)
    levels = len(np.unique(np.concatenate([np.unique(v[np.isfinite(v)])[:MOST_LEVELS] for v in values])))
    least = max(RAIL_MOVE, COARSE_STEPS / max(levels, 1))
    counts = {rail: sum(_railed_samples(s, reading, rail, least) for s, reading in recorded) for rail in (high, low)}
    count, rail = max((count, rail) for rail, count in counts.items())
    if count < LEAST_RAILED:
        return []
    names = tuple(s.trial.name for s, reading in recorded if (reading == rail).any())
    which = "largest" if rail == high else "smallest"
    said = f"{count} readings stay at {rail:.6g}, the {which} of all, while the load changes"
    return [DataFault("saturated-converter", names, said, partial(_without_value, rail=rail))]


def _railed_samples(stimulus: Stimulus, reading: np.ndarray, rail: float, least: float) -> int:
    """Number of loaded samples at a rail in runs during which the texel's load changes by a share of the largest of all.

    It is no rail, but where the sensor begins, if most channels of an untouched sensor read this value.
    """
    if (_untouched(stimulus, reading) == rail).mean() > 0.5:
        return 0
    load, count = stimulus.load, 0
    for texel in np.flatnonzero((reading == rail).any(axis=0)):
        for start, stop in runs((reading[:, texel] == rail) & (load[:, texel] > 0)):
            if stop - start >= RAIL_RUN and np.ptp(load[start:stop, texel]) > least * load.max():
                count += stop - start
    return count


def _without_value(trial: Trial, rail: float) -> Trial:
    """The trial without its readings of one value."""
    assert trial.reading is not None
    return replace(trial, reading=np.where(trial.reading == rail, np.nan, trial.reading))
