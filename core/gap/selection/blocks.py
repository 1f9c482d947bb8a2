# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks: recordings cut into stretches of time, and what a model leaves on blocks that its fit has not seen.

The fitted recordings are cross-fitted in two folds of alternating blocks: one Newton step from the common fit gives the fit to
the other fold. Check recordings are never fitted. They are read at texels that a fitted recording touches and at texels that
they do not touch themselves, because nothing is known of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..fitting.least_squares import Fit, TrialView, cross_fitted
from ..forward.predictor import NEUTRAL_NUMBERS, Model, Predictor, number_name
from .noise_level import Sums
from .rule_numbers import BLOCKS, MEMORIES


@dataclass(frozen=True)
class Views:
    """The recordings of a rig, cut into blocks.

    Attributes
    ----------
    fitted, check : list of TrialView
        All texels, all samples, readings and net forces.
    """

    fitted: list[TrialView]
    check: list[TrialView]

    @property
    def all(self) -> list[TrialView]:
        """Those of fitted recordings, then those of check recordings."""
        return [*self.fitted, *self.check]

    def with_predictors(self, predictors: Sequence[Predictor]) -> Views:
        """Return the same views of recordings about which something else is assumed."""
        by_name = {one.trial.name: one for one in predictors}
        fitted, check = (
            [replace(view, predictor=by_name[view.predictor.trial.name]) for view in views]
            for views in (self.fitted, self.check)
        )
        return Views(fitted, check)

    def weighted(self, weight: float) -> Views:
        """Return the same views with another weight of forces."""
        return Views(*([replace(view, force_weight=weight) for view in views] for views in (self.fitted, self.check)))


def views_of(predictors: Sequence[Predictor], noise: tuple[float, float], memory: tuple[float, float]) -> Views:
    """Return the views of recordings.

    Parameters
    ----------
    predictors : sequence of Predictor
        Of all trials.
    noise : (float, float)
        Standard deviation of readings and of forces, in their units.
    memory : (float, float)
        Correlation time of their noise, in samples.
    """
    made = {
        use: [
            TrialView(one, noise=noise, stretch_count=_block_count(one, max(memory)))
            for one in predictors
            if one.trial.use == use
        ]
        for use in ("fit", "check")
    }
    return Views(made["fit"], made["check"])


def _block_count(predictor: Predictor, memory: float) -> int:
    return int(np.clip(len(predictor.trial.time) / (MEMORIES * max(memory, 1.0)), 2, BLOCKS))


