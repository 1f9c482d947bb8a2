# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of a converter that compands: steps that are even only after a power or a logarithm of the reading.

Values with even steps q have a characteristic function that is large at the frequency 1/q, whatever their distribution (Widrow
and Kollár, Quantization Noise, 2008). Steps behind a power or a logarithm are even after the transform, which is not known. In
a narrow range of readings every such transform is a power, so powers are tried there on a grid; then the range grows, and the
transform is found more and more exactly, for the power and for the logarithm each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

LEAST_READINGS = 400
"""Number of readings from which on steps are looked for."""
LEAST_CHARACTERISTIC, CHARACTERISTIC_NOISE = 0.2, 5.0
"""Least magnitude of the characteristic function at the frequency of the steps: 0.2 + 5 / √(number of readings). Of 120
readings with steps none was missed by it, and no alarm was false in 120 without (benchmarks/RESULTS.md)."""
LEAST_REPEATED = 0.02
"""Share of the readings that repeat another exactly, from which on a converter made them. Noise repeats nothing, and a smooth
ramp without noise, whose samples are as regular as steps, neither. Chosen by eye."""
BINS, PADDING = 1 << 13, 4
"""Of the histogram whose Fourier transform is the characteristic function."""
LEAST_STEPS = 6
"""Number of steps that a range must hold for their frequency to be found in it."""
RATIOS = (1.15, 1.5, 3.0)
"""First ranges: from the largest to the smallest reading. A narrow range is needed for many steps, a wide one for few."""
GROWTH = 1.35
"""Factor by which a range grows at either end."""
FINENESS = 1.2
"""Distance of the powers that are tried, times the number of steps in a range and the range's width: at most a tenth of a step
is then misplaced at the ends."""
HARMONIC = 0.9
"""Frequencies of steps are large at their multiples, too: the lowest one counts that reaches this share of the largest."""
CLEAR = 0.6
"""Magnitude from which on no further range is tried. Steps with a wrong transform reached 0.48 at most in 120 readings."""
LEAST_COVERED = 0.5
"""Share of the readings that the final range must hold."""
MOST_BEND = 1.25
"""Steps bend by less than this: a converter after a square has -1, after a logarithm 1."""
NEARLY_EVEN = 0.02
"""A logarithm that bends less is taken for even steps."""
LOWEST = 1e-3
"""Readings below this share of the largest are not looked at: the smallest error of the zero moves them over whole steps."""


@dataclass(frozen=True)
class CompandedSteps:
    """Steps that are even after a transform of the reading.

    Attributes
    ----------
    logarithmic : bool
        True if the transform is ``ln(1 + r/A)``; else it is a power.
    bend : float
        By which power of the reading the steps grow at `middle`: zero for even steps, one half behind a square root.
    middle : float
        A reading above rest, in the sensor's unit.
    frequency : float
        Number of steps per unit of the reading at `middle`.
    strength : float
        Magnitude of the characteristic function, at most 1.
    """

    logarithmic: bool
    bend: float
    middle: float
    frequency: float
    strength: float

    @property
    def scale(self) -> float:
        """A of the logarithm ``ln(1 + r/A)``, in the sensor's unit."""
        return self.middle * (1.0 - self.bend) / self.bend

    @property
    def growth(self) -> float:
        """Width of a step as a share of the sum of A and the reading."""
        return 1.0 / (self.frequency * (self.middle + self.scale))

    @property
    def exponent(self) -> float:
        """Power of the reading after which the steps are even."""
        return 1.0 - self.bend

    @property
    def first(self) -> float:
        """Reading of the first step above rest, in the sensor's unit, of a power."""
        p = self.exponent
        return float((p / (self.frequency * self.middle ** (1.0 - p))) ** (1.0 / p))

    def even(self, reading: np.ndarray) -> np.ndarray:
        """Return readings after the transform; its slope is one at `middle`."""
        if self.logarithmic and 0.0 < self.bend < 1.0:
            whole = self.middle + self.scale
            return np.asarray(whole * np.log1p((reading - self.middle) / whole))
        p = self.exponent
        if abs(p) < 1e-6:
            return np.asarray(self.middle * np.log(reading / self.middle))
        return np.asarray(self.middle / p * np.expm1(p * np.log(reading / self.middle)))


def companded_steps(values: np.ndarray) -> list[CompandedSteps]:
    """Return the steps of readings, for a power and for a logarithm, the better first; empty if none are seen.

    Parameters
    ----------
    values : (n,) float
        Readings less the reading without load, in the sensor's unit.
    """
    return list(_companded_steps_kept(np.ascontiguousarray(values, float).tobytes()))


@lru_cache(maxsize=2)
def _companded_steps_kept(raw: bytes) -> tuple[CompandedSteps, ...]:
    """Steps of readings given as bytes. Several forms ask for the steps of the same readings."""
    values = np.frombuffer(raw)
    size = np.abs(values)
    above = values[size > 0.0] if len(values) else values
    if len(above) < LEAST_READINGS:
        return ()
    above = above * np.sign(np.quantile(above, 0.99) + np.quantile(above, 0.01))
    above = np.sort(above[above > LOWEST * above.max()])
    if len(above) < LEAST_READINGS or 1.0 - len(np.unique(above)) / len(above) < LEAST_REPEATED:
        return ()
    best: list[CompandedSteps] = []
    for seed in _seeds(above):
        grown = [_grown(above, replace(seed, logarithmic=logarithmic)) for logarithmic in (False, True)]
        found = sorted((_fundamental(above, one) for one in grown if one), key=lambda one: -one.strength)
        if found and (not best or found[0].strength > best[0].strength):
            best = found
        if best and best[0].strength >= CLEAR:
            break
    return tuple(best)


