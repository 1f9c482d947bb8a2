# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences between recordings: a level and a gain of each, which no state of the sensor within a recording explains.

A sensor that wears, drifts or warms up from recording to recording looks, without a session in the rig, like one whose
recordings differ. Effects of single texels or of the contact may then be fitted to these differences. So the search for effects
is done a second time with a free factor and zero of each recording, if these alone close a good part of the gap, and counts if
far less is left. Wear and softening go with the load alone, so their order is enough to look for them across the recordings.

Gains that fall are wear or drift, and recordings without times do not tell which, with one exception: where some texels carried
far more than others and all lost alike, it is no wear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...effects.engine.registry import only_name_where
from ..dataset.rig import Rig
from ..dataset.trial import COMMON, Trial, TrialHistory, on_common_clocks
from ..forward.predictor import Model, Predictor, number_name
from ..forward.stimulus import Stimulus
from .identifiability import LOSING

LEAST_RECORDINGS = 3
"""Number of fitted recordings from which on they are compared: of two, each may be the odd one."""
LEAST_CLOSED = 0.25
"""Least share of the gap that factors and zeros alone must close, as for any first effect."""
LEAST_LOWERED = 0.1
"""Least mean square, in units of the noise's variance, by which they must lower the residual: noise is coloured."""
MOST_LEFT = 0.5
"""With factors and zeros, the search must leave less than this share of what it leaves without."""
LOAD_HISTORY = LOSING
"""Effects that need no clock to be found across recordings in a known order: they go with what was pressed."""
WEAR = only_name_where(lambda kind: kind.gain_falls_with == "use")
DRIFT = only_name_where(lambda kind: kind.gain_falls_with == "clock")
"""The effect that lowers the gain with use, and the one that lowers it with time."""
WEAR_ORDER = -0.5
"""Correlation of the factors, or of their ranks, with the order of the recordings below which they fall as of wear."""
TEXELS = "texels"
"""Evidence that gains fall with the time: texels that carried unequal loads lose alike."""
LEAST_RATIO_OF_LOADS = 2.0
"""Least ratio of what the more and the less loaded texels carried (90th and 10th percentile) from which on texels can tell.

Under equal loads the wear of each texel is a gain that all share: two formulas are compared, not wear and drift, and of six
sets of recordings under a plate that were alike three were called drift for it.
"""
LEAST_GAINS = 4
"""Number of gains from which on a change is seen in them: a line has two numbers."""
CHANGE_RATIO = 0.1
"""Gains change once if two levels leave less than this share of what a line over the recordings leaves: the quantile of 5 % of
the F distribution for six gains is 0.11. As they carry no time, the line is over their number."""
UNRESOLVED_SHARE = 0.001
"""Share of the squares of the gains that counts as left at least."""

ODD_TIMES = 5.0
"""A recording alone differs if its distance from the middle gain and level is this many times that of any other. It sets a
sentence and no name."""