class Blocks:
    """Reads models on blocks.

    Parameters
    ----------
    views : Views

    Attributes
    ----------
    recording : (b,) int
        To which of `views.all` each block belongs.
    count, rest_count
        See :class:`Sums`.
    """

    def __init__(self, views: Views):
        self.views = views
        touched = np.any([_touched(view.predictor) for view in views.fitted], axis=0)
        measured = [_measured(view) for view in views.all]
        self._masks = [np.isfinite(values) for values in measured]
        self._data = [np.where(mask, values, 0.0) for mask, values in zip(self._masks, measured, strict=True)]
        for mask, view in zip(self._masks[len(views.fitted) :], views.check, strict=True):
            mask &= np.append(touched | ~_touched(view.predictor), [True] * 3)
        self._rests = [[rest & mask for rest in _without_load(view)] for view, mask in zip(views.all, self._masks, strict=True)]
        self.recording = np.repeat(np.arange(len(views.all)), [view.stretch_count for view in views.all])
        self.count = self._summed([mask.astype(float) for mask in self._masks])
        self.rest_count = np.stack([self._summed([rest[way].astype(float) for rest in self._rests]) for way in (0, 1)])

    def sums(self, found: Fit, views: Views, has_own_numbers: bool) -> Sums:
        """Return what a fit leaves on unseen blocks.

        Parameters
        ----------
        found : Fit
        views : Views
            Of the recordings as they are assumed to differ, with the weights of the fit.
        has_own_numbers : bool
            True if recordings have numbers of their own, the first component.
        """
        model = found.model
        whole = [view.residual(model) for view in views.all]
        seen, outside = whole[: len(views.fitted)], whole[len(views.fitted) :]
        unseen = _unweighted(views, [*cross_fitted(found, views.fitted, seen), *outside])
        squares = [r**2 * mask for r, mask in zip(unseen, self._masks, strict=True)]
        rest = [self._summed([s * rest[way] for s, rest in zip(squares, self._rests, strict=True)]) for way in (0, 1)]
        without = [model.without(index) for index in range(len(model.effects))]
        without = [_with_equal_recordings(model), *without] if has_own_numbers else without
        whole = _unweighted(views, whole)
        changes = [self._change(whole, _unweighted(views, [v.residual(other) for v in views.all])) for other in without]
        return Sums(
            self._summed(squares), self.count, np.stack(rest), self.rest_count, np.array(changes).reshape(-1, *self.count.shape)
        )

    def _change(self, whole: Sequence[np.ndarray], without: Sequence[np.ndarray]) -> np.ndarray:
        """Squares of the change that a component makes to predictions, (b, 2) float.

        A factor and a zero of all readings, and of each axis of the forces, are taken out: parameters of the base model follow
        them. They are those of the fitted recordings, so that check recordings choose no effect.

        Parameters
        ----------
        whole, without : sequences of (T, n + 3) float
            Residuals with the component and without it.
        """
        changes = [b - a for a, b in zip(whole, without, strict=True)]
        before = [data - b for data, b in zip(self._data, without, strict=True)]
        sums = np.sum(
            [
                [(part * mask).sum(axis=0) for part in (1.0, x, y, x * x, x * y)]
                for x, y, mask in zip(before, changes, self._masks[: len(self.views.fitted)], strict=False)
            ],
            axis=0,
        )
        sums = np.column_stack([sums[:, :-3].sum(axis=1), sums[:, -3:]])
        count, x, y, xx, xy = sums / np.maximum(sums[0], 1.0)
        slope = (xy - x * y) / np.maximum(xx - x * x, 1e-12)
        level = y - slope * x
        spread = [0] * (changes[0].shape[1] - 3) + [1, 2, 3]
        rest = [
            (change - slope[spread] * row - level[spread]) ** 2 * mask
            for change, row, mask in zip(changes, before, self._masks, strict=True)
        ]
        return self._summed(rest)

    def _summed(self, tables: Sequence[np.ndarray]) -> np.ndarray:
        """Sums of tables (T, n + 3) over blocks, of readings and of forces."""
        rows = []
        for view, table in zip(self.views.all, tables, strict=True):
            rows += [[table[part, :-3].sum(), table[part, -3:].sum()] for part in view.stretches(table)]
        return np.array(rows)


def _unweighted(views: Views, residuals: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Residuals (T, n + 3) of views in units of the noise, without the weight of forces."""
    return [
        np.hstack([r[:, :-3], r[:, -3:] / np.sqrt(view.force_weight)]) if view.force_weight != 1.0 else r
        for view, r in zip(views.all, residuals, strict=True)
    ]


def _with_equal_recordings(model: Model) -> Model:
    """The model with the neutral factor and zero of each recording."""
    numbers = dict(model.recordings)
    for word, value in NEUTRAL_NUMBERS.items():
        numbers |= dict.fromkeys((name for name in numbers if name.startswith(number_name(word, ""))), value)
    return replace(model, recordings=numbers)


def _touched(predictor: Predictor) -> np.ndarray:
    """Texels that are loaded in a recording, (n,) bool."""
    loaded: np.ndarray = (predictor.stimulus.load > 0).any(axis=0)
    return loaded


def _measured(view: TrialView) -> np.ndarray:
    """Measured values in units of the noise, (T, n + 3) float; not finite where there are none."""
    trial, n = view.predictor.trial, len(view.texels)
    measured = np.full((len(trial.time), n + 3), np.nan)
    if trial.reading is not None:
        measured[:, :n] = trial.reading / view.noise[0]
    if trial.force is not None and view.with_forces:
        measured[:, n:] = trial.force / view.noise[1]
    return measured


def _without_load(view: TrialView) -> tuple[np.ndarray, np.ndarray]:
    """Values without load, (T, n + 3) bool: all while nothing touches the sensor, and of texels that nothing touches."""
    load = view.predictor.stimulus.load > 0
    free, never = ~load.any(axis=1), ~load.any(axis=0)
    shape = len(load), load.shape[1] + 3
    return np.broadcast_to(free[:, None], shape), np.broadcast_to(np.append(never, [False] * 3)[None], shape)
