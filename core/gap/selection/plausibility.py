# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a fitted effect does what its name says where the recordings show it plainly.

A formula that fits well over all may still be refuted by the part of the recordings that is the effect's own: where the load is
taken off, or where nothing is loaded at all. Then it stands for something else and must not lend it its name.
"""

from __future__ import annotations

import numpy as np

from ..fitting.noise_floor import AT_REST
from ..forward.contact_phases import load_of
from .screening import Found, Views

PULLED = -0.5
"""Standard deviations of the noise below which a reading pulls."""
ENOUGH = 20
"""Samples without load from which on a texel's rest says something."""
BEGINS = 0.1
"""Share of a trial that is its beginning: what is an offset is there from the first samples on."""
PRESENT = 0.4
"""Least share of what is claimed that must be seen there."""


def admissible(found: Found, views: Views) -> bool:
    """Tell whether the recordings bear out a fitted effect where it is its own; True where they do not say."""
    if found.candidate.name == "adhesion":
        return _pulls(found, views)
    if found.candidate.name == "offset":
        return _is_there_at_rest(found, views)
    return True


def _pulls(found: Found, views: Views) -> bool:
    """Adhesion is what pulls: a fit that never does, or does where the readings do not, describes something else."""
    predicted, measured = [], []
    for share in views.whole:
        p = found.fit.model.parameters
        reading = (share.predictor.predict(found.fit.model).reading - p.zero) / p.gain * abs(p.gain) / share.noise[0]
        pulled = reading < PULLED
        if share.predictor.trial.reading is not None:
            own = (share.predictor.trial.reading - p.zero) / p.gain * abs(p.gain) / share.noise[0]
            predicted.append(reading[pulled])
            measured.append(own[pulled])
    pull, seen = np.concatenate(predicted), np.concatenate(measured)
    return len(pull) > ENOUGH and float(np.nanmean(seen)) < PRESENT * float(pull.mean()) < -0.3


def _is_there_at_rest(found: Found, views: Views) -> bool:
    """An offset is what a texel reads without load, from the first moment on: what is only there under load, or comes with time
    (as the part of a drift does that its formula lacks), is something else.
    """
    model = found.fit.model
    index = len(model.effects) - 1
    texels = len(views.whole[0].predictor.rig.texels)
    claimed = np.broadcast_to(np.asarray(model.effects[index].values["offset"], float), texels)
    always, first = np.zeros((2, texels)), np.zeros((2, texels))
    for share in views.whole:
        trial = share.predictor.trial
        if trial.reading is None:
            continue
        rest = (load_of(share.predictor.stimulus) < AT_REST) & np.isfinite(trial.reading)
        miss = np.where(rest, trial.reading - share.predictor.predict(model.without(index)).reading, 0.0)
        begins = trial.time <= trial.time[0] + BEGINS * np.ptp(trial.time)
        early = rest & (np.cumsum(rest, axis=0) <= ENOUGH) & begins[:, None]
        always += [miss.sum(axis=0), rest.sum(axis=0)]
        first += [np.where(early, miss, 0.0).sum(axis=0), early.sum(axis=0)]
    alike = not found.candidate.local
    return all(_is_seen(claimed, total, count, alike) for total, count in (always, first))


def _is_seen(claimed: np.ndarray, total: np.ndarray, count: np.ndarray, alike: bool) -> bool:
    """Whether the means of some samples of each texel bear out what is claimed; True where there are too few."""
    resting = count >= ENOUGH
    if resting.sum() < 2:
        return True
    seen, claimed = total[resting] / count[resting], claimed[resting]
    if not alike:  # what all share is the sensor's zero
        seen, claimed = seen - seen.mean(), claimed - claimed.mean()
    return float(claimed @ seen) >= PRESENT * float(claimed @ claimed)
