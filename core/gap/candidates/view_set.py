# SPDX-License-Identifier: GPL-3.0-or-later
"""Four views of the trials, so that each step of the search looks at no more data than it needs.

A score test and a first fit of a candidate look at a part of the texels, or at a part of the samples if texels depend on their
neighbours. The final fits look at everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...effects.engine.registry import form_of
from ..dataset.trial import Trial
from ..fitting.least_squares import TrialView
from ..forward.predictor import Model, Predictor, predictors_of
from .candidates import DIRECTLY_ESTIMATED, Candidate
from .direct_estimates import few_levels

FEW_TEXELS = 16
"""Texels of each trial in the views with few texels."""
UNLOADED_TEXELS = 2
"""How many of these texels carry no load, if there are any such."""
SAMPLE_STRIDE = 4
"""The view with few samples has every fourth sample."""
LEAST_SAMPLES = 60
"""A trial with fewer samples than this after thinning keeps all of them."""
MOST_READINGS = 6000
"""Number of changing readings to which they are thinned."""
HELD_OUT_STRETCHES = 2
"""Number of stretches of time into which a trial is cut if a part of it has to be left out of a fit."""


@dataclass
class ViewSet:
    """The trials, as the steps of the search look at them.

    Attributes
    ----------
    whole : list of TrialView
        All texels, all samples, readings and net forces.
    few_texels : list of TrialView
        Few texels, all samples. Net forces are included only if some trial has no readings. For effects on single texels.
    few_texels_with_forces : list of TrialView
        The same with net forces. For effects on friction.
    """

    whole: list[TrialView]
    few_texels: list[TrialView]
    few_texels_with_forces: list[TrialView]
    _moving: np.ndarray | None = None

    @cached_property
    def few_samples(self) -> list[TrialView]:
        """All texels, few samples. For effects that couple texels or displace them."""
        with_forces = self.few_texels[0].with_forces
        predictors = _thinned([view.predictor for view in self.whole])
        return [TrialView(one, noise=self.whole[0].noise, with_forces=with_forces) for one in predictors]

    def moving_readings(self, model: Model) -> np.ndarray:
        """Return readings that change, (n,) float, in which steps of a converter are looked for.

        The first model, that of the first search, says which these are: effects that join it later move no step.
        """
        return self._moving_values(model)[:, 0]

    def repeats_few_values(self, model: Model) -> bool:
        """Return whether readings that change repeat a few values (see :func:`few_levels`), and predictions of them do not.

        Noise repeats no value, so a converter made them.
        """
        readings, predictions = self._moving_values(model).T
        return few_levels(readings) and not few_levels(predictions)

    def _moving_values(self, model: Model) -> np.ndarray:
        """Some thousand readings of samples at which the model changes by more than the noise, and predictions, (n, 2)."""
        if self._moving is None:
            moving = [np.zeros((0, 2))]
            for view in self.whole:
                reading = view.predictor.trial.reading
                if reading is not None:
                    predicted = view.predictor.predict(model).reading
                    used = (np.abs(np.gradient(predicted, axis=0)) > 0.5 * view.noise[0]) & np.isfinite(reading)
                    moving.append(np.column_stack([reading[used], predicted[used]]))
            values = np.concatenate(moving)
            self._moving = values[:: max(1, len(values) // MOST_READINGS)]
        return self._moving

    def quick(self, candidate: Candidate, model: Model) -> list[TrialView]:
        """Return the smallest view in which a candidate can be tested on top of a model."""
        if candidate.name in DIRECTLY_ESTIMATED:
            return self.whole
        forms = [candidate.form, *(form_of(e.name, e.form) for e in model.effects)]
        on_friction = candidate.form.friction_law is not None
        if any(form.is_spatial or form.placement is not None for form in forms):
            # Bristle states need every sample, and friction shows in net forces alone.
            return self.whole if on_friction else self.few_samples
        return self.few_texels_with_forces if on_friction else self.few_texels


def view_set_of(predictors: Sequence[Predictor], noise: tuple[float, float]) -> ViewSet:
    """Prepare the views of some trials.

    Parameters
    ----------
    predictors : sequence of Predictor
    noise : (float, float)
        Standard deviation of readings and of forces, in their units.
    """
    whole = [TrialView(p, noise=noise, stretch_count=HELD_OUT_STRETCHES) for p in predictors]
    few_texels_with_forces = [TrialView(p, _texels_of_all_loads(p), noise=noise) for p in predictors]
    all_have_readings = all(p.trial.reading is not None for p in predictors)
    few_texels = [replace(view, with_forces=not all_have_readings) for view in few_texels_with_forces]
    return ViewSet(whole, few_texels, few_texels_with_forces)


def _thinned(predictors: Sequence[Predictor]) -> list[Predictor]:
    """Predictors of every fourth sample of some trials, and of the other trials of their sessions."""
    trials = [predictor.trial for predictor in predictors]
    shared = {predictor.trial.session: predictor.session for predictor in predictors if predictor.session is not None}
    others = [one for session in shared.values() for one in session.trials if all(one is not trial for trial in trials)]
    found = predictors_of([_thinned_trial(trial) for trial in (*trials, *others)], predictors[0].rig)
    return found[: len(trials)]


def _thinned_trial(trial: Trial) -> Trial:
    """Every fourth sample of a trial."""
    return trial.part(slice(None, None, SAMPLE_STRIDE if len(trial.time) >= LEAST_SAMPLES * SAMPLE_STRIDE else 1))


def _texels_of_all_loads(predictor: Predictor) -> np.ndarray | None:
    """A few texels, evenly over the order of their loads, and two without load; None if the sensor has few texels anyway."""
    n = len(predictor.rig.texels)
    if n <= FEW_TEXELS:
        return None
    load = predictor.stimulus.load.sum(axis=0)
    order = np.argsort(load)[::-1]
    reading = predictor.trial.reading
    if reading is not None:  # in a dense grid of which few cells are measured the others tell nothing
        order = order[np.isfinite(reading).any(axis=0)[order]]
    loaded = order[load[order] > 0]
    unloaded = order[load[order] <= 0]
    count = min(len(loaded), FEW_TEXELS - UNLOADED_TEXELS)
    picked = loaded[np.unique(np.linspace(0, len(loaded) - 1, count).astype(int))]
    rest = unloaded[np.linspace(0, len(unloaded) - 1, min(len(unloaded), FEW_TEXELS - len(picked))).astype(int)]
    return np.sort(np.concatenate([picked, rest]))
