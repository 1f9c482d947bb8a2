# SPDX-License-Identifier: GPL-3.0-or-later
"""Assumptions about how recordings differ: by a factor and a zero of each, or as one session in their order.

A sensor that was mounted again, or whose amplifier was set to another range, responds alike but for a factor and a zero. One
that wears or drifts goes on from recording to recording, though the rig names no session.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..dataset.rig import Rig
from ..dataset.trial import is_mixed, on_common_clocks
from ..forward.predictor import Model, Predictor

LEAST_RECORDINGS = 3
"""Number of fitted recordings from which on they are compared: of two, each may be the odd one."""
ASSUMED = "assumed"
"""Name of the session that no rig names."""
ODD_TIMES = 5.0
"""A recording alone differs if its distance from the middle gain and level is this many times that of any other. It sets a
sentence and no name."""


@dataclass(frozen=True)
class RecordingDifferences:
    """Levels and gains by which recordings differ.

    Attributes
    ----------
    closes : float
        Share of the squared gap that they close alone, on unseen stretches.
    confidence : float
        Weight of models with them against models without.
    before : float
        NRMSE on the fitted recordings of the base model without them.
    factors, zeros : dict of str to float
        Of the recordings, in order of the rig; zeros in the sensor's unit.
    """

    closes: float
    confidence: float
    before: float
    factors: dict[str, float]
    zeros: dict[str, float]

    def odd_recording(self, full: float) -> tuple[str, float, float] | None:
        """Return the recording that alone differs from the others, with its gain over the median, less one, and its level over
        the median, as a share of the range; None if several do, or none.

        Parameters
        ----------
        full : float
            Range of the readings.
        """
        names = list(self.factors)
        gains, levels = np.array([self.factors[n] for n in names]), np.array([self.zeros.get(n, 0.0) for n in names]) / full
        gains, levels = gains / np.median(gains) - 1.0, levels - np.median(levels)
        apart = np.hypot(gains, levels)
        first, second = np.argsort(apart)[::-1][:2]
        if not apart[first] > ODD_TIMES * apart[second]:
            return None
        return names[first], float(gains[first]), float(levels[first])


def may_differ(rig: Rig) -> bool:
    """Return whether recordings may have unknown gains and zeros, or belong to one unnamed session.

    False if the rig names sessions, repeats, specimens or numbers of recordings, or has fewer than three recordings to be
    fitted.
    """
    known = any(trial.session or trial.repeats or trial.factor != 1.0 or trial.zero != 0.0 for trial in rig.trials)
    return not known and len(rig.of("fit")) >= LEAST_RECORDINGS


def with_own_numbers(rig: Rig) -> Rig:
    """Return a rig whose recordings each have a free factor and zero."""
    trials = (replace(one, factor=one.name, zero=0.0 if one.reading is None or one.tared else one.name) for one in rig.trials)
    return replace(rig, trials=tuple(trials))


def as_one_session(rig: Rig) -> Rig | None:
    """Return a rig whose recordings are one session in their order; None if they cannot be.

    The pauses between them are assumed, but which recording came first is not.
    """
    if is_mixed(rig.trials):
        return None
    members = [replace(trial, session=ASSUMED) for trial in rig.trials]
    trials, _ = on_common_clocks(members, [None] * len(members), "own", Path(rig.name))
    return replace(rig, trials=tuple(trials))


def own_numbers(model: Model, predictors: Sequence[Predictor]) -> tuple[dict[str, float], dict[str, float]]:
    """Return factors and zeros of recordings by name, those of check recordings by what is measured in them."""
    factors, zeros = {}, {}
    for one in predictors:
        trial = one.trial
        alike = one.with_numbers_of(replace(trial, factor=1.0, zero=0.0)).predict(model)
        rest = 0.0 if trial.tared or trial.reading is None else model.parameters.zero
        predicted, measured = (alike.force, trial.force) if trial.reading is None else (alike.reading, trial.reading)
        if predicted is not None and measured is not None:
            factors[trial.name], zeros[trial.name] = one.numbers(model, predicted - rest, measured - rest)
    return factors, zeros
