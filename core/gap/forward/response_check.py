# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of recordings against their stimulus: that something touches, and that the sensor answers with the right sign."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import FileError
from ..dataset.rig import Rig
from .stimulus import Stimulus

OPPOSITE = -0.5
"""Correlation of a response with its load below which the response has the other sign."""

_NO_CONTACT = {
    "pose": "the indenter never touches the sensor: check unit and sign of x, y and z, and where the shape has its origin",
    "depth": "`depth` is never above zero: give it in metres, positive where the sensor is pressed in",
    "force": "`force` is never above zero: give it in newtons, positive for compression",
}
"""Faults of a recording without contact, by the kind of its stimulus."""


def check_responses(rig: Rig, stimuli: Sequence[Stimulus]) -> None:
    """Check the recordings that are to be fitted.

    Parameters
    ----------
    rig : Rig
    stimuli : sequence of Stimulus
        Of the rig's trials, in their order.

    Raises
    ------
    FileError
        Nothing touches the sensor, no response ever changes, or the responses have the other sign.
    """
    fitted = [stimulus for stimulus in stimuli if stimulus.trial.use == "fit"]
    touching = [stimulus for stimulus in fitted if (stimulus.load > 0).any()]
    if not touching:
        files = ", ".join(f"'{stimulus.trial.name}.csv'" for stimulus in fitted[:3]) + (" …" if len(fitted) > 3 else "")
        raise FileError(f"In {files} of '{rig.name}' {_NO_CONTACT[fitted[0].trial.stimulus]}.")
    if not any(stimulus.trial.changes for stimulus in fitted):
        raise FileError(
            f"No response in the recordings of '{rig.name}' that are to be fitted ever changes: "
            "check that the sensor was read out while it was pressed."
        )
    gain = rig.parameters.gain
    gain_is_known = rig.parameters.unit == "N" or "gain" in rig.given  # else the gain, sign included, is fitted
    if gain_is_known and np.sign(gain) * correlation(responses_of(rig, touching, "reading")) < OPPOSITE:
        how = "fall" if gain > 0 else "rise"
        raise FileError(
            f"The readings of '{rig.name}' {how} where the sensor is pressed: compression counts as positive, "
            'so change the sign of texel_0 and the others, give unit and gain, or write correct = ["sign"] in [data].'
        )
    if correlation(responses_of(rig, touching, "force")) < OPPOSITE:
        raise FileError(
            f"force_x, force_y and force_z of '{rig.name}' point the other way: the force on the sensor is needed, "
            'not that on the indenter, so change their signs, or write correct = ["sign"] in [data].'
        )


def responses_of(rig: Rig, stimuli: Sequence[Stimulus], part: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return load and response of each recording that has this response, "reading" or "force".

    Readings go with the load of their texel, each component of the net force with the sum of the loads along it.
    """
    recorded = [(stimulus, getattr(stimulus.trial, part)) for stimulus in stimuli]
    return [(s.load if part == "reading" else normal_load(rig, s), values) for s, values in recorded if values is not None]


def normal_load(rig: Rig, stimulus: Stimulus) -> np.ndarray:
    """Return the sum of all loads, each along its normal force on the sensor, (T, 3) float."""
    normal = -rig.texels.normal if stimulus.normal is None else stimulus.normal
    return np.sum(stimulus.load[:, :, None] * normal, axis=1)


def centred(load: np.ndarray, response: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return load and response less the mean of their columns over the samples that were measured; zero elsewhere."""
    good = np.isfinite(response)
    count = np.maximum(good.sum(axis=0), 1)
    x, y = np.where(good, load, 0.0), np.where(good, response, 0.0)
    return np.where(good, x - x.sum(axis=0) / count, 0.0), np.where(good, y - y.sum(axis=0) / count, 0.0)


def moments(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return the sums (3,) of squares of loads, of products, and of squares of responses, as :func:`correlation` needs them."""
    sums = np.zeros(3)
    for load, response in pairs:
        x, y = centred(load, response)
        sums += (x * x).sum(), (x * y).sum(), (y * y).sum()
    return sums


def correlation(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Return the correlation of loads with responses, both less the mean of their channel; zero when nothing changes.

    Parameters
    ----------
    pairs : sequence of ((T, c) float, (T, c) float)
        Load and response of each recording; missing responses are NaN.
    """
    load_square, product, response_square = moments(pairs).tolist()
    size = float(np.sqrt(load_square) * np.sqrt(response_square))
    return product / size if size > 0.0 else 0.0
