# SPDX-License-Identifier: GPL-3.0-or-later
"""How far models are from the recordings, and where: by phase of contact, by part of the load's range, by texel."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..fitting.noise_floor import SMALLEST_NOISE
from ..forward.contact_phases import PHASES, phase_indices, relative_load
from ..forward.predictor import Model, Predictor
from ..selection.check_recordings import CheckedRecording
from ..selection.findings import Diagnosis

CLOSED_FROM = 0.2
"""A closed share is given if the gap, noise removed, is at least this share of the noise floor. Which effects join is decided
in :mod:`..selection.search`."""
RANGE_PARTS = 5
"""Number of equal parts into which the range of loads is divided."""
WORST_TEXELS_SHARE = 0.5
"""The worst texels are as few as together have this share of the squared error."""

USES = ("fit", "check")
"""Uses of trials: "check" trials are never fitted."""


@dataclass(frozen=True)
class GapErrors:
    """NRMSE (see :func:`nrmse`) of the models of a diagnosis, by use of the trials; None without trials of that use.

    Attributes
    ----------
    base, amended : dict of str to (float or None)
        If recordings have levels and gains of their own, the base model is the one without them.
    stages : list of float or None
        Of the models of `Diagnosis.stages` on the fitted trials. The first one, the base model, has the levels and gains.
    frictionless : dict of str to (float or None), or None
        Of the base model without friction; None if nothing slides or no net force was measured.
    noise_floor : float
        That of noise alone, on the fitted trials.
    """

    base: dict[str, float | None]
    amended: dict[str, float | None]
    stages: list[float | None]
    frictionless: dict[str, float | None] | None
    noise_floor: float


def gap_errors(result: Diagnosis) -> GapErrors:
    """Compute the errors of all models of a diagnosis, once for summary, sentences and pictures."""

    def by_use(one: Diagnosis, model: Model) -> dict[str, float | None]:
        return {use: nrmse(one.of(use), model, one.full) for use in USES}

    plain, base = result.alike or result, result.base.model
    is_rubbed = any(p.trial.force is not None and p.stimulus.slide_speed.any() for p in result.predictors)
    frictionless = replace(base, parameters=replace(base.parameters, mus=0.0, mud=0.0, ct=0.0))
    return GapErrors(
        base=by_use(plain, plain.base.model),
        amended=by_use(result, result.best.model),
        stages=[nrmse(result.of("fit"), model, result.full) for model in result.stages],
        frictionless=by_use(result, frictionless) if is_rubbed else None,
        noise_floor=noise_floor_nrmse(result),
    )


def nrmse(predictors: Sequence[Predictor], model: Model, full: tuple[float, float]) -> float | None:
    """Return the normalised root mean square error: that of measured minus predicted, as a share of the measured range.

    The mean is over all samples, texels and force components that were measured in these trials. Readings are divided by the
    range of all readings of the rig (largest minus smallest, all trials and texels together), forces by that of all forces.
    The error contains the noise: :func:`noise_floor_nrmse` is the error of a perfect model.

    Parameters
    ----------
    predictors : sequence of Predictor
    model : Model
    full : (float, float)
        Range of readings and of forces.

    Returns
    -------
    float or None
        None without trials.
    """
    square, count = 0.0, 0
    for predictor in predictors:
        trial, predicted = predictor.trial, predictor.predict(model)
        for measured, simulated, size in ((trial.reading, predicted.reading, full[0]), (trial.force, predicted.force, full[1])):
            if measured is None or simulated is None:
                continue
            error = (measured - simulated)[np.isfinite(measured)] / size
            square += float(error @ error)
            count += len(error)
    return float(np.sqrt(square / count)) if count else None


def closed_share(before: float | None, after: float | None, floor: float) -> float | None:
    """Return the share of the squared gap, noise removed, that closes between two errors; None without a gap."""
    if before is None or after is None or before**2 - floor**2 <= (CLOSED_FROM * floor) ** 2:
        return None
    return float(round(min((before**2 - after**2) / (before**2 - floor**2), 1.0), 4))


def recording_errors(result: Diagnosis, use: str) -> list[dict[str, Any]]:
    """Return the NRMSE of base and amended model in each recording of one use, as under ``fitted`` in gap.json."""
    plain = result.alike or result
    return [
        {
            "trial": own.trial.name,
            "before": nrmse([alike], plain.base.model, result.full),
            "after": nrmse([own], result.best.model, result.full),
        }
        for alike, own in zip(plain.of(use), result.of(use), strict=True)
    ]


def check_errors(result: Diagnosis, one: CheckedRecording, quantity: int) -> list[float]:
    """Return errors in a check recording as shares of the range: before, after, and after in the fitted recordings."""
    share = result.noise[quantity].deviation / result.full[quantity]
    return [float(square[quantity]) ** 0.5 * share for square in (one.before, one.after, one.fitted)]


def noise_floor_nrmse(result: Diagnosis) -> float:
    """Return the NRMSE of noise alone on the fitted trials, at the level by which the rule judged; never zero."""
    square = count = 0.0
    for predictor in result.of("fit"):
        channels = (predictor.trial.reading, predictor.trial.force)
        for measured, noise, level, size in zip(channels, result.noise, result.noise_level, result.full, strict=True):
            if measured is not None:
                number = float(np.isfinite(measured).sum())
                square += number * max(level * (noise.deviation / size) ** 2, SMALLEST_NOISE**2)
                count += number
    return float(np.sqrt(square / max(count, 1.0)))


def error_location(result: Diagnosis, model: Model) -> list[dict[str, Any]]:
    """Return shares of the squared error on the fitted trials: by phase, by part of the load's range, and of the worst texels.

    Returns
    -------
    list of dict
        As under ``where`` in gap.json: each entry has a ``share`` and one of ``phase``, ``range`` and ``texels``.
    """
    n = len(result.rig.texels)
    by_phase, by_range, by_texel = np.zeros(len(PHASES)), np.zeros(RANGE_PARTS + 1), np.zeros(n)
    for predictor in result.of("fit"):
        square = squared_errors(predictor, model, result)
        phase = phase_indices(predictor.stimulus)
        part = np.ceil(relative_load(predictor.stimulus) * RANGE_PARTS).astype(int).clip(0, RANGE_PARTS)
        by_phase += np.bincount(phase.ravel(), square.ravel(), len(PHASES))
        by_range += np.bincount(part.ravel(), square.ravel(), RANGE_PARTS + 1)
        by_texel += square.sum(axis=0)
    total = max(float(by_phase.sum()), 1e-300)
    limits = [100 * i // RANGE_PARTS for i in range(RANGE_PARTS + 1)]
    ranges = ["no load", *(f"{a}–{b} % of the largest load" for a, b in itertools.pairwise(limits))]
    found: list[tuple[str, Any, float]] = [("phase", *one) for one in zip(PHASES, by_phase, strict=True)]
    found += [("range", *one) for one in zip(ranges, by_range, strict=True)]
    if n > 1:
        order = np.argsort(by_texel)[::-1]
        worst = order[: int(np.searchsorted(np.cumsum(by_texel[order]) / total, WORST_TEXELS_SHARE)) + 1]
        found.append(("texels", sorted(worst.tolist()), by_texel[worst].sum()))
    return [{key: value, "share": round(float(square / total), 4)} for key, value, square in found]


def squared_errors(predictor: Predictor, model: Model, result: Diagnosis) -> np.ndarray:
    """Return the squared error of each texel at each sample, (T, n), as a share of the squared range.

    Without readings it is that of the net force, divided equally among the texels.
    """
    trial, predicted = predictor.trial, predictor.predict(model)
    n = len(result.rig.texels)
    if trial.reading is not None:
        return np.nan_to_num((trial.reading - predicted.reading) / result.full[0]) ** 2
    assert trial.force is not None and predicted.force is not None
    error = np.nan_to_num((trial.force - predicted.force) / result.full[1]) ** 2
    return np.tile(error.sum(axis=1, keepdims=True) / n, (1, n))


def rms_by_texel(result: Diagnosis, model: Model) -> np.ndarray:
    """Return the root mean square error of each texel over the fitted trials, (n,) float, as a share of the range."""
    squares = [squared_errors(predictor, model, result) for predictor in result.of("fit")]
    return np.asarray(np.sqrt(np.sum([square.sum(axis=0) for square in squares], axis=0) / sum(map(len, squares))))


LEAST_LEVEL = 0.01
"""Least difference of the level without load that is mentioned, as a share of the range."""
LEAST_GAIN = 0.03
"""Least relative difference of the readings under the same load that is mentioned."""
OUTSIDE = 1.25
"""Depth, speed, length and number of loads are mentioned from this many times the largest of the fitted recordings on."""
LEAST_NEW_LOAD = 0.05
"""Share of the load on texels that no fitted recording touches, from which on it is mentioned."""
FAST = 0.95
"""Quantile of the rates of loading that counts as a recording's speed."""


