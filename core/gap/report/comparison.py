# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a model is from the recordings, and where: phases, texels, parts of the range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..forward.contact_phases import PHASES, phase_indices, relative_load
from ..forward.predictor import Model, Predictor
from ..selection.diagnosis import Diagnosis

RANGES = 5
"""Parts that the range of loads is cut into."""


def nrmse(predictors: Sequence[Predictor], model: Model, full: tuple[float, float]) -> float | None:
    """Root mean square of measured minus predicted, as a share of the range of what was measured.

    The mean is over all samples, texels and force components that were measured in these trials. Readings are divided by the
    range of all readings of the rig (largest minus smallest, all trials and texels together), forces by that of all forces.
    Noise is in it: :func:`noise_floor` is what a perfect model would have left. None without trials.
    """
    square, count = 0.0, 0
    for predictor in predictors:
        trial, predicted = predictor.trial, predictor.predict(model)
        for measured, simulated, size in ((trial.reading, predicted.reading, full[0]), (trial.force, predicted.force, full[1])):
            if measured is None or simulated is None:
                continue
            miss = (measured - simulated)[np.isfinite(measured)] / size
            square += float(miss @ miss)
            count += len(miss)
    return float(np.sqrt(square / count)) if count else None


def nrmse_without_friction(result: Diagnosis) -> dict[str, float | None] | None:
    """NRMSE by use that a base model without any friction has; None where nothing slides or no net force was measured.

    Friction is the base model's own, so it is in every error that is reported, and no missing effect.
    """
    if not any(p.trial.force is not None and p.stimulus.slide.any() for p in result.predictors):
        return None
    return {use: nrmse(result.of(use), frictionless(result.base.model), result.full) for use in ("fit", "check")}


def frictionless(model: Model) -> Model:
    """Return a model without the base model's friction."""
    return replace(model, parameters=replace(model.parameters, mus=0.0, mud=0.0, ct=0.0))


def noise_floor(result: Diagnosis) -> float:
    """NRMSE that noise alone would leave on the fitted trials."""
    square = count = 0.0
    for predictor in result.of("fit"):
        channels = (predictor.trial.reading, predictor.trial.force)
        for measured, noise, size in zip(channels, result.noise, result.full, strict=True):
            if measured is not None:
                number = float(np.isfinite(measured).sum())
                square, count = square + number * (noise.deviation / size) ** 2, count + number
    return float(np.sqrt(square / max(count, 1.0)))


def error_location(result: Diagnosis, model: Model) -> list[dict[str, Any]]:
    """Shares of the squared error on the fitted trials: by phase, by part of the range, and of the worst texels."""
    n = len(result.rig.texels)
    by_phase, by_range, by_texel = np.zeros(len(PHASES)), np.zeros(RANGES + 1), np.zeros(n)
    for predictor in result.of("fit"):
        square = squares(predictor, model, result)
        if square is None:
            continue
        at = phase_indices(predictor.stimulus)
        part = np.ceil(relative_load(predictor.stimulus) * RANGES).astype(int).clip(0, RANGES)
        by_phase += np.bincount(at.ravel(), square.ravel(), len(PHASES))
        by_range += np.bincount(part.ravel(), square.ravel(), RANGES + 1)
        by_texel += square.sum(axis=0)
    total = max(float(by_phase.sum()), 1e-300)
    entries: list[dict[str, Any]] = [
        {"phase": name, "share": round(float(share / total), 4)} for name, share in zip(PHASES, by_phase, strict=True)
    ]
    bounds = ["no load", *(f"{100 * i // RANGES}–{100 * (i + 1) // RANGES} % of the largest load" for i in range(RANGES))]
    entries += [{"range": name, "share": round(float(share / total), 4)} for name, share in zip(bounds, by_range, strict=True)]
    if n > 1:
        worst = np.argsort(by_texel)[::-1]
        count = int(np.searchsorted(np.cumsum(by_texel[worst]) / total, 0.5)) + 1
        share = float(by_texel[worst[:count]].sum() / total)
        entries.append({"texels": sorted(int(i) for i in worst[:count]), "share": round(share, 4)})
    return entries


def squares(predictor: Predictor, model: Model, result: Diagnosis) -> np.ndarray | None:
    """Squared error of each texel at each sample, (T, n), in units of the range; of forces the sum, shared by all texels."""
    trial, predicted = predictor.trial, predictor.predict(model)
    n = len(result.rig.texels)
    if trial.reading is not None:
        return np.nan_to_num((trial.reading - predicted.reading) / result.full[0]) ** 2
    if trial.force is not None and predicted.force is not None:
        miss = np.nan_to_num((trial.force - predicted.force) / result.full[1]) ** 2
        return np.tile(miss.sum(axis=1, keepdims=True) / n, (1, n))
    return None


def rms_by_texel(result: Diagnosis, model: Model, use: str = "fit") -> np.ndarray:
    """Root mean square error of each texel over the trials of one use, (n,) float, as a share of the range."""
    total, count = np.zeros(len(result.rig.texels)), 0
    for predictor in result.of(use):
        square = squares(predictor, model, result)
        if square is not None:
            total, count = total + square.sum(axis=0), count + len(square)
    return np.sqrt(total / max(count, 1))
