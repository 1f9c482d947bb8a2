# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between a check recording and the fitted ones, in words: a check that fails should say where to look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..forward.predictor import Model, Predictor
from ..selection.findings import Diagnosis

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


@dataclass(frozen=True)
class RecordingSummary:
    """What was done in a recording, and how its readings lie beside a model's.

    Attributes
    ----------
    level : float
        Mean of measured minus predicted without load, as a share of the range; NaN if nothing is unloaded.
    gain : float
        Factor of the predicted readings, less their zero, that fits the measured ones best.
    depth, speed, seconds, loads : float
        Largest load, fast rate of loading, length, and number of times that it is loaded.
    load : (n,) float
        Sum of each texel's load.
    slides : bool
    """

    level: float
    gain: float
    depth: float
    speed: float
    seconds: float
    loads: int
    load: np.ndarray
    slides: bool


def recording_summary(predictor: Predictor, model: Model, full: tuple[float, float]) -> RecordingSummary:
    """Return the summary of one recording; without readings the net force along its largest component is compared."""
    trial, predicted = predictor.trial, predictor.predict(model)
    if trial.reading is not None:
        measured, expected, size, zero = trial.reading, predicted.reading, full[0], model.parameters.zero
        idle = predictor.stimulus.load <= 0
    else:
        assert trial.force is not None and predicted.force is not None
        axis = int(np.argmax(np.nansum(trial.force**2, axis=0)))
        measured, expected, size, zero = trial.force[:, axis : axis + 1], predicted.force[:, axis : axis + 1], full[1], 0.0
        idle = ~(predictor.stimulus.load > 0).any(axis=1, keepdims=True)
    known = np.isfinite(measured)
    rest = known & idle
    level = float((measured - expected)[rest].mean()) / size if rest.any() else float("nan")
    shift = level * size if np.isfinite(level) else 0.0
    x, y = (expected - zero)[known & ~idle], (measured - zero - shift)[known & ~idle]
    gain = float(x @ y) / float(x @ x) if float(x @ x) > 0 else float("nan")
    load = predictor.stimulus.load
    total = load.max(axis=1)
    rate = np.gradient(total, trial.time)
    quick = rate[rate > 0]
    half = total > 0.5 * max(float(total.max(initial=0.0)), 1e-300)
    return RecordingSummary(
        level,
        gain,
        float(total.max(initial=0.0)),
        float(np.quantile(quick, FAST)) if len(quick) else 0.0,
        float(trial.time[-1] - trial.time[0]),
        int(np.count_nonzero(half[1:] & ~half[:-1])),
        load.sum(axis=0),
        bool(predictor.stimulus.slide.any()),
    )


def recording_differences(result: Diagnosis, name: str) -> list[str]:
    """Return in words what differs between a check recording and the fitted ones.

    Parameters
    ----------
    result : Diagnosis
    name : str
        Of the check recording.
    """
    model = result.best.model
    fitted = [recording_summary(p, model, result.full) for p in result.of("fit")]
    other = next(recording_summary(p, model, result.full) for p in result.of("check") if p.trial.name == name)
    said = [*_response_differences(fitted, other), *_loading_differences(fitted, other)]
    return said or ["it does not differ from the fitted ones in level, gain, depth, speed, length or place"]


def _response_differences(fitted: list[RecordingSummary], other: RecordingSummary) -> list[str]:
    """Differences of the level without load and of the gain."""
    said = []
    levels, gains = np.array([one.level for one in fitted]), np.array([one.gain for one in fitted])
    away = _outside(levels, other.level)
    if abs(away) > LEAST_LEVEL:
        said.append(f"without load it reads {abs(away):.1%} of the range {'more' if away > 0 else 'less'} than any fitted one")
    away = _outside(gains, other.gain)
    if abs(away) > LEAST_GAIN:
        said.append(f"under the same load it reads {abs(away):.0%} {'more' if away > 0 else 'less'} than any fitted one")
    return said


def _loading_differences(fitted: list[RecordingSummary], other: RecordingSummary) -> list[str]:
    """Differences of what was done to the sensor."""
    said = []
    for attribute, words in (
        ("depth", "it is loaded {:.3g} times as much as any fitted one"),
        ("speed", "it is loaded {:.3g} times as fast as any fitted one"),
        ("seconds", "it lasts {:.3g} times as long as any fitted one"),
        ("loads", "it is loaded {:.3g} times as often as any fitted one"),
    ):
        most, own = max(float(getattr(one, attribute)) for one in fitted), float(getattr(other, attribute))
        if own > OUTSIDE * most > 0.0:
            said.append(words.format(own / most))
    known = np.sum([one.load for one in fitted], axis=0) > 0
    share = float(other.load[~known].sum()) / max(float(other.load.sum()), 1e-300)
    if share > LEAST_NEW_LOAD:
        said.append(f"{share:.0%} of its load is on texels that no fitted one touches")
    if other.slides and not any(one.slides for one in fitted):
        said.append("a surface slides in it, and in no fitted one")
    return said


def _outside(values: np.ndarray, value: float) -> float:
    """How far a value lies outside the range of some others; 0 inside or if unknown."""
    values = values[np.isfinite(values)]
    if not len(values) or not np.isfinite(value):
        return 0.0
    return float(max(value - values.max(), 0.0) + min(value - values.min(), 0.0))
