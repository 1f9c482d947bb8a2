# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor's effects at work: depths → forces → readings, at once or sample by sample, with equal results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...model.effect import Effect, Values
from .compiled_program import (
    COLUMNS,
    DAMPING,
    FACTOR,
    FORCE,
    SLOPE,
    SPEED,
    VISCOUS,
    apply_friction,
    apply_laws,
    compile_program,
    law_over_time,
    press,
)
from .mixing import Mixing
from .registry import complete_values, in_order
from .specification import Form, Site

if TYPE_CHECKING:
    from ...model.sensor import Sensor
    from ...model.sensor_parameters import SensorParameters


def site_of(sensor: Sensor) -> Site:
    """Return where the effects of a scenario's sensor sit."""
    texels, parameters = sensor.texels, sensor.parameters
    row, column = getattr(texels.layout, "row", None), getattr(texels.layout, "column", None)
    painted = 1.0 if sensor.painted.gain is None else sensor.painted.gain
    return Site(texels.position, texels.area, row, column, parameters.gain, parameters.zero, painted, sensor.name)


def forces(
    effects: Sequence[Effect],
    parameters: SensorParameters,
    time: np.ndarray,
    depth: np.ndarray,
    slide: np.ndarray | None = None,
    rate: np.ndarray | None = None,
    stiffness: ArrayLike = 1.0,
) -> np.ndarray:
    """Normal forces that a sensor's effects make of a known motion, (t, n) float, N.

    Parameters
    ----------
    effects : sequence of Effect
        Those on readings are left out.
    parameters : SensorParameters
    time : (t,) float, s, increasing
        At the first sample nothing has happened yet: no force was there before it.
    depth : (t, n) float, m
        Zero or less where nothing touches.
    slide : (t, n) float, m, optional
        Distance slid since the sample before.
    rate : (t, n) float, m/s, optional
        Of the depth; without it the change since the sample before.
    stiffness : float or (n,) float
        Multiplies k and cn of each texel, as where it is painted.
    """
    time, depth = np.asarray(time, float), np.ascontiguousarray(depth, dtype=float)
    if rate is None:
        rate = np.zeros_like(depth)
        rate[1:] = np.diff(depth, axis=0) / np.diff(time)[:, None]
    lengths, step = _steps(time)
    inside = np.maximum(depth, 0.0)
    linear = parameters.normal_law == "linear"
    force = parameters.k * (inside if linear else inside**parameters.exponent)
    damping = parameters.cn * rate if linear else 1.5 * parameters.dissipation * rate
    clipped = False
    for item, form in in_order(effects, readout=False):
        if form.law is None or form.constants is None:
            continue
        if form.after_clip and not clipped:
            force, clipped = _cut_off(force, inside, damping, linear), True
        memory = np.zeros((depth.shape[1], form.memory))
        force = law_over_time(form, force, step, form.constants(complete_values(item), lengths), memory, inside, slide)
    return force if clipped else _cut_off(force, inside, damping, linear)


def _cut_off(elastic: np.ndarray, depth: np.ndarray, damping: np.ndarray, linear: bool) -> np.ndarray:
    """Elastic force and damping together never pull (Eq. 8, or Hunt and Crossley's law)."""
    total = elastic + damping if linear else elastic * (1.0 + damping)
    return np.where(depth > 0.0, np.maximum(total, 0.0), 0.0)


