# SPDX-License-Identifier: GPL-3.0-or-later
"""Rao's score tests: by how much could the squares of a fit fall if its model also changed in some direction?"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ...effects.engine.registry import form_of
from ...model.sensor import Effect
from ..base.base_model import identified_base_parameters
from ..fitting.least_squares import BASE, Fit, FreeParameter, TrialView, coordinates_of, derivatives, with_coordinates
from ..forward.predictor import Model

RIDGE = 1e-10
"""Added to the diagonal of a Gram matrix, as a share of one plus its trace."""
LEAST_OWN_SHARE = 1e-9
"""Least share of a change that the free parameters cannot make themselves; below it the change counts as theirs."""
LEAST_SENSITIVITY = 1e-12
"""Least squared change of a texel's residual, as a share of the largest, for the texel to count."""


def visible_parameters(views: Sequence[TrialView], found: Fit) -> tuple[FreeParameter, ...]:
    """Return the free parameters of a fit that some views identify.

    Without net forces they show no friction, and readings at known depths do not determine the scale of forces.
    """
    if any(view.with_forces for view in views):
        return found.free
    predictors = [view.predictor for view in views]
    identified = identified_base_parameters(predictors[0].rig, predictors, with_forces=False)

    def is_seen(item: FreeParameter) -> bool:
        if item.effect < 0:
            return item.effect != BASE or item.name in identified
        effect = found.model.effects[item.effect]
        return form_of(effect.name, effect.form).friction_law is None

    return tuple(filter(is_seen, found.free))


def ridged(gram: np.ndarray) -> np.ndarray:
    """Return a Gram matrix with a small ridge, so that it can be inverted."""
    return gram + RIDGE * (1.0 + np.trace(gram)) * np.eye(len(gram))


