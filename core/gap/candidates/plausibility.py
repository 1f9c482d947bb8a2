# SPDX-License-Identifier: GPL-3.0-or-later
"""Plausibility: does a fitted effect show its characteristic signature in the recordings?

A formula that fits well on the whole may still be refuted where its effect would show most clearly: during unloading, or
without load. Then it stands for something else, and is not reported under its name.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..dataset.trial import UNLOADED_SHARE, Trial
from ..fitting.least_squares import Fit, TrialView
from ..forward.contact_phases import relative_load
from ..forward.predictor import Model, Prediction
from .candidates import Candidate, parameters_at_bounds

PULL_LEVEL = -0.5
"""Readings below this many standard deviations of the noise are pulls."""
LEAST_MEAN_PULL = -0.3
"""The predicted pulls must be at least this strong on average, in the same unit."""
ENOUGH_SAMPLES = 20
"""Number of unloaded samples from which on the mean of a texel is used."""
BEGINNING_SHARE = 0.1
"""Share of a trial that counts as its beginning: an offset is there from the first samples on."""
LEAST_PRESENT_SHARE = 0.4
"""Least share of the predicted signature that must be measured."""


def is_plausible(candidate: Candidate, found: Fit, views: Sequence[TrialView]) -> bool:
    """Return True if recordings support an effect, the last one of a fit, or do not contain its signature."""
    signature = candidate.kind.signature
    if signature == "pull":
        return _adhesion_pulls(found.model, views)
    if signature == "unloaded":
        return _offset_is_present_unloaded(found.model, views, not candidate.has_texel_parameters)
    return signature != "end" or _loss_comes_to_an_end(candidate, found)


def _loss_comes_to_an_end(candidate: Candidate, found: Fit) -> bool:
    """True if a fitted loss is over when its session ends: no path is at the bound that says so."""
    index, paths = len(found.model.effects) - 1, candidate.form.over_within
    at = parameters_at_bounds(found.model, found.free, index)
    own = (item for item in found.free if item.effect == index and item.name in paths)
    return all(at.get(item.name) != item.high for item in own)


def _adhesion_pulls(model: Model, views: Sequence[TrialView]) -> bool:
    """True if readings or net forces are negative where fitted adhesion predicts a pull, and there is such a place."""
    if all(view.predictor.trial.reading is None for view in views):
        return True  # only net forces were measured, in which a single texel's pull is not seen
    predicted = np.concatenate([_pressing(view, view.predictor.predict(model), model) for view in views])
    measured = np.concatenate([_pressing(view, view.predictor.trial, model) for view in views])
    is_pull = predicted < PULL_LEVEL
    pull, seen = predicted[is_pull], measured[is_pull]
    return len(pull) > ENOUGH_SAMPLES and float(np.nanmean(seen)) < LEAST_PRESENT_SHARE * float(pull.mean()) < LEAST_MEAN_PULL


def _pressing(view: TrialView, one: Trial | Prediction, model: Model) -> np.ndarray:
    """Readings and net forces of what a trial measured, in deviations of the noise; negative where the sensor is pulled."""
    trial, p, found = view.predictor.trial, model.parameters, []
    if trial.reading is not None and one.reading is not None:
        found.append(np.ravel(one.reading - p.zero) * np.sign(p.gain) / view.noise[0])
    if trial.force is not None and one.force is not None:
        found.append(-one.force @ view.predictor.rig.texels.normal.mean(axis=0) / view.noise[1])
    return np.concatenate(found)


def _offset_is_present_unloaded(model: Model, views: Sequence[TrialView], is_common: bool) -> bool:
    """True if a fitted offset is measured without load, from the beginning of the trials on and in each of them.

    What appears only under load, or with time (as the misfit of a drift's formula does), is something else. So is what appears
    from recording to recording, as the drift of a session that differs from texel to texel does.
    """
    index, texels = len(model.effects) - 1, len(views[0].predictor.rig.texels)
    claimed = np.broadcast_to(np.asarray(model.effects[index].values["offset"], float), texels)
    always, first = np.zeros((2, texels)), np.zeros((2, texels))
    for view in views:
        trial = view.predictor.trial
        if trial.reading is None:
            continue
        rest = (relative_load(view.predictor.stimulus) < UNLOADED_SHARE) & np.isfinite(trial.reading)
        miss = np.where(rest, trial.reading - view.predictor.predict(model.without(index)).reading, 0.0)
        begins = trial.time <= trial.time[0] + BEGINNING_SHARE * np.ptp(trial.time)
        early = rest & (np.cumsum(rest, axis=0) <= ENOUGH_SAMPLES) & begins[:, None]
        total, count = miss.sum(axis=0), rest.sum(axis=0)
        if not is_common and not _is_supported(claimed, total, count, is_common):
            return False
        always += [total, count]
        first += [np.where(early, miss, 0.0).sum(axis=0), early.sum(axis=0)]
    return all(_is_supported(claimed, total, count, is_common) for total, count in (always, first))


def _is_supported(claimed: np.ndarray, total: np.ndarray, count: np.ndarray, is_common: bool) -> bool:
    """True if the mean of each texel's samples agrees with the claimed offsets; True if there are too few samples."""
    resting = count >= ENOUGH_SAMPLES
    if resting.sum() < 2:
        return True
    seen, claimed = total[resting] / count[resting], claimed[resting]
    if not is_common:  # a common offset is the sensor's zero
        seen, claimed = seen - seen.mean(), claimed - claimed.mean()
    return float(claimed @ seen) >= LEAST_PRESENT_SHARE * float(claimed @ claimed)