@dataclass(frozen=True)
class RecordingDifferences:
    """Levels and gains by which recordings differ.

    Attributes
    ----------
    closes : float
        Share of the gap that they close alone, on unseen stretches.
    confidence : float
    before : float
        NRMSE on the fitted recordings of the base model without them.
    factors, zeros : dict of str to float
        Of the fitted recordings, in order of the rig; zeros in the sensor's unit.
    evidence : str
        :data:`TEXELS` if gains fall and texels say that it is no wear, else empty.
    rival : str
        :data:`WEAR` if gains fall and nothing tells whether with use or time, else empty.
    changed_from : str
        The recording from which on gains are others, if they change once: then the name is in doubt. Empty if they do not.
    """

    closes: float
    confidence: float
    before: float
    factors: dict[str, float]
    zeros: dict[str, float]
    evidence: str = ""
    rival: str = ""
    changed_from: str = ""

    @property
    def change_of_gain(self) -> float:
        """Ratio of the mean gains from :attr:`changed_from` on and before it, less 1; zero if gains do not change once."""
        names = list(self.factors)
        if self.changed_from not in names:
            return 0.0
        before, after = np.split(np.array(list(self.factors.values())), [names.index(self.changed_from)])
        return float(after.mean() / before.mean()) - 1.0

    @property
    def name(self) -> str:
        """The effect that changes levels and gains from recording to recording."""
        return DRIFT

    def odd_recording(self, full: float) -> OddRecording | None:
        """Return the recording that alone differs from the others; None if several do, or none.

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
        return OddRecording(names[first], float(gains[first]), float(levels[first]))


@dataclass(frozen=True)
class OddRecording:
    """The one recording that differs: its gain relative to the others less 1, and its level above theirs in ranges."""

    name: str
    gain: float
    level: float


def may_differ(rig: Rig) -> bool:
    """Return whether it is a question in a rig how its recordings differ.

    It is none if the rig names sessions, repeats, specimens or numbers of recordings, or has fewer than three recordings to be
    fitted.
    """
    said = any(trial.session or trial.repeats or trial.factor != 1.0 or trial.zero != 0.0 for trial in rig.trials)
    return not said and len(rig.of("fit")) >= LEAST_RECORDINGS


def with_own_numbers(rig: Rig) -> Rig:
    """Return a rig whose recordings each have a free factor and zero."""
    return replace(rig, trials=tuple(replace(one, factor=one.name, zero=_free_zero(one, one.name)) for one in rig.trials))


def with_common_zero(rig: Rig) -> Rig:
    """Return a rig whose recordings share a free zero: what this closes is no difference between them."""
    return replace(rig, trials=tuple(replace(one, zero=_free_zero(one, COMMON)) for one in rig.trials))


def _free_zero(trial: Trial, name: str) -> str | float:
    return 0.0 if trial.reading is None or trial.tared else name


def as_one_session(rig: Rig) -> Rig | None:
    """Return a rig whose recordings are one session in their order; None if they cannot be.

    The pauses between them are not known, so what this session says of time does not count.
    """
    if len({trial.stimulus == "force" for trial in rig.trials}) > 1:
        return None
    histories = [TrialHistory(COMMON)] * len(rig.trials)
    trials, _ = on_common_clocks(rig.trials, histories, "own", Path(rig.name))
    return replace(rig, trials=tuple(trials))


def change_of_level(gains: np.ndarray) -> int | None:
    """Return the number of the first gain after a change, if two levels leave far less than a line over the number; else None.

    Parameters
    ----------
    gains : (n,) float
        Of recordings in their order.
    """
    if len(gains) < LEAST_GAINS or not (gains > 0.0).all():
        return None
    logs, number = np.log(gains), np.arange(len(gains))
    whole = max(float(((logs - logs.mean()) ** 2).sum()), 1e-300)
    left = [float(sum(((part - part.mean()) ** 2).sum() for part in np.split(logs, [i]))) / whole for i in number[1:]]
    line = np.polynomial.Polynomial.fit(number, logs, 1)
    by_line = max(float(((logs - line(number)) ** 2).sum()) / whole, UNRESOLVED_SHARE)
    return int(np.argmin(left)) + 1 if max(min(left), UNRESOLVED_SHARE) < CHANGE_RATIO * by_line else None


def texels_can_tell(order: Sequence[Stimulus]) -> bool:
    """Return whether wear would change texels differently: some carried far more than others over all recordings."""
    rises = sum(np.maximum(np.diff(one.load, axis=0), 0.0).sum(axis=0) for one in order)
    used = np.atleast_1d(rises)[np.atleast_1d(rises) > 0.0]
    if len(used) < 2:
        return False
    low, high = np.percentile(used, [10.0, 90.0])
    return bool(high >= LEAST_RATIO_OF_LOADS * low)


def differences(
    model: Model, order: Sequence[Predictor], closes: float, before: float, full: float, texels_alike: bool
) -> RecordingDifferences:
    """Return the levels and gains of a fitted model by name, and whether they may be wear.

    Parameters
    ----------
    model : Model
    order : sequence of Predictor
        Of all recordings, in the order of the rig.
    closes, before : float
        See :class:`RecordingDifferences`.
    full : float
        Range of the readings.
    texels_alike : bool
        True if gains that all texels share describe the recordings far better than what each texel was loaded with.
    """
    names = [one.trial.name for one in order if one.trial.use == "fit"]
    factors = {name: model.recordings.get(number_name("factor", name), 1.0) for name in names}
    zeros = {name: model.recordings.get(number_name("zero", name), 0.0) for name in names}
    confidence = round(0.5 + 0.5 * float(np.clip(closes, 0.0, 1.0)), 3)
    drift = RecordingDifferences(closes, confidence, before, factors, zeros)
    gain, level = np.array(list(factors.values())), np.array(list(zeros.values()))
    in_order = [(g, np.arange(len(g))) for g in (np.argsort(np.argsort(gain)), gain) if np.ptp(g) > 0]  # on either side of a
    falls = any(float(np.corrcoef(g, number)[0, 1]) < WEAR_ORDER for g, number in in_order)  # change, ranks are of chance
    if float(gain.std()) * full <= float(level.std()):
        return drift
    first = change_of_level(gain)
    drift = drift if first is None else replace(drift, changed_from=names[first])
    if not falls:
        return drift
    told = texels_alike and texels_can_tell([one.stimulus for one in order])
    return replace(drift, evidence=TEXELS) if told else replace(drift, rival=WEAR)
