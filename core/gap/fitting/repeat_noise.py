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

MOST_SQUARE = 2.0
"""Mean square of a fit's residual, in units of the variance of repeats, up to which the residual is their scatter. In simulated
sets of four repeats that differed in gain, zero, delay or by a slow wander, the base model left 0.3 to 1.6 where nothing was
hidden (6 sets), 1.3 where the effect was smaller than the scatter, and 7.7 to 12.9 with larger effects (5 sets). It was judged
on sets of other stimuli, scatter and effects: 0.5 to 1.2 with nothing hidden (6 sets), 2.9 and more with effects (7 sets)."""


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


def is_scatter_of_repeats(noise: Sequence[ChannelNoise], sse: np.ndarray, count: np.ndarray) -> bool:
    """Return whether a fit leaves no more than measured repeats differ by.

    Structure is then no evidence of an effect: what shifts or scales a whole recording is shared by its texels and samples, and
    stretches that are left out of a fit differ from the others by it.

    Parameters
    ----------
    noise : pair of ChannelNoise
        Of readings and of net forces.
    sse, count : (trials, 2) float
        Sum of squares of the residual of each recording, in units of the noise's variance, and number of its values.
    """
    values = count.sum(axis=0)
    main = int(np.argmax(values > 0))  # readings if there are any
    mean = sse.sum(axis=0) / np.maximum(values, 1.0)
    return noise[main].source == MEASURED_REPEATS and bool((mean[values > 0] < MOST_SQUARE).all())


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
