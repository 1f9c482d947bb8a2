# SPDX-License-Identifier: GPL-3.0-or-later
"""Summary of recordings before a fit: noise, start of the base model, kinds that they could show."""

from __future__ import annotations

from dataclasses import dataclass

from ...effects.engine.registry import library
from ..base.base_model import identified_base_parameters, prepared, start_model, with_recording_numbers
from ..base.contact_heights import with_starting_heights
from ..base.quantities import friction_kinds
from ..candidates.candidates import DIRECTLY_ESTIMATED, NOT_FITTED, candidates
from ..dataset.rig import Rig
from ..fitting.identifiability import unidentifiable
from ..fitting.noise_floor import ChannelNoise, coverage
from ..forward.predictor import Model, Predictor, predictors_of


@dataclass(frozen=True)
class Unfitted:
    """Recordings before a fit.

    Attributes
    ----------
    predictors : list of Predictor
        Of all trials.
    fitted : list of Predictor
        Of those that are to be fitted.
    start : Model
        From which the base model's fit starts.
    free : frozenset of str
        Parameters of the base model that the recordings identify.
    channels : (ChannelNoise, ChannelNoise)
        Noise of readings and of net forces.
    shown : frozenset of str
        Kinds that the recordings could show.
    cannot_show : dict of str to str
        The others, each with the reason.
    """

    predictors: list[Predictor]
    fitted: list[Predictor]
    start: Model
    free: frozenset[str]
    channels: tuple[ChannelNoise, ChannelNoise]
    shown: frozenset[str]
    cannot_show: dict[str, str]


def unfitted(rig: Rig) -> Unfitted:
    """Return the summary of a rig's recordings before a fit.

    Raises
    ------
    FileError
        The recordings do not fit their stimulus, see :func:`.base_model.prepared`.
    """
    rig = with_starting_heights(rig)
    predictors = predictors_of(rig.trials, rig)
    noise, _ = prepared(rig, predictors)
    fitted = [predictor for predictor in predictors if predictor.trial.use == "fit"]
    start = with_recording_numbers(start_model(rig, fitted), fitted)
    tried = {candidate.name for candidate in candidates(fitted, start)}
    shown = frozenset({*tried, *DIRECTLY_ESTIMATED, *NOT_FITTED, *friction_kinds()})
    reasons = unidentifiable(coverage(fitted))
    missing = {name: reasons.get(name, "these recordings cannot show it") for name in library() if name not in shown}
    free = frozenset(identified_base_parameters(rig, fitted))
    return Unfitted(predictors, fitted, start, free, noise, shown, missing)
