# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of forces, which readings under known depths do not tell.

With all forces λ times as large, and what is divided by a force λ times as small (the gain, above all), a model predicts the
same readings. So a fit to readings alone leaves λ open, and measured net forces give it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.engine.registry import form_of
from ...model.sensor import Effect
from ...model.sensor_parameters import SENSOR_PARAMETERS
from ..forward.predictor import Model
from .least_squares import BASE, FreeParameter, TrialView


def with_scaled_forces(model: Model, free: Sequence[FreeParameter], scale: float) -> Model:
    """Return a model with forces that are `scale` times as large: in its effects and the free parameters of its base."""
    p, names = model.parameters, [item.name for item in free if item.effect == BASE]
    changed = {name: getattr(p, name) * scale ** SENSOR_PARAMETERS[name].force_dimension for name in names}
    return Model(replace(p, **changed), tuple(_scaled(effect, scale) for effect in model.effects), model.recordings)


def at_measured_forces(model: Model, free: Sequence[FreeParameter], views: Sequence[TrialView]) -> Model:
    """Return a model with its forces at the scale at which net forces fit best, which are proportional to it."""
    dot = square = 0.0
    for view in views:
        before, doubled = (view.residual(one)[:, len(view.texels) :] for one in (model, with_scaled_forces(model, free, 2.0)))
        dot += float(np.vdot(before, before - doubled))
        square += float(np.vdot(before - doubled, before - doubled))
    scale = 1.0 + dot / square if square > 0.0 else 1.0
    return with_scaled_forces(model, free, scale) if scale > 0.0 else model


def _scaled(effect: Effect, scale: float) -> Effect:
    """An effect whose parameters have the dimensions that the library states."""
    powers = {p.name: p.force_dimension for p in form_of(effect.name, effect.form).parameters}
    values = {
        name: tuple(x * scale**power for x in value) if isinstance(value, tuple) else value * scale**power
        for name, value in effect.values.items()
        if (power := powers.get(name, 0))
    }
    return replace(effect, values={**effect.values, **values})
