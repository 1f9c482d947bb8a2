# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests for structure in a residual: does it contain more than noise, and what does it depend on?

Regressions on features of the trials are fitted to some trials and judged on the others. Noise of other trials cannot be
predicted, however coloured it is, as long as each texel has its own. A share of the residual that can be predicted is
structure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.engine.registry import only_name_where
from ...effects.engine.specification import SCATTER
from ...model.sensor import Effect
from ..forward.contact_phases import features, known_readings, relative_load
from ..forward.predictor import Model, Predictor
from .least_squares import TrialView

LEAST_STRUCTURE = 0.03
"""Share of a residual that can be predicted, below which the residual is noise."""


@dataclass(frozen=True)
class ResidualStructure:
    """Share of a residual's mean square that can be predicted.

    Attributes
    ----------
    total : float
        By all features together.
    shares : dict of str to float
        By each group of :data:`~.contact_phases.FEATURES` alone.
    """

    total: float
    shares: dict[str, float]

    @property
    def strongest(self) -> str:
        """The group of features that predicts most."""
        return max(self.shares, key=lambda name: self.shares[name]) if self.shares else ""


NO_STRUCTURE = ResidualStructure(0.0, {})


def residual_structure(predictors: Sequence[Predictor], residuals: Sequence[np.ndarray]) -> ResidualStructure:
    """Find out on which features residuals depend.

    Parameters
    ----------
    predictors : sequence of Predictor
        Of the trials.
    residuals : sequence of (T, n) float
        In units of the noise; zero if a value is missing.
    """
    found = [features(predictor, residual) for predictor, residual in zip(predictors, residuals, strict=True)]
    sizes = {name: len(columns) for groups in found for name, columns in groups.items()}
    sums = []
    for predictor, groups, residual in zip(predictors, found, residuals, strict=True):
        # A group that only other trials have is zero, such as depth beside no contact.
        table = np.concatenate([groups.get(name, np.zeros((size, *residual.shape))) for name, size in sizes.items()])
        table[:, ~known_readings(predictor)] = 0.0
        middle = len(residual) // 2  # the halves of a single trial serve as two trials
        for part in [slice(None)] if len(predictors) > 1 else [slice(None, middle), slice(middle, None)]:
            x, r = table[:, part].reshape(len(table), -1), residual[part].ravel()
            sums.append((x @ x.T, x @ r, float(r @ r)))
    total = sum(square for _, _, square in sums)
    if total <= 0:
        return ResidualStructure(0.0, dict.fromkeys(sizes, 0.0))
    shares, start = {}, 0
    for name, size in sizes.items():
        shares[name] = _share_predicted(sums, np.arange(start, start + size))
        start += size
    everything = _share_predicted(sums, np.arange(start))
    if residuals[0].shape[1] > 1 and len(predictors) > 1:
        shares["texel"] = _share_predicted_by_texel(predictors, residuals, total)
        everything = 1.0 - (1.0 - everything) * (1.0 - shares["texel"])
    return ResidualStructure(max(everything, *shares.values()), shares)


def _share_predicted(sums: list[tuple[np.ndarray, np.ndarray, float]], use: np.ndarray) -> float:
    """Share of the squares that a ridge regression on some features predicts in folds that it has not seen; never below 0.
    `sums` are, for each fold, the products of the features with each other (p, p) and with the residual (p,), and the squares
    of the residual; `use` (f,) are indices of features.
    """
    grams, products, squares = zip(*((a[np.ix_(use, use)], b[use], square) for a, b, square in sums), strict=True)
    whole, along, left = sum(grams), sum(products), sum(squares)
    for a, b in zip(grams, products, strict=True):
        seen = whole - a
        weights = np.linalg.solve(seen + np.diag(1e-3 * np.diag(seen) + 1e-9 * (1.0 + np.trace(seen))), along - b)
        left += float(weights @ a @ weights - 2.0 * weights @ b)
    return max(1.0 - left / sum(squares), 0.0)