def _level_and_gain(predictor: Predictor, model: Model, full: tuple[float, float]) -> tuple[float, float]:
    """Mean of measured minus predicted readings without load, as a share of the range, and their ratio under load.

    Without readings the net force along its largest component is compared. Both are NaN where they are unknown.
    """
    trial, predicted = predictor.trial, predictor.predict(model)
    if trial.reading is not None:
        measured, expected, size, zero = trial.reading, predicted.reading, full[0], model.parameters.zero
        load = predictor.stimulus.load
    else:
        assert trial.force is not None and predicted.force is not None
        axis = int(np.argmax(np.nansum(trial.force**2, axis=0)))
        measured, expected, size, zero = trial.force[:, axis : axis + 1], predicted.force[:, axis : axis + 1], full[1], 0.0
        load = predictor.stimulus.load.max(axis=1, keepdims=True)
    known, idle = np.isfinite(measured), load <= 0
    rest = known & idle
    level = float((measured - expected)[rest].mean()) / size if rest.any() else float("nan")
    shift = level * size if np.isfinite(level) else 0.0
    x, y = (expected - zero)[known & ~idle], (measured - zero - shift)[known & ~idle]
    gain = float(x @ y) / float(x @ x) if float(x @ x) > 0 else float("nan")
    return level, gain


