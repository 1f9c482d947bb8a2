# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels that answer at first and then no more: what the report says of them, and no effect describes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..fitting.noise_floor import SHORTEST_STRETCH
from ..forward.predictor import Model, Predictor
from .direct_estimates import LEAST_LOADED_SQUARE, LEAST_SLOPE, PRESSED_SHARE

LIVELY_SLOPE = 0.5
"""Least slope of measured over predicted readings, in units of the median texel's, of a texel that answered before."""


@dataclass(frozen=True)
class SilencedTexel:
    """A texel that answers no more from a time on.

    Attributes
    ----------
    texel : int
    recording : str
    seconds : float
        Time in this recording of the first pressed sample without an answer.
    """

    texel: int
    recording: str
    seconds: float


def silenced_texels(predictors: Sequence[Predictor], model: Model, noise: float) -> list[SilencedTexel]:
    """Return the texels that answer while they are pressed in the beginning, and no more in the end.

    Parameters
    ----------
    predictors : sequence of Predictor
        Of all recordings, in the order of the rig.
    model : Model
        What a texel should read.
    noise : float
        Standard deviation of the readings.
    """
    pairs = [(one, one.trial.reading) for one in predictors if one.trial.reading is not None]
    if not pairs:
        return []
    expected = np.concatenate([one.predict(model).reading for one, _ in pairs]) - model.parameters.zero
    measured = np.concatenate([reading for _, reading in pairs]) - model.parameters.zero
    # Pressed samples alone: at the end of a release the model may say a load where the sensor has none any more.
    # Nor does a texel at the rim of a contact, which is hardly pressed, say anything.
    most = np.maximum(np.abs(expected).max(axis=0), PRESSED_SHARE * np.abs(expected).max(initial=0.0))
    known = np.isfinite(measured) & (np.abs(expected) > PRESSED_SHARE * most)
    x, y = np.where(known, expected, 0.0) / noise, np.where(known, measured, 0.0) / noise
    square, product = np.cumsum(x * x, axis=0), np.cumsum(x * y, axis=0)
    whole = square[-1] > 2.0 * LEAST_LOADED_SQUARE
    if not whole.any():
        return []
    usual = float(np.median(product[-1, whole] / square[-1, whole]))
    starts = np.cumsum([0, *(len(reading) for _, reading in pairs)])  # of the recordings among all samples
    found = []
    for texel in np.flatnonzero(whole):
        before, after = square[:-1, texel], square[-1, texel] - square[:-1, texel]
        judged = (before > LEAST_LOADED_SQUARE) & (after > LEAST_LOADED_SQUARE)
        judged &= np.cumsum(x[::-1, texel] != 0.0)[::-1][1:] >= SHORTEST_STRETCH
        if not judged.any():
            continue
        closes = product[:-1, texel] ** 2 / np.maximum(before, 1e-300)
        last = int(np.argmax(np.where(judged, closes, -np.inf)))  # before it the texel follows the model, behind it nothing
        slopes = product[last, texel] / before[last], (product[-1, texel] - product[last, texel]) / after[last]
        if slopes[0] > LIVELY_SLOPE * usual > 0.0 and slopes[1] < LEAST_SLOPE * usual:
            loaded = last + 1 + int(np.argmax(x[last + 1 :, texel] != 0.0))
            number = int(np.searchsorted(starts, loaded, side="right")) - 1
            trial = pairs[number][0].trial
            found.append(SilencedTexel(int(texel), trial.name, float(trial.time[loaded - starts[number]] - trial.time[0])))
    return found