def _share_predicted_by_texel(predictors: Sequence[Predictor], residuals: Sequence[np.ndarray], total: float) -> float:
    """The same for a constant and a gain of each texel."""
    known = [known_readings(predictor) for predictor in predictors]
    loads = [relative_load(predictor.stimulus) * k for predictor, k in zip(predictors, known, strict=True)]
    parts, left = [], 0.0
    for k, d, r in zip(known, loads, residuals, strict=True):
        parts.append(np.stack([table.sum(axis=0) for table in (k.astype(float), d, d * d, r, d * r)]))
    for i, (k, d, r) in enumerate(zip(known, loads, residuals, strict=True)):
        one, d1, d2, r1, rd = sum(parts[:i] + parts[i + 1 :])
        # Ridge regression: texels that were hardly loaded get small coefficients.
        one, d2 = one * 1.01 + 1.0, d2 * 1.01 + 1.0
        det = one * d2 - d1 * d1
        offset, gain = (d2 * r1 - d1 * rd) / det, (one * rd - d1 * r1) / det
        miss = np.where(k, r - offset - gain * d, 0.0)
        left += float(np.vdot(miss, miss))
    return max(1.0 - left / total, 0.0)


# Heteroscedastic noise: noise whose standard deviation is proportional to the reading, which no fit can explain.
#
# It is found from the squares of a residual. They must grow with the reading, and otherwise the residual must be like white
# noise: uncorrelated in time and between texels. The residual of a model that lacks something else is correlated.

NOISE = only_name_where(lambda kind: kind.found_by == SCATTER)

LEAST_VARIANCE_RATIO = 1.5
"""Least mean square of the residual at large readings, in units of that at rest."""
LEAST_GROWTH = 1.2
"""Least ratio of the mean squares at large and at small readings."""
MOST_CORRELATION = 0.15
"""Largest correlation with the sample before, and between texels."""
RESTING, LOADED = 1.0, 3.0
"""Readings below and above which a sample counts as resting and as loaded, in standard deviations of the noise."""
LEAST_RESTING, LEAST_LOADED, LEAST_IN_TRIAL = 100, 400, 100
"""Least number of resting samples, of loaded ones, and of loaded ones in a trial for the trial to be judged by itself."""
LARGE_QUANTILE, SMALL_QUANTILE = 0.67, 0.33
"""Quantiles of the loaded readings that bound the large and the small ones."""
STEADY = (0.3, 3.0)
"""Bounds of each trial's coefficient, as multiples of that of all trials."""


def proportional_noise(views: Sequence[TrialView], model: Model) -> Effect | None:
    """Return noise in proportion to the reading if a model's residual is like that, else None.

    Parameters
    ----------
    views : sequence of TrialView
        Whole trials.
    model : Model
        A fitted model without noise.
    """
    sizes, squares, correlations, rest = [], [], [], [np.zeros(0)]
    for view in views:
        reading = view.predictor.trial.reading
        if reading is None:
            continue
        residual = view.residual(model)[:, : reading.shape[1]]
        size = np.abs(view.predictor.predict(model).reading - model.parameters.zero) / view.noise[0]
        known = np.isfinite(reading)
        rest.append(residual[known & (size < RESTING)])
        loaded = known & (size > LOADED)
        sizes.append(size[loaded])
        squares.append(residual[loaded] ** 2)
        correlations.append(_correlations(size, residual, loaded))
    still = np.concatenate(rest)
    if len(still) < LEAST_RESTING or sum(map(len, sizes)) < LEAST_LOADED:
        return None
    floor = max(float(np.mean(still * still)), 1e-6)
    size, square = np.concatenate(sizes), np.concatenate(squares)
    each = [_variance_coefficient(a, b, floor) for a, b in zip(sizes, squares, strict=True) if len(a) > LEAST_IN_TRIAL]
    pooled = _variance_coefficient(size, square, floor)
    large = square[size > np.quantile(size, LARGE_QUANTILE)]
    small = square[size < np.quantile(size, SMALL_QUANTILE)]
    if not (len(large) and len(small)):  # all readings are equal, as at the rail of a converter
        return None
    grows = large.mean() > LEAST_VARIANCE_RATIO * floor and large.mean() > LEAST_GROWTH * small.mean()
    steady = pooled > 0.0 and min(each, default=0.0) > STEADY[0] * pooled and max(each, default=0.0) < STEADY[1] * pooled
    correlation = np.average(correlations, axis=0, weights=np.array([len(one) for one in sizes], float))
    if not (grows and steady and (correlation < MOST_CORRELATION).all()):
        return None
    return Effect(NOISE, "proportional", {"share": float(np.sqrt(pooled))})