def _loading(predictor: Predictor) -> dict[str, float]:
    """Largest load, fast rate of loading, length, and number of loads of a recording, by the words that compare them."""
    time, load = predictor.trial.time, predictor.stimulus.load.max(axis=1)
    rate = np.gradient(load, time)
    quick = rate[rate > 0]
    half = load > 0.5 * max(float(load.max(initial=0.0)), 1e-300)
    return {
        "is loaded {:.3g} times as much": float(load.max(initial=0.0)),
        "is loaded {:.3g} times as fast": float(np.quantile(quick, FAST)) if len(quick) else 0.0,
        "lasts {:.3g} times as long": float(time[-1] - time[0]),
        "is loaded {:.3g} times as often": float(np.count_nonzero(half[1:] & ~half[:-1])),
    }


def recording_differences(result: Diagnosis, name: str) -> list[str]:
    """Return in words what differs between a check recording and the fitted ones.

    Parameters
    ----------
    result : Diagnosis
    name : str
        Of the check recording.
    """
    other, fitted = next(p for p in result.of("check") if p.trial.name == name), result.of("fit")
    own, *others = (_level_and_gain(p, result.best.model, result.full) for p in (other, *fitted))
    level, gain = (_outside(values, value) for value, values in zip(own, zip(*others, strict=True), strict=True))
    said = []
    if abs(level) > LEAST_LEVEL:
        more = "more" if level > 0 else "less"
        said.append(f"without load it reads {abs(level):.1%} of the range {more} than any fitted one")
    if abs(gain) > LEAST_GAIN:
        said.append(f"under the same load it reads {abs(gain):.0%} {'more' if gain > 0 else 'less'} than any fitted one")
    loadings = [_loading(p) for p in fitted]
    for words, value in _loading(other).items():
        most = max(one[words] for one in loadings)
        if value > OUTSIDE * most > 0.0:
            said.append(f"it {words.format(value / most)} as any fitted one")
    load, known = other.stimulus.load.sum(axis=0), np.any([(p.stimulus.load > 0).any(axis=0) for p in fitted], axis=0)
    share = float(load[~known].sum()) / max(float(load.sum()), 1e-300)
    if share > LEAST_NEW_LOAD:
        said.append(f"{share:.0%} of its load is on texels that no fitted one touches")
    if other.stimulus.slide_speed.any() and not any(p.stimulus.slide_speed.any() for p in fitted):
        said.append("a surface slides in it, and in no fitted one")
    return said or ["it does not differ from the fitted ones in level, gain, depth, speed, length or place"]


def _outside(values: Sequence[float], value: float) -> float:
    """How far a value lies outside the range of some others; 0 inside or if unknown."""
    known = [one for one in values if np.isfinite(one)]
    return max(value - max(known), 0.0) + min(value - min(known), 0.0) if known and np.isfinite(value) else 0.0
