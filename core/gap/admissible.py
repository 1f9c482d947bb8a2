# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a fitted effect does what its name says where the recordings show it plainly.

A formula that fits well over all may still be refuted by the part of the recordings that is the effect's own: where the load is
taken off, or where nothing is loaded at all. Then it stands for something else and must not lend it its name.
"""

from __future__ import annotations

import numpy as np

from .noise import AT_REST
from .phases import load_of
from .search import Found, Views

PULLED = -0.5
"""Standard deviations of the noise below which a reading pulls."""
ENOUGH = 20
"""Samples without load from which on a texel's rest says something."""
PRESENT = 0.4
"""Least share of what is claimed that must be seen there."""


def admissible(found: Found, views: Views) -> bool:
    """Tell whether the recordings bear out a fitted effect where it is its own; True where they do not say."""
    if found.candidate.name == "adhesion":
        return _pulls(found, views)
    if found.candidate.name == "offset" and found.candidate.local:
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
    """An offset is what a texel reads without load: one that is only there under load is something else."""
    model = found.fit.model
    index = len(model.effects) - 1
    claimed = np.asarray(model.effects[index].values["offset"], float)
    total, count = np.zeros(len(claimed)), np.zeros(len(claimed))
    for share in views.whole:
        reading = share.predictor.trial.reading
        if reading is None:
            continue
        rest = (load_of(share.predictor.stimulus) < AT_REST) & np.isfinite(reading)
        miss = reading - share.predictor.predict(model.without(index)).reading
        total += np.where(rest, miss, 0.0).sum(axis=0)
        count += rest.sum(axis=0)
    resting = count >= ENOUGH
    if resting.sum() < 2:
        return True
    seen, claimed = total[resting] / count[resting], claimed[resting]
    seen, claimed = seen - seen.mean(), claimed - claimed.mean()  # what all share is the sensor's zero
    return float(claimed @ seen) >= PRESENT * float(claimed @ claimed)
