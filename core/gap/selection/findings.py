# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a diagnosis: fitted models, the effects that were found, and how sure each of them is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...model.sensor import Effect
from ..base.recording_differences import RecordingDifferences
from ..candidates.candidates import Scales
from ..data_faults.data_fault import DataFault
from ..dataset.rig import Rig
from ..fitting.intervals import ParameterInterval
from ..fitting.least_squares import Fit
from ..fitting.noise_floor import ChannelNoise, Coverage
from ..fitting.residual_tests import NO_STRUCTURE, ResidualStructure, SpectralLine
from ..forward.predictor import Model, Predictor
from .check_recordings import CheckOutcome


@dataclass(frozen=True)
class Finding:
    """An effect that was found.

    Attributes
    ----------
    effect : int
        Index of the effect in the model's stack.
    name, form : str
        Standard names of the effect and of its formula.
    confidence : float
        Between 0 and 1.
    rivals : tuple of str
        Other kinds of effects that explain the recordings as well in its place.
    next_best : str
        The other kind that came nearest to this one; empty if none was fitted.
    leaves : float
        How many times as much of the gap `next_best` leaves.
    closes : float
        Share of the whole gap that is open without it.
    unsettled : tuple of str
        What is wrong with its parameters, in words: those at a bound.
    doubts : tuple of str
        Why else its name is not sure, in words; rivals and `unsettled` say their own.
    alternatives : tuple of Effect
        The rivals as they were fitted in its place, as far as they were.
    """

    effect: int
    name: str
    form: str
    confidence: float
    rivals: tuple[str, ...]
    next_best: str = ""
    leaves: float = np.inf
    closes: float = 0.0
    unsettled: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    alternatives: tuple[Effect, ...] = ()


@dataclass(frozen=True)
class ClosedShares:
    """Shares of a gap (of mean squares, noise removed) that the amended model closes, each for readings and for net forces.

    Attributes
    ----------
    fitted, left_out, check : (float or None, float or None)
        In the fitted recordings; in their parts when these are left out of the fit; in the check recordings; None without a
        gap.
    """

    fitted: tuple[float | None, float | None] = (None, None)
    left_out: tuple[float | None, float | None] = (None, None)
    check: tuple[float | None, float | None] = (None, None)

    def least(self, quantity: int) -> float | None:
        """Return the smallest of the three, for readings or forces; None without a gap."""
        known = [share for share in (self.fitted[quantity], self.left_out[quantity], self.check[quantity]) if share is not None]
        return min(known) if known else None


@dataclass
class Diagnosis:
    """All that was found out about a rig. Whatever was fitted is kept here, so that a report fits nothing again.

    Attributes
    ----------
    rig : Rig
    predictors : list of Predictor
        One for each trial, in the rig's order.
    noise : (ChannelNoise, ChannelNoise)
        Of readings and of net forces.
    full : (float, float)
        Range of readings and of net forces, largest minus smallest over all trials and channels.
    coverage : Coverage
        What the fitted trials did to the sensor.
    scales : Scales
        How large depths, forces, readings and times are in the fitted trials.
    base : Fit
        The base model, refitted, without effects.
    best : Fit
        The amended model.
    base_structure, structure : ResidualStructure
        What the residuals of `base` and of `best` depend on.
    stages : list of Model
        The base model, then the models with the first effect, the first two, and so on; the last one is the amended model.
    intervals : list of ParameterInterval
        Of the amended model's parameters that all texels share.
    verdict : "no gap", "explained" or "unexplained"
    findings : list of Finding
        One for each effect of the amended model.
    ambiguous : list of tuple of str
        Groups of kinds that these recordings do not distinguish; the first of each group is in the amended model.
    ruled_out : list of (str, str)
        Kinds that were not found, each with the reason.
    line : SpectralLine or None
        A periodic disturbance of the readings without load.
    faults : list of DataFault
        Faults of the data, whether they were put right or not.
    between : RecordingDifferences or None
        Levels and gains by which the recordings differ, if the rule chose them; they are part of both models.
    alike : Diagnosis or None
        The same recordings without levels and gains of their own, if `between` is given: what the gap was before them.
    assumed_session : bool
        True if the recordings, of which the rig names no session, are explained as one session in their order.
    check : CheckOutcome
        How the amended model does in each check recording.
    closed : ClosedShares
        How much of the gaps the amended model closes.
    noise_level : (2,) float
        Mean square of the noise of readings and of net forces by which the rule judged, in units of the variance in `noise`.
    """

    rig: Rig
    predictors: list[Predictor]
    noise: tuple[ChannelNoise, ChannelNoise]
    full: tuple[float, float]
    coverage: Coverage
    scales: Scales
    base: Fit
    best: Fit
    base_structure: ResidualStructure = NO_STRUCTURE
    structure: ResidualStructure = NO_STRUCTURE
    stages: list[Model] = field(default_factory=list)
    intervals: list[ParameterInterval] = field(default_factory=list)
    verdict: str = "no gap"
    findings: list[Finding] = field(default_factory=list)
    ambiguous: list[tuple[str, ...]] = field(default_factory=list)
    ruled_out: list[tuple[str, str]] = field(default_factory=list)
    line: SpectralLine | None = None
    faults: list[DataFault] = field(default_factory=list)
    between: RecordingDifferences | None = None
    alike: Diagnosis | None = None
    assumed_session: bool = False
    check: CheckOutcome = field(default_factory=CheckOutcome)
    closed: ClosedShares = field(default_factory=ClosedShares)
    noise_level: np.ndarray = field(default_factory=lambda: np.ones(2))

    @property
    def carried_over(self) -> Finding | None:
        """What goes on from recording to recording in an assumed session; None without one."""
        return next(iter(self.findings), None) if self.assumed_session else None

    @property
    def misleading_faults(self) -> list[DataFault]:
        """Faults of the data that were not put right and that an effect may have been fitted to.

        A unit that is wrong in all recordings alike is none of these: the stiffness is fitted.
        """
        return [fault for fault in self.faults if not fault.put_right and not self._is_scale(fault)]

    def _is_scale(self, fault: DataFault) -> bool:
        return fault.kind == "unit" and len(fault.trials) == len(self.predictors)

    def of(self, use: str) -> list[Predictor]:
        """Return the predictors of the trials of one use, "fit" or "check"."""
        return [p for p in self.predictors if p.trial.use == use]
