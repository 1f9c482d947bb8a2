# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences between recordings: a level and a gain of each, which no state of the sensor within a recording explains.

A sensor that wears, drifts or warms up from recording to recording looks, without a session in the rig, like one whose
recordings differ. Effects of single texels or of the contact may then be fitted to these differences. So the search for effects
is done a second time with a free factor and zero of each recording, if these alone close a good part of the gap, and counts if
far less is left. Wear and softening go with the load alone, so their order is enough to look for them across the recordings.
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
from .identifiability import LOSING
from .wear_or_drift import CLOCK, NOTHING, TEXELS, USE, changed_from, evidence_of_recordings, texels_can_tell

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
WEAR = only_name_where(lambda kind: kind.gain_falls_with == USE)
DRIFT = only_name_where(lambda kind: kind.gain_falls_with == CLOCK)
"""The effect that lowers the gain with use, and the one that lowers it with time."""
WEAR_ORDER = -0.5
"""Correlation of the factors, or of their ranks, with the order of the recordings below which they fall as of wear."""

ODD_TIMES = 5.0
"""A recording alone differs if its distance from the middle gain and level is this many times that of any other. It sets a
sentence and no name."""


@dataclass(frozen=True)
class RecordingDifferences:
    """Levels and gains by which recordings differ.

    Attributes
    ----------
    name : str
        :data:`WEAR` if gains fall with use, else :data:`DRIFT`.
    closes : float
        Share of the gap that they close alone, on unseen stretches.
    confidence : float
    before : float
        NRMSE on the fitted recordings of the base model without them.
    factors, zeros : dict of str to float
        Of the fitted recordings, in order of the rig; zeros in the sensor's unit.
    evidence : str
        What tells gains that fall apart as wear or drift (see :mod:`.wear_or_drift`); empty if nothing does, or if none fall.
    rival : str
        The other name, if gains fall and nothing tells which it is.
    changed_from : str
        The recording from which on gains are others, if they change once and neither with use nor with time: then the name is
        in doubt. Empty if they do not.
    """

    name: str
    closes: float
    confidence: float
    before: float
    factors: dict[str, float]
    zeros: dict[str, float]
    evidence: str = NOTHING
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


def differences(
    model: Model, order: Sequence[Predictor], closes: float, before: float, full: float, texels_alike: bool
) -> RecordingDifferences:
    """Return the levels and gains of a fitted model by name, and whether they are wear or drift.

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
    drift = RecordingDifferences(DRIFT, closes, confidence, before, factors, zeros)
    gain, level = np.array(list(factors.values())), np.array(list(zeros.values()))
    in_order = [(g, np.arange(len(g))) for g in (np.argsort(np.argsort(gain)), gain) if np.ptp(g) > 0]  # on either side of a
    falls = any(float(np.corrcoef(g, number)[0, 1]) < WEAR_ORDER for g, number in in_order)  # change, ranks are of chance
    if float(gain.std()) * full <= float(level.std()):
        return drift
    stimuli = [one.stimulus for one in order]
    drift = replace(drift, changed_from=changed_from(stimuli, factors))
    if not falls:
        return drift
    by_texels = TEXELS if texels_alike and texels_can_tell(stimuli) else NOTHING
    evidence = evidence_of_recordings(stimuli, factors) or by_texels
    if evidence == NOTHING:
        return replace(drift, rival=WEAR)
    return replace(drift, name=WEAR if evidence == USE else DRIFT, evidence=evidence)
