# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels that jump in one check recording: what they do there says nothing of an effect.

A texel whose converter jumps to another level in one recording may have a hundred times the error of all others, whatever the
model. Then the sum of squares of the check recordings is this texel's, and no effect closes half of it. Such a channel of such
a recording is set aside where the check recordings judge an amended model, and the report says which. This never
hides an error that rises: then nothing of the recording is set aside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..fitting.least_squares import TrialView
from ..forward.predictor import Model

TIMES_THE_WORST = 10.0
"""Least mean square of a channel under the base model, in units of that of the worst channel of any fitted recording. The
texel of the insole that jumps (benchmarks/RESULTS.md) has 13.6 to 123 times as much; the number was chosen after these had been
seen."""
LEAST_STAYS = 0.5
"""Least share of its squares that stays with the amended model. What an effect explains is no jump."""
MOST_LOAD = 1.05
"""Largest load of the channel in units of the largest of any channel in the fitted recordings: beyond, a model may be wrong."""
MOST_CHANNELS = 0.1
"""Largest share of the channels of a recording that are set aside. If more are outliers, the recording is different."""


@dataclass(frozen=True)
class OutlyingChannel:
    """A channel of one check recording that is far off under both models.

    Attributes
    ----------
    recording : str
    texel : int
    times : float
        Its mean square under the base model, in units of that of the worst channel of any fitted recording.
    """

    recording: str
    texel: int
    times: float


def outlying_channels(
    fitted: Sequence[TrialView], check: Sequence[TrialView], base: Model, amended: Model
) -> list[OutlyingChannel]:
    """Return the channels of check recordings that neither model describes, although all channels were described before.

    Parameters
    ----------
    fitted, check : sequence of TrialView
        All texels of the fitted recordings and of the check recordings.
    base, amended : Model
        Both fitted to the former.
    """
    if not amended.effects or not fitted:
        return []
    worst = max(float(_mean_squares(view, base).max(initial=0.0)) for view in fitted)
    loaded = max(float(view.predictor.stimulus.load.max(initial=0.0)) for view in fitted)
    found = []
    for view in check:
        before, after = _mean_squares(view, base), _mean_squares(view, amended)
        load = view.predictor.stimulus.load.max(axis=0, initial=0.0)
        outlies = (before > TIMES_THE_WORST * worst) & (after > LEAST_STAYS * before) & (load <= MOST_LOAD * loaded)
        rises = (view.squares(view.residual(amended)) > view.squares(view.residual(base))).any()
        if worst > 0.0 and 0 < outlies.sum() <= MOST_CHANNELS * len(outlies) and not rises:
            name = view.predictor.trial.name
            found += [OutlyingChannel(name, int(i), float(before[i]) / worst) for i in np.flatnonzero(outlies)]
    return found


def without_channels(check: Sequence[TrialView], channels: Sequence[OutlyingChannel]) -> list[TrialView]:
    """Return views of check recordings in which some channels were not measured."""
    views = []
    for view in check:
        trial = view.predictor.trial
        dropped = [one.texel for one in channels if one.recording == trial.name]
        if dropped and trial.reading is not None:
            reading = trial.reading.copy()
            reading[:, dropped] = np.nan
            view = replace(view, predictor=view.predictor.with_numbers_of(replace(trial, reading=reading)))
        views.append(view)
    return views


def _mean_squares(view: TrialView, model: Model) -> np.ndarray:
    """Mean square of the residual of each texel's reading, (n,); zero for those that were not measured."""
    reading = view.predictor.trial.reading
    if reading is None:
        return np.zeros(len(view.texels))
    squares: np.ndarray = (view.residual(model)[:, : len(view.texels)] ** 2).sum(axis=0)
    return squares / np.maximum(np.isfinite(reading).sum(axis=0), 1)
