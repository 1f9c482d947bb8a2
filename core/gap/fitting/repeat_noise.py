# SPDX-License-Identifier: GPL-3.0-or-later
"""The noise floor from measured repeats: how far recordings of the same stimulus differ from each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import FileError
from ..forward.predictor import Predictor
from .noise_floor import AUTOCOVARIANCE_LAGS, ChannelNoise, integral_time

MEASURED_REPEATS = "measured repeats"
"""Source of such noise, in words."""
MOST_DIFFERENT = 0.1
"""Root mean square difference of the loads of two repeats, as a share of the largest load, above which they are none."""


def with_repeats(noise: ChannelNoise, predictors: Sequence[Predictor], part: str) -> ChannelNoise:
    """Return the noise of a channel, or the scatter of the recordings that are repeats of each other where that is larger.

    Parameters
    ----------
    noise : ChannelNoise
    predictors : sequence of Predictor
    part : "reading" or "force"

    Raises
    ------
    FileError
        Recordings are called repeats and do not have the same load.
    """
    groups: dict[str, list[Predictor]] = {}
    for one in predictors:
        if one.trial.repeats and getattr(one.trial, part) is not None:
            groups.setdefault(one.trial.repeats, []).append(one)
    curve, square, count = np.zeros(AUTOCOVARIANCE_LAGS), 0.0, 0
    for name, members in groups.items():
        if len(members) < 2:
            continue
        scatter = _scatter(members, part, name)
        good = np.isfinite(scatter)
        values = np.where(good, scatter, 0.0)
        square += float((values**2).sum())
        count += int(good.sum())
        for lag in range(min(AUTOCOVARIANCE_LAGS, values.shape[1] // 4 + 1)):
            curve[lag] += float((values[:, : values.shape[1] - lag] * values[:, lag:]).sum())
    deviation = float(np.sqrt(square / count)) if count else 0.0
    if deviation <= noise.deviation:
        return noise
    return ChannelNoise(deviation, integral_time([curve]), MEASURED_REPEATS)


def _scatter(members: Sequence[Predictor], part: str, name: str) -> np.ndarray:
    """Differences of repeats from their mean at equal times, scaled to the deviation of one recording, (members, T, c)."""
    first = members[0]
    clock = first.trial.time - first.trial.time[0]
    clock = clock[clock <= min(float(np.ptp(one.trial.time)) for one in members)]
    loads = np.array([_at(clock, one, one.stimulus.load) for one in members])
    most = max(float(loads.max(initial=0.0)), 1e-300)
    for one, load in zip(members[1:], loads[1:], strict=True):
        if float(np.sqrt(np.mean((load - loads[0]) ** 2))) > MOST_DIFFERENT * most:
            raise FileError(
                f"'{one.trial.name}.csv' and '{first.trial.name}.csv' are called repeats ({name}) and their loads differ: "
                "name only recordings of the same stimulus, begun at the same moment of it."
            )
    values = np.array([_at(clock, one, getattr(one.trial, part)) for one in members])
    scatter: np.ndarray = (values - values.mean(axis=0)) * np.sqrt(len(members) / (len(members) - 1.0))
    return scatter


def _at(clock: np.ndarray, one: Predictor, values: np.ndarray) -> np.ndarray:
    """Values (T, c) of a recording at times since its beginning; NaN beside missing ones."""
    time = one.trial.time - one.trial.time[0]
    return np.stack([np.interp(clock, time, column) for column in values.T], axis=1)