def _correlations(size: np.ndarray, residual: np.ndarray, loaded: np.ndarray) -> tuple[float, float]:
    """Correlations of the residual (T, n) at large readings with the sample before, and between texels.

    They are of residuals in units of the local reading, so that a few large ones do not decide. At small readings the noise at
    rest would hide what a model lacks. `size` (T, n) is the magnitude of the predicted readings, in units of the noise.
    """
    large = loaded & (size > np.quantile(size[loaded], LARGE_QUANTILE)) if loaded.any() else loaded
    unit = np.where(large, residual / np.maximum(size, 1.0), 0.0)
    both = large[1:] & large[:-1]
    square = float((unit * unit).sum())
    serial = float((unit[1:] * unit[:-1])[both].sum()) / max(square, 1e-300)
    together = unit.sum(axis=1)
    pairs = float((together * together).sum()) - square
    count = large.sum(axis=1)
    possible = float((count * (count - 1)).sum()) / max(float(count.sum()), 1.0)
    return serial, pairs / max(square * possible, 1e-300) if possible > 0 else 0.0


def _variance_coefficient(size: np.ndarray, square: np.ndarray, floor: float) -> float:
    """Variance of the noise divided by the squared reading, by weighted least squares."""
    squares, value = size**2, 0.0
    for _ in range(4):
        weight = 1.0 / (floor + value * squares) ** 2
        value = max(float((weight * (square - floor) * squares).sum() / (weight * squares * squares).sum()), 0.0)
    return value


# Spectral lines in the residual without load: mains hum, a fan, a pump.
#
# No effect explains a periodic disturbance, and a fit does not show it, because it is part of the noise at rest. Fisher's test
# for a periodicity (Proc. R. Soc. A 125, 1929) is used with the local level of the spectrum, so that noise may be coloured.
# Texels may share all of their noise; only trials count as independent.

FALSE_ALARM = 1e-4
"""Probability of finding a line in pure noise."""
LEAST_LINE_SHARE = 0.2
"""Least share of the squares at rest that a line must have to be reported."""
NEIGHBOUR_FREQUENCIES, LINE_HALF_WIDTH = 16, 3
"""Number of frequencies on either side that give the level of the noise, and how many of these the line itself may cover."""
LEAST_PROMINENCE = 3.0
"""Least ratio of a line to the level of the noise in every trial."""
LONGEST_GRID = 32
"""Points of the even grid of time per sample, above which no spectrum is computed: a recording with such pauses has none."""
SEARCH_WIDTH, SEARCH_POINTS = 0.6, 13
"""The frequency of a line is refined within this many frequency steps on either side, at so many points."""


@dataclass(frozen=True)
class SpectralLine:
    """A spectral line.

    Attributes
    ----------
    frequency : float, Hz
        As sampled: a line above half the sampling rate appears at another frequency.
    amplitude : float
        Of a texel's reading, root mean square over the texels, in the sensor's unit.
    share : float
        Share of the line in the squares of the residual at rest.
    """

    frequency: float
    amplitude: float
    share: float


