# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of forces, which readings at known depths do not determine.

If all forces are λ times as large, and the gain and all other parameters change by the power of λ that their dimension has, a
model predicts the same readings. So a fit to readings alone leaves λ open. Measured net forces determine it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...effects.engine.registry import form_of
from ...model.parameter import Parameter, numbers_of
from ...model.sensor import Values
from ...model.sensor_parameters import SENSOR_PARAMETERS
from ..forward.predictor import Model
from .least_squares import BASE, FreeParameter, TrialView


def at_measured_forces(model: Model, free: Sequence[FreeParameter], views: Sequence[TrialView]) -> Model:
    """Return a model with the same readings and with the scale of forces that fits the net forces best.

    Net forces are a linear function of the scale. It is open if stiffness and gain are both free and no load is known;
    otherwise the model is returned as it is.
    """
    names = {item.name for item in free if item.effect == BASE}
    if not names >= {"k", "gain"} or any(view.predictor.trial.stimulus == "force" for view in views):
        return model
    dot = square = 0.0
    for view in views:
        before, doubled = (view.residual(one)[:, len(view.texels) :] for one in (model, with_scaled_forces(model, free, 2.0)))
        dot += float(np.vdot(before, before - doubled))
        square += float(np.vdot(before - doubled, before - doubled))
    scale = 1.0 + dot / square if square > 0.0 else 1.0
    return with_scaled_forces(model, free, scale) if scale > 0.0 else model


def with_scaled_forces(model: Model, free: Sequence[FreeParameter], scale: float) -> Model:
    """Return a model with forces that are `scale` times as large.

    The parameters of its effects change, and those of its base model that are free; others keep their values.
    """
    p, names = model.parameters, [item.name for item in free if item.effect == BASE]
    base = _scaled({name: getattr(p, name) for name in names}, numbers_of(SENSOR_PARAMETERS), scale)
    effects = (replace(e, values=_scaled(e.values, form_of(e.name, e.form).parameters, scale)) for e in model.effects)
    return Model(replace(p, **base), tuple(effects), model.recordings)


def _scaled(values: Values, parameters: Iterable[Parameter], scale: float) -> dict[str, Any]:
    """Values of parameters where forces are `scale` times as large, by the dimensions of the parameters."""
    factors = {p.name: scale**p.force_dimension for p in parameters}
    return {
        name: tuple(x * factors[name] for x in value) if isinstance(value, tuple) else value * factors[name]
        for name, value in values.items()
    }