class ScoreTest:
    """Residual of a fit on some views, and its derivatives by the common free parameters.

    Parameters
    ----------
    views : sequence of TrialView
    found : Fit

    Attributes
    ----------
    model : Model
        Of the fit.
    free : tuple of FreeParameter
        Those that act on the views.
    residual : list of (T, c + 3) float
        For each view.
    derivatives : list of (p, T (c + 3)) float
        By how much a step along each of the p common parameters lowers the residual, in rows, for each view.
    gram : (p, p) float
        Their scalar products.
    along : (p,) float
        Their scalar products with the residual.
    """

    def __init__(self, views: Sequence[TrialView], found: Fit):
        self.views, self.model, self.free = views, found.model, visible_parameters(views, found)
        common = tuple(item for item in self.free if not item.per_texel)
        at = coordinates_of(found.model, common)
        self.residual = [view.residual(found.model) for view in views]
        self.derivatives = [np.empty((len(common), r.size)) for r in self.residual]
        for view, r, rows in zip(views, self.residual, self.derivatives, strict=True):
            derivatives(view, found.model, common, at, r, rows.reshape(len(common), *r.shape), 0)
        self.gram = ridged(np.sum([c @ c.T for c in self.derivatives], axis=0))
        self._decreases: dict[int, tuple[Effect, float]] = {}
        self.along = sum(c @ r.ravel() for c, r in zip(self.derivatives, self.residual, strict=True))

    @property
    def initial_derivatives(self) -> list[np.ndarray] | None:
        """Derivatives with which a fit of these parameters and more may begin; None if some belong to single texels."""
        if any(item.per_texel for item in self.free):
            return None
        return [rows.reshape(len(rows), *r.shape) for rows, r in zip(self.derivatives, self.residual, strict=True)]

    @cached_property
    def total(self) -> float:
        """Sum of squares of the residual."""
        return sum(float(np.vdot(r, r)) for r in self.residual)

    @cached_property
    def least(self) -> float:
        """Sum of squares that the free parameters leave at best, to first order.

        Views are a part of the data, and the fit was to all of them: effects are compared with what refitting leaves here.
        """
        return self.total - float(self.along @ np.linalg.solve(self.gram, self.along))

    def score(self, effect: Effect) -> tuple[float, float]:
        """Test the change that one effect more makes.

        Returns
        -------
        decrease : float
            By how much the squares fall at best along the change, to first order, if the free parameters follow.
        length : float
            The best length along the change; 1 is the effect as it is.
        """
        model = self.model.with_effect(effect)
        cross, square, dot = np.zeros(len(self.gram)), 0.0, 0.0
        for view, r, c in zip(self.views, self.residual, self.derivatives, strict=True):
            change = (r - view.residual(model)).ravel()
            cross += c @ change
            square += float(np.vdot(change, change))
            dot += float(np.vdot(change, r.ravel()))
        if not np.isfinite(square):
            return 0.0, 0.0
        self._decreases[id(effect)] = effect, 2.0 * dot - square
        weights = np.linalg.solve(self.gram, cross)
        own_square, own_dot = square - float(weights @ cross), dot - float(weights @ self.along)
        if own_square <= LEAST_OWN_SHARE * square or own_square <= 0:
            return 0.0, 0.0
        return own_dot**2 / own_square, own_dot / own_square

    def decrease_with(self, effect: Effect) -> float:
        """Return by how much the squares fall with an effect as it is, if the free parameters follow, to first order."""
        promise, length = self.score(effect)
        return promise * (2.0 * length - 1.0) / length**2 if length != 0.0 else 0.0

    def decrease_after_step(self, effect: Effect) -> float:
        """Return by how much an effect as it is lowers the squares after one step of the free parameters that texels share."""
        model, common = self.model.with_effect(effect), [item for item in self.free if not item.per_texel]
        along = sum(c @ view.residual(model).ravel() for c, view in zip(self.derivatives, self.views, strict=True))
        steps = np.linalg.solve(self.gram, along)
        at = [x + step for x, step in zip(coordinates_of(model, common), steps, strict=True)]
        return self._decrease_to(with_coordinates(model, common, at))

    def score_of_texels(self, effect: Effect) -> float:
        """Return by how much the squares fall at best if each texel has a length of its own, less what noise alone gives.

        Parameters
        ----------
        effect : Effect
            Which changes all texels.
        """
        model = self.model.with_effect(effect)
        n = len(self.views[0].predictor.rig.texels)
        dot, square = np.zeros(n), np.zeros(n)
        for view, r in zip(self.views, self.residual, strict=True):
            change = (r - view.residual(model))[:, : len(view.texels)]
            dot[view.texels] += (change * r[:, : len(view.texels)]).sum(axis=0)
            square[view.texels] += (change * change).sum(axis=0)
        seen = square > LEAST_SENSITIVITY * max(square.max(initial=0.0), 1e-300)
        return max(float((dot[seen] ** 2 / square[seen]).sum()) - seen.sum(), 0.0)

    def joint_score(self, effects: Sequence[Effect]) -> tuple[float, np.ndarray]:
        """Test the changes that several effects make, all at once.

        Returns
        -------
        decrease : float
            By how much the squares fall at best, to first order, beyond what the free parameters can do.
        lengths : (len(effects),) float
            The best lengths along the changes.
        """
        models, size = [self.model.with_effect(effect) for effect in effects], len(self.gram)
        gram, along = np.zeros((size + len(models),) * 2), np.zeros(size + len(models))
        for view, r, c in zip(self.views, self.residual, self.derivatives, strict=True):
            x = np.vstack([c, *((r - view.residual(model)).ravel() for model in models)])
            gram += x @ x.T
            along += x @ r.ravel()
        best = np.linalg.solve(ridged(gram), along)
        return self.least - (self.total - float(along @ best)), best[size:]

    def decrease(self, effect: Effect) -> float:
        """Return by how much an effect lowers the squares as it is; minus infinity if it predicts no numbers."""
        if id(effect) not in self._decreases:
            self._decreases[id(effect)] = effect, self._decrease_to(self.model.with_effect(effect))
        return self._decreases[id(effect)][1]

    def _decrease_to(self, model: Model) -> float:
        """By how much a model as it is lowers the squares; minus infinity if it predicts no numbers."""
        after = sum(float(np.vdot(r, r)) for r in (view.residual(model) for view in self.views))
        return self.total - after if np.isfinite(after) else -np.inf