def friction(effects: Sequence[Effect], speed: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How a sensor's effects change sliding: factor on the friction coefficient, and N·s/m to add to `ct`.

    Parameters
    ----------
    effects : sequence of Effect
    speed, force : (...) float, m/s and N
    """
    speed, force = np.broadcast_arrays(np.asarray(speed, float), np.asarray(force, float))
    program, n = compile_program([effects], 0.0), speed.size
    work = np.zeros((COLUMNS, n))
    work[SPEED], work[FORCE] = speed.ravel(), force.ravel()
    apply_friction(0, work.reshape(1, -1), 0, n, 0, n, np.arange(n), program, program.memory(n))
    return work[FACTOR].reshape(speed.shape), work[VISCOUS].reshape(speed.shape)


class Pad:
    """Normal forces sample by sample, as the solver asks for them: any number of guesses, then the step itself.

    Parameters
    ----------
    effects : sequence of Effect
        Those on readings are left out.
    parameters : SensorParameters
    dt : (m,) float, s
        Lengths of step that will occur.
    points : int
    """

    def __init__(self, effects: Sequence[Effect], parameters: SensorParameters, dt: ArrayLike, points: int):
        self.parameters = parameters
        self.program = compile_program([effects], dt)
        self.memory = self.program.memory(points)
        self._work = np.zeros((COLUMNS, points))
        self._every = np.arange(points)

    def step(
        self, length: int, depth: np.ndarray, rate: np.ndarray, slide: np.ndarray | None = None, commit: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the forces at the step's end (N), and their derivatives by depth (N/m) and by rate (N·s/m), each (n,) float.

        Parameters
        ----------
        length : int
            Which of the lengths of step.
        depth, rate, slide : (n,) float, m, m/s, m
            At the step's end, during it, and in it.
        commit : bool
            The step is done; without it one only asks.
        """
        p, n = self.parameters, len(depth)
        slide = np.zeros(n) if slide is None else slide
        linear = p.normal_law == "linear"
        work = self._work.reshape(1, -1)
        for i in range(n):
            press(work, 0, n, i, depth[i], rate[i], slide[i], 0.0, p.k, p.cn, 0.0 if linear else p.exponent, p.dissipation)
        apply_laws(0, length, work, 0, n, 0, n, self._every, 0, 0, linear, self.program, self.memory, commit)
        return self._work[FORCE].copy(), self._work[SLOPE].copy(), self._work[DAMPING].copy()


def readings(effects: Iterable[Effect], site: Site, time: np.ndarray, force: np.ndarray) -> np.ndarray:
    """What a sensor reports under known forces, (t, n) float in its unit.

    Parameters
    ----------
    effects : iterable of Effect
        Those on forces are left out.
    site : Site
    time : (t,) float, s, increasing
    force : (t, n) float, N
    """
    return Reader(effects, site).read(np.asarray(time, float), np.asarray(force, float))


class Reader:
    """Turns forces into readings, a stretch of samples at a time; the pieces add up to what the whole would give.

    Parameters
    ----------
    effects : iterable of Effect
        Those on forces are left out.
    site : Site
    """

    def __init__(self, effects: Iterable[Effect], site: Site):
        self.site = site
        self._stages: list[_Pointwise | _Mix | _Filter | _Delay | _Conversion] = []
        converted = False
        for item, form in in_order(effects, readout=True):
            if form.after_conversion and not converted:
                self._stages.append(_Conversion(site))
                converted = True
            values = complete_values(item, site.gain)
            if form.law is not None:
                self._stages.append(_Filter(form, values))
            elif form.mix is not None:
                self._stages.append(_Mix(form.mix(values, site)))
            elif form.delay is not None:
                self._stages.append(_Delay(form.delay(values)))
            else:
                self._stages.append(_Pointwise(form, values, site, item.seed))
        if not converted:
            self._stages.append(_Conversion(site))

    @classmethod
    def of(cls, sensor: Sensor) -> Reader:
        """Return the reader of a scenario's sensor."""
        return cls(sensor.effects, site_of(sensor))

    def read(self, time: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the readings (t, n) of the next samples: `time` (t,) s, increasing, and `force` (t, n) N.

        A first sample at the time of the last one asks for that one once more.
        """
        signal = force
        for stage in self._stages:
            signal = stage.run(time, signal)
        return signal

    def step(self, time: float, force: np.ndarray) -> np.ndarray:
        """Return the readings (n,) of the next sample."""
        return self.read(np.array([time]), force[None, :])[0]


class _Conversion:
    """Newtons to the sensor's unit (paper, section 4)."""

    def __init__(self, site: Site):
        self.site = site

    def run(self, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
        return self.site.zero + self.site.gain * self.site.painted * signal


class _Pointwise:
    """A formula that needs no past."""

    def __init__(self, form: Form, values: Values, site: Site, seed: int):
        self.form, self.values, self.site, self.seed = form, values, site, seed

    def run(self, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
        assert self.form.shape is not None
        return self.form.shape(signal, time, self.values, self.site, self.seed)


class _Mix:
    """A linear mix of texels."""

    def __init__(self, weights: Mixing):
        self.weights = weights

    def run(self, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
        return self.weights.apply(signal)


class _Filter:
    """A law with memory."""

    def __init__(self, form: Form, values: Values):
        self.form, self.values = form, values
        self.memory: np.ndarray | None = None
        self.last: float | None = None

    def run(self, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
        assert self.form.constants is not None
        if self.memory is None:
            self.memory = np.zeros((signal.shape[1], self.form.memory))
        lengths, step = _steps(time, self.last)
        self.last = float(time[-1])
        return law_over_time(self.form, signal, step, self.form.constants(self.values, lengths), self.memory)


class _Delay:
    """The signal as it was some time ago, linear between samples; before the first sample it was as at the first."""

    def __init__(self, delay: float):
        self.delay = delay
        self.time = np.zeros(0)
        self.signal: np.ndarray | None = None

    def run(self, time: np.ndarray, signal: np.ndarray) -> np.ndarray:
        if self.signal is None:
            self.time, self.signal = time, signal
        else:
            fresh = time > self.time[-1]
            self.time = np.concatenate([self.time, time[fresh]])
            self.signal = np.concatenate([self.signal, signal[fresh]])
        wanted = time - self.delay
        right = np.clip(np.searchsorted(self.time, wanted, side="left"), 1, max(len(self.time) - 1, 1))
        left = right - 1
        right = np.minimum(right, len(self.time) - 1)
        gap = self.time[right] - self.time[left]
        share = np.clip((wanted - self.time[left]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)[:, None]
        result: np.ndarray = (1.0 - share) * self.signal[left] + share * self.signal[right]
        keep = max(0, int(np.searchsorted(self.time, time[-1] - self.delay, side="right")) - 1)
        self.time, self.signal = self.time[keep:], self.signal[keep:]
        return result


def _steps(time: np.ndarray, before: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of step that occur (m,), and which of them leads to each sample (t,); to the very first one leads none.

    Lengths that differ by rounding of the time stamps only are the same.
    """
    start = time[0] if before is None else before
    lengths = np.diff(time, prepend=start)
    rounding = 1e-9 * max(abs(float(time[-1])), abs(float(start)), 1e-9)
    whole = np.round(lengths / rounding) if rounding > 0.0 else lengths
    _, first, step = np.unique(whole, return_index=True, return_inverse=True)
    return lengths[first], step.ravel()
