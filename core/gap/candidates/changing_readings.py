# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings that change, in which steps of a converter are looked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..fitting.least_squares import TrialView
from ..forward.predictor import Model

MOST_READINGS = 6000
"""Number of changing readings to which they are thinned."""


def moving_values(views: Sequence[TrialView], model: Model) -> np.ndarray:
    """Return some thousand readings of samples at which the model changes by more than the noise, and predictions, (n, 2)."""
    moving = [np.zeros((0, 2))]
    for view in views:
        reading = view.predictor.trial.reading
        if reading is not None:
            predicted = view.predictor.predict(model).reading
            used = (np.abs(np.gradient(predicted, axis=0)) > 0.5 * view.noise[0]) & np.isfinite(reading)
            moving.append(np.column_stack([reading[used], predicted[used]]))
    values = np.concatenate(moving)
    return values[:: max(1, len(values) // MOST_READINGS)]