UnloadedResidual = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of one trial: times (t,) in seconds, the residual about its mean without load (t, n) in units of the noise, zero where it is
not known, and where it is known, because a texel is unloaded and was measured, (t, n) bool."""


def strongest_line(views: Sequence[TrialView], model: Model) -> SpectralLine | None:
    """Return the strongest line that all trials have without load; None without a line.

    Parameters
    ----------
    views : sequence of TrialView
        Whole trials.
    model : Model
    """
    from scipy.special import gammaincc

    resting = [one for one in (_unloaded_residual(view, model) for view in views) if one is not None]
    if not resting:
        return None
    times = [time for time, _, _ in resting]
    step = min(float(np.median(np.diff(time))) for time in times)
    if max(float(np.ptp(time)) for time in times) / step > LONGEST_GRID * max(map(len, times)):
        return None
    sample_indices = [np.round((time - time[0]) / step).astype(int) for time in times]
    length = max(int(indices[-1]) for indices in sample_indices) + 1
    powers = []
    for indices, (_, values, known) in zip(sample_indices, resting, strict=True):
        resampled = np.zeros((length, values.shape[1]))
        resampled[indices] = values
        powers.append((np.abs(np.fft.rfft(resampled, axis=0)) ** 2).sum(axis=1) / max(float(known.sum()), 1.0))
    usable = slice(LINE_HALF_WIDTH + 1, len(powers[0]) - 2)
    ratios = [power / _noise_level(power) for power in powers]
    ratio = np.sum(ratios, axis=0)[usable]
    if len(ratio) < 2 * NEIGHBOUR_FREQUENCIES:
        return None
    peak = int(np.argmax(ratio)) + usable.start
    in_all_trials = all(one[peak - 1 : peak + 2].max() > LEAST_PROMINENCE for one in ratios)
    by_chance = gammaincc(len(powers), ratio.max())  # that a sum of exponential values of mean one is larger than this
    if not in_all_trials or by_chance * len(ratio) > FALSE_ALARM:
        return None
    near = (peak + np.linspace(-SEARCH_WIDTH, SEARCH_WIDTH, SEARCH_POINTS)) / (length * step)
    best = max((_line_at(resting, float(f), views[0].noise[0]) for f in near), key=lambda line: line.share)
    return best if best.share > LEAST_LINE_SHARE else None


def _unloaded_residual(view: TrialView, model: Model) -> UnloadedResidual | None:
    """Return the residual of a trial's texels while they are unloaded; None if there is too little of it."""
    reading = view.predictor.trial.reading
    time = view.predictor.stimulus.time
    if reading is None or len(time) < 4 * NEIGHBOUR_FREQUENCIES:
        return None
    known = (relative_load(view.predictor.stimulus) <= 0.0) & np.isfinite(reading)
    known &= known.sum(axis=0) >= len(time) // 4
    if not known.any():
        return None
    residual = np.where(known, view.residual(model)[:, : reading.shape[1]], 0.0)
    residual = np.where(known, residual - residual.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
    return time, residual, known


def _noise_level(power: np.ndarray) -> np.ndarray:
    """Level of the noise around each frequency, from the median: that of exponential values is ln 2 times their mean."""
    wide = np.pad(power, NEIGHBOUR_FREQUENCIES, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(wide, 2 * NEIGHBOUR_FREQUENCIES + 1)
    kept = np.abs(np.arange(-NEIGHBOUR_FREQUENCIES, NEIGHBOUR_FREQUENCIES + 1)) > LINE_HALF_WIDTH
    return np.maximum(np.median(windows[:, kept], axis=1) / np.log(2.0), 1e-300)


def _line_at(resting: list[UnloadedResidual], frequency: float, noise: float) -> SpectralLine:
    """Amplitude and share of a line at a frequency, by least squares for each texel."""
    line = total = samples = 0.0
    for time, values, known in resting:
        wave = np.exp(-2j * np.pi * frequency * (time - time[0]))
        count = known.sum(axis=0)
        amplitude = 2.0 * np.abs(wave @ values) / np.maximum(count, 1)
        line += float((0.5 * amplitude**2 * count).sum())
        total += float((values * values).sum())
        samples += float(count.sum())
    return SpectralLine(frequency, float(np.sqrt(2.0 * line / samples)) * noise, min(line / max(total, 1e-300), 1.0))
