# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings of a sensor from the forces on its texels: at once or sample by sample, with equal results."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from ...model.sensor import Effect, Values
from .compiled_program import constants_of, law_over_time
from .coupling_matrix import Weights, coupled
from .registry import complete_values, in_signal_order
from .specification import Form, TransducerArray

if TYPE_CHECKING:
    from ...model.sensor import Sensor

SERIES_KEPT, LONGEST_KEPT = 64, 20_000
"""Number of series whose steps are kept, and how many samples they have at most: as many recordings as a rig may have, without
holding on to memory."""


def steps_of(time: np.ndarray, before: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of step that occur in a series of time stamps.

    Lengths that differ only by the rounding of the time stamps count as one.

    Parameters
    ----------
    time : (t,) float, s, increasing
    before : float, s, optional
        Time of the sample before these. Without it, the step that leads to the first sample has length zero.

    Returns
    -------
    lengths : (m,) float, s
    step : (t,) int
        Index of the length of the step that leads to each sample.
    """
    time = np.asarray(time, float)
    if len(time) > LONGEST_KEPT:
        return _computed_steps(time, before)
    lengths, step = _steps_kept(time.tobytes(), before)
    return lengths.copy(), step.copy()


@lru_cache(maxsize=SERIES_KEPT)
def _steps_kept(stamps: bytes, before: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Steps of time stamps that are given as bytes: a fit asks thousands of times for the same few series."""
    return _computed_steps(np.frombuffer(stamps), before)


def _computed_steps(time: np.ndarray, before: float | None) -> tuple[np.ndarray, np.ndarray]:
    start = time[0] if before is None else before
    lengths = np.diff(time, prepend=start)
    rounding = 1e-9 * max(abs(float(time[-1])), abs(float(start)), 1e-9)
    whole = np.round(lengths / rounding) if rounding > 0.0 else lengths
    _, first, step = np.unique(whole, return_index=True, return_inverse=True)
    return lengths[first], step.ravel()


def transducers_of(sensor: Sensor) -> TransducerArray:
    """Return the texels of a sensor as its effects on readings see them."""
    texels, parameters = sensor.texels, sensor.parameters
    row, column = getattr(texels.layout, "row", None), getattr(texels.layout, "column", None)
    painted = 1.0 if sensor.painted.gain is None else sensor.painted.gain
    return TransducerArray(texels.position, texels.area, row, column, parameters.gain, parameters.zero, painted, sensor.name)


def readings(effects: Iterable[Effect], transducers: TransducerArray, time: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the readings of a sensor under known forces, (t, n) float, in its unit.

    Parameters
    ----------
    effects : iterable of Effect
        Effects on contact forces are ignored.
    transducers : TransducerArray
    time : (t,) float, s, increasing
    force : (t, n) float, N
    """
    return ReadoutChain(effects, transducers).read(np.asarray(time, float), np.asarray(force, float))


class ReadoutChain:
    """Turns forces into readings, any number of samples at a time.

    The readings do not depend on how the samples are divided.

    Parameters
    ----------
    effects : iterable of Effect
        Effects on contact forces are ignored.
    transducers : TransducerArray
    """

    def __init__(self, effects: Iterable[Effect], transducers: TransducerArray):
        self.transducers = transducers
        self._links: list[Callable[[np.ndarray, np.ndarray], np.ndarray]] = []
        conversion, converted = partial(_converted, transducers), False
        for item, form in in_signal_order(effects, readout=True):
            if form.after_conversion and not converted:
                self._links.append(conversion)
                converted = True
            values = complete_values(item, transducers.gain)
            if form.law is not None:
                self._links.append(_Law(form, values, len(transducers.position)))
            elif form.coupling is not None:
                self._links.append(partial(_coupled, form.coupling(values, transducers)))
            elif form.memoryless is not None:
                self._links.append(partial(_changed, form.memoryless, values, transducers, item.seed))
            if form.delay is not None:
                self._links.append(_Delay(form.delay(values), len(transducers.position)))
        if not converted:
            self._links.append(conversion)

    @classmethod
    def of(cls, sensor: Sensor) -> ReadoutChain:
        """Return the readout chain of a sensor."""
        return cls(sensor.effects, transducers_of(sensor))

    def read(self, time: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the readings (t, n) of the next samples: `time` (t,) s, increasing, and `force` (t, n) N.

        If the first sample has the time of the last one before, that sample is read again.
        """
        signal = force
        for link in self._links:
            signal = link(time, signal)
        return signal

    def step(self, time: float, force: np.ndarray) -> np.ndarray:
        """Return the readings (n,) of the next sample."""
        return self.read(np.array([time]), force[None, :])[0]


def _converted(transducers: TransducerArray, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """Convert newtons to the unit of the sensor (paper, section 4)."""
    reading: np.ndarray = transducers.gain * transducers.painted * signal
    reading += transducers.zero
    return reading


def _changed(
    formula: Callable[..., np.ndarray],
    values: Values,
    transducers: TransducerArray,
    seed: int,
    time: np.ndarray,
    signal: np.ndarray,
) -> np.ndarray:
    """Apply a formula without memory."""
    return formula(signal, time, values, transducers, seed)


def _coupled(weights: Weights, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """Apply a linear coupling of texels."""
    return coupled(signal, weights)


class _Law:
    """Applies a law with memory."""

    def __init__(self, form: Form, values: Values, texels: int):
        self.form, self.values = form, values
        self.memory = np.zeros((texels, form.state_size))
        self.last: float | None = None

    def __call__(self, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
        lengths, step = steps_of(time, self.last)
        self.last = float(time[-1])
        return law_over_time(self.form, signal, step, constants_of(self.form, self.values, lengths), self.memory)


class _Delay:
    """Delays the signal, which is linear between samples and constant before the first."""

    def __init__(self, delay: float, texels: int):
        self.delay = delay
        self.time, self.signal = np.zeros(0), np.zeros((0, texels))  # the part of the past that is still needed

    def __call__(self, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
        if not len(self.time):
            self.time, self.signal = time, signal
        else:
            fresh = time > self.time[-1]
            self.time = np.concatenate([self.time, time[fresh]])
            self.signal = np.concatenate([self.signal, signal[fresh]])
        source_time = time - self.delay
        right = np.clip(np.searchsorted(self.time, source_time, side="left"), 1, max(len(self.time) - 1, 1))
        left = right - 1
        right = np.minimum(right, len(self.time) - 1)
        gap = self.time[right] - self.time[left]
        share = np.clip((source_time - self.time[left]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)[:, None]
        result: np.ndarray = (1.0 - share) * self.signal[left] + share * self.signal[right]
        keep = max(0, int(np.searchsorted(self.time, time[-1] - self.delay, side="right")) - 1)
        self.time, self.signal = self.time[keep:], self.signal[keep:]
        return result