def _fundamental(above: np.ndarray, steps: CompandedSteps) -> CompandedSteps:
    """The same steps, but the widest of which those that were found are a whole part."""
    count = steps.frequency * float(np.ptp(steps.even(above)))
    for divisor in (2, 3, 5):
        if count < 2.0 * LEAST_STEPS * divisor:
            break
        wider = _with_frequency(replace(steps, strength=0.0), above, steps.frequency / divisor)
        if wider.strength >= HARMONIC * steps.strength:
            return _fundamental(above, wider)
    return steps


def _threshold(count: int) -> float:
    return LEAST_CHARACTERISTIC + CHARACTERISTIC_NOISE / np.sqrt(max(count, 1))


def _seeds(above: np.ndarray) -> Iterator[CompandedSteps]:
    """Steps that are seen in a range of the sorted readings, clearest ranges first."""
    ranges = []
    for ratio in RATIOS:
        top = above[-1]
        while top > 3.0 * LOWEST * above[-1]:
            inside = above[np.searchsorted(above, top / ratio) : np.searchsorted(above, top, side="right")]
            if len(inside) >= LEAST_READINGS / 4:
                ranges.append((len(inside), ratio, inside))
            top /= np.sqrt(ratio)
    for ratio in RATIOS:
        for _, _, inside in sorted((one for one in ranges if one[1] == ratio), key=lambda one: -one[0])[:3]:
            middle = float(np.sqrt(inside[0] * inside[-1]))
            bends = np.arange(-MOST_BEND, MOST_BEND + 0.01, 0.05 if ratio < 1.3 else 0.025)
            tried = [CompandedSteps(False, float(bend), middle, 0.0, 0.0) for bend in bends]
            best = max((_with_frequency(one, inside) for one in tried), key=lambda one: one.strength)
            if best.strength >= _threshold(len(inside)):
                yield best


def _with_frequency(steps: CompandedSteps, inside: np.ndarray, near: float | None = None) -> CompandedSteps:
    """Transform with the frequency at which the characteristic function of readings is large."""
    x = steps.even(inside)
    width = float(x.max() - x.min())
    if not width > 0.0:
        return steps
    bins = np.bincount(np.round((x - x.min()) / width * (BINS - 1)).astype(int), minlength=BINS)
    size = np.abs(np.fft.rfft(bins, PADDING * BINS)) / len(x)
    frequency = np.arange(len(size)) * (BINS - 1) / (PADDING * BINS * width)
    looked_at = slice(PADDING * LEAST_STEPS, len(size) // 2)
    if near is not None:
        reach = max(2.0 / width, 0.02 * near)
        first = max(int(np.searchsorted(frequency, near - reach)), PADDING)
        looked_at = slice(first, max(int(np.searchsorted(frequency, near + reach)), first + 1))
    part = size[looked_at]
    if not len(part):
        return steps
    best = int(np.argmax(part))
    if near is None:
        best = _lowest(part, best)
    return replace(steps, frequency=float(frequency[looked_at][best]), strength=float(part[best]))


def _lowest(size: np.ndarray, best: int) -> int:
    """The lowest frequency that is nearly as large as the largest, at its top."""
    at = int(np.argmax(size >= HARMONIC * size[best]))
    while at + 1 < len(size) and size[at + 1] > size[at]:
        at += 1
    return at


def _grown(above: np.ndarray, seed: CompandedSteps) -> CompandedSteps | None:
    """Follow steps from the range in which they were seen to all readings; None if they are lost on the way."""
    steps, low, high = seed, seed.middle / RATIOS[0], seed.middle * RATIOS[0]
    apart = 0.05
    last = False
    while not last:
        low, high = max(low / GROWTH, above[0]), min(high * GROWTH, above[-1])
        last = low == above[0] and high == above[-1]
        inside = above[np.searchsorted(above, low) : np.searchsorted(above, high, side="right")]
        if len(inside) < LEAST_READINGS / 4:
            continue
        better, finer = _bent(steps, inside, apart)
        if better.strength < _threshold(len(inside)):
            return steps if steps is not seed and _covers(above, low * GROWTH, high / GROWTH) else None
        steps, apart = better, finer
    return steps if steps.strength >= _threshold(len(above)) else None


def _bent(steps: CompandedSteps, inside: np.ndarray, apart: float) -> tuple[CompandedSteps, float]:
    """The best bend near the present one for a larger range, and how exactly it is known then."""
    width = float(np.log(inside[-1] / inside[0]))
    count = steps.frequency * float(np.ptp(steps.even(inside)))
    fine = min(FINENESS / max(count * width, 1e-9), 0.05)
    bends = steps.bend + fine * np.arange(-int(np.ceil(1.5 * apart / fine)), int(np.ceil(1.5 * apart / fine)) + 1)
    bends = bends[(bends > NEARLY_EVEN) & (bends < 1.0)] if steps.logarithmic else bends[np.abs(bends) < MOST_BEND]
    tried = [_with_frequency(replace(steps, bend=float(bend), strength=0.0), inside, steps.frequency) for bend in bends]
    best = max(tried, key=lambda one: one.strength, default=replace(steps, strength=0.0))
    return best, min(fine, apart)


def _covers(above: np.ndarray, low: float, high: float) -> bool:
    inside = np.searchsorted(above, high, side="right") - np.searchsorted(above, low)
    return bool(inside >= LEAST_COVERED * len(above))
