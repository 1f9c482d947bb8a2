# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a fitted effect does what its name says where the recordings show it plainly.

A formula that fits well over all may still be refuted by the part of the recordings that is the effect's own: where the load is
taken off, or where nothing is loaded at all. Then it stands for something else and must not lend it its name.
"""

from __future__ import annotations

import numpy as np

from ..fitting.noise_floor import UNLOADED_SHARE
from ..forward.contact_phases import relative_load
from .candidates import FittedCandidate
from .view_set import ViewSet

PULL_LEVEL = -0.5
"""Standard deviations of the noise below which a reading pulls."""
ENOUGH_SAMPLES = 20
"""Samples without load from which on a texel's rest says something."""
BEGINNING_SHARE = 0.1
"""Share of a trial that is its beginning: what is an offset is there from the first samples on."""
LEAST_PRESENT_SHARE = 0.4
"""Least share of what is claimed that must be seen there."""


def is_plausible(found: FittedCandidate, view_set: ViewSet) -> bool:
    """Tell whether the recordings bear out a fitted effect where it is its own; True where they do not say."""
    if found.candidate.name == "adhesion":
        return _adhesion_pulls(found, view_set)
    if found.candidate.name == "offset":
        return _offset_is_present_unloaded(found, view_set)
    return True


def _adhesion_pulls(found: FittedCandidate, view_set: ViewSet) -> bool:
    """Adhesion is what pulls: a fit that never does, or does where the readings do not, describes something else."""
    predicted, measured = [], []
    for view in view_set.whole:
        p = found.fit.model.parameters
        reading = (view.predictor.predict(found.fit.model).reading - p.zero) / p.gain * abs(p.gain) / view.noise[0]
        pulled = reading < PULL_LEVEL
        if view.predictor.trial.reading is not None:
            own = (view.predictor.trial.reading - p.zero) / p.gain * abs(p.gain) / view.noise[0]
            predicted.append(reading[pulled])
            measured.append(own[pulled])
    pull, seen = np.concatenate(predicted), np.concatenate(measured)
    return len(pull) > ENOUGH_SAMPLES and float(np.nanmean(seen)) < LEAST_PRESENT_SHARE * float(pull.mean()) < -0.3


def _offset_is_present_unloaded(found: FittedCandidate, view_set: ViewSet) -> bool:
    """An offset is what a texel reads without load, from the first moment on: what is only there under load, or comes with time
    (as the part of a drift does that its formula lacks), is something else.
    """
    model = found.fit.model
    index = len(model.effects) - 1
    texels = len(view_set.whole[0].predictor.rig.texels)
    claimed = np.broadcast_to(np.asarray(model.effects[index].values["offset"], float), texels)
    always, first = np.zeros((2, texels)), np.zeros((2, texels))
    for view in view_set.whole:
        trial = view.predictor.trial
        if trial.reading is None:
            continue
        rest = (relative_load(view.predictor.stimulus) < UNLOADED_SHARE) & np.isfinite(trial.reading)
        miss = np.where(rest, trial.reading - view.predictor.predict(model.without(index)).reading, 0.0)
        begins = trial.time <= trial.time[0] + BEGINNING_SHARE * np.ptp(trial.time)
        early = rest & (np.cumsum(rest, axis=0) <= ENOUGH_SAMPLES) & begins[:, None]
        always += [miss.sum(axis=0), rest.sum(axis=0)]
        first += [np.where(early, miss, 0.0).sum(axis=0), early.sum(axis=0)]
    alike = not found.candidate.has_texel_parameters
    return all(_is_borne_out(claimed, total, count, alike) for total, count in (always, first))


def _is_borne_out(claimed: np.ndarray, total: np.ndarray, count: np.ndarray, alike: bool) -> bool:
    """Whether the means of some samples of each texel bear out what is claimed; True where there are too few."""
    resting = count >= ENOUGH_SAMPLES
    if resting.sum() < 2:
        return True
    seen, claimed = total[resting] / count[resting], claimed[resting]
    if not alike:  # what all share is the sensor's zero
        seen, claimed = seen - seen.mean(), claimed - claimed.mean()
    return float(claimed @ seen) >= LEAST_PRESENT_SHARE * float(claimed @ claimed)
