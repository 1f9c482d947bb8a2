# SPDX-License-Identifier: GPL-3.0-or-later
"""A flat pad of texels, an indenter on a path, and what the texels feel: closed forms, in plain numpy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

ROWS, COLUMNS, PITCH = 14, 6, 3.4e-3
N = ROWS * COLUMNS
DEEP = 3e-3
"""Metres: the depth to which pads are about pressed; effects take forces and readings in units of those at this depth."""
THICKNESS = 6e-3
RATE = 50.0
"""Samples per second."""
SECONDS = 25.0


@dataclass(frozen=True)
class Pad:
    """The sensor's base model; every number is the true one."""

    k: float
    cn: float
    mus: float
    mud: float
    x0: float
    sigma0: float
    sigma1: float
    ct: float
    gain: float
    zero: float
    unit: str

    @property
    def place(self) -> np.ndarray:
        """(84, 2) metres: x and y of each texel, row by row."""
        y, x = np.mgrid[0:ROWS, 0:COLUMNS] * PITCH
        return np.stack([x.ravel() - x.mean(), y.ravel() - y.mean()], axis=1)


@dataclass(frozen=True)
class Probe:
    """A ball of a radius, or a box of full sizes that is larger than the pad."""

    radius: float | None
    size: tuple[float, float, float] | None

    @property
    def lowest(self) -> float:
        """Metres from its middle to its lowest point."""
        return self.radius if self.radius is not None else self.size[2] / 2


@dataclass(frozen=True)
class Contact:
    """Where the probe meets the texels during a trial: T samples of n texels; no force has a say in it."""

    time: np.ndarray
    path: np.ndarray  # (T, 3) m, the probe's middle
    velocity: np.ndarray  # (T, 3) m/s, of the probe
    depth: np.ndarray  # (T, n) m
    normal: np.ndarray  # (T, n, 3) the probe's outward normal where it touches
    pace: np.ndarray  # (T, n) m/s, depth rate along the normal
    sliding: np.ndarray  # (T, n, 3) m/s, of the probe along its surface


@dataclass
class Signals:
    """What happens in one trial. Hidden effects give other values of `force` and `reading`, stage by stage."""

    contact: Contact
    force: np.ndarray  # (T, n) N, at first elastic alone, then elastic and damped
    shear: np.ndarray  # (T, n, 3) N
    reading: np.ndarray  # (T, n) in the sensor's unit

    @property
    def time(self) -> np.ndarray:
        return self.contact.time

    @property
    def depth(self) -> np.ndarray:
        return self.contact.depth

    @property
    def dt(self) -> float:
        return float(self.time[1] - self.time[0])


@dataclass(frozen=True)
class Hidden:
    """One hidden effect, cut into the stages at which it can act; each is a function, or None.

    `place` moves the texels' (n, 2) places, `elastic` returns other forces before they are damped and cut off at zero, `force`
    behind that, `friction` is a factor on the friction coefficient and an extra viscous coefficient as functions of speed and
    normal force, `reading` returns other readings, `convert` does so behind the noise. `values` are the true numbers of a form
    that the library has, by its names; `/ k` and `/ k gain` stand for a number that goes with the pad.
    """

    name: str
    form: str
    place: Callable[[np.ndarray], np.ndarray] | None = None
    elastic: Callable[[Signals, Pad], np.ndarray] | None = None
    force: Callable[[Signals, Pad], np.ndarray] | None = None
    friction: Callable[[np.ndarray, np.ndarray, Pad], tuple[np.ndarray, np.ndarray]] | None = None
    reading: Callable[[Signals, Pad], np.ndarray] | None = None
    convert: Callable[[np.ndarray, Pad], np.ndarray] | None = None
    values: dict = field(default_factory=dict)


def touch(probe: Probe, pad: Pad, time: np.ndarray, path: np.ndarray, hidden: tuple[Hidden, ...] = ()) -> Contact:
    """Return what the texels meet under a probe whose middle follows `path` (T, 3), m."""
    places = pad.place
    for effect in hidden:
        if effect.place is not None:
            places = effect.place(places)
    x, y = places.T
    normal = np.zeros((len(path), len(x), 3))
    if probe.radius is None:
        inside = (np.abs(x - path[:, :1]) <= probe.size[0] / 2) & (np.abs(y - path[:, 1:2]) <= probe.size[1] / 2)
        sunk = probe.lowest - path[:, 2:]
        normal[..., 2] = -1.0
        depth = np.where(inside & (sunk > 0), sunk, 0.0)
    else:
        dx, dy = x - path[:, :1], y - path[:, 1:2]
        left = probe.radius**2 - dx**2 - dy**2
        high = np.sqrt(np.maximum(left, 0.0))  # of the ball's middle above the point where it meets the texel's line
        sunk = high - path[:, 2:]
        normal[..., 0], normal[..., 1], normal[..., 2] = dx / probe.radius, dy / probe.radius, -high / probe.radius
        depth = np.where((left > 0) & (sunk > 0), sunk * high / probe.radius, 0.0)
    velocity = np.gradient(path, time, axis=0)
    along = np.einsum("ti,tni->tn", velocity, normal)
    sliding = velocity[:, None, :] - normal * along[..., None]
    return Contact(time, path, velocity, depth, normal, np.where(depth > 0, along, 0.0), sliding)


def respond(contact: Contact, pad: Pad, hidden: tuple[Hidden, ...] = (), slides: bool = True) -> Signals:
    """Run one trial with everything that is hidden in it, without noise; friction, the slowest part, only if it `slides`.

    Effects that move texels have done so in `contact` already.
    """
    nothing = np.zeros_like(contact.normal)
    signals = Signals(contact, pad.k * contact.depth, nothing, np.zeros(0))
    for effect in hidden:
        if effect.elastic is not None:
            signals.force = effect.elastic(signals, pad)
    signals.force = np.where(contact.depth > 0, np.maximum(signals.force + pad.cn * contact.pace, 0.0), 0.0)
    for effect in hidden:
        if effect.force is not None:
            signals.force = effect.force(signals, pad)
    if slides:
        signals.shear = _friction(signals, pad, hidden)
    signals.reading = pad.zero + pad.gain * signals.force
    for effect in hidden:
        if effect.reading is not None:
            signals.reading = effect.reading(signals, pad)
    return signals


def converted(reading: np.ndarray, pad: Pad, hidden: tuple[Hidden, ...]) -> np.ndarray:
    """Return readings behind the converter, whose noise they have already."""
    for effect in hidden:
        if effect.convert is not None:
            reading = effect.convert(reading, pad)
    return reading


def net_force(signals: Signals) -> np.ndarray:
    """(T, 3) N: what the probe does to the sensor, normal and friction together."""
    return (signals.force[..., None] * signals.contact.normal + signals.shear).sum(axis=1)


def faded(force: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """Return (T, n) what is lost of a force whose steps each fade with the time, by shares (T,) of the step."""
    steps, n = np.diff(force, axis=0, prepend=0.0), 2 * len(memory)
    lost = np.fft.irfft(np.fft.rfft(steps, n, axis=0) * np.fft.rfft(memory, n)[:, None], n, axis=0)
    return lost[: len(memory)]


def _friction(signals: Signals, pad: Pad, hidden: tuple[Hidden, ...]) -> np.ndarray:
    """LuGre per texel (Canudas de Wit 1995): dz/dt = v - sigma0 |v| z / g.

    Exact for a velocity and a load that stay over a step, for which it takes the means of its ends: steps have to be short.
    """
    v, normal, fn = signals.contact.sliding, signals.contact.normal, np.maximum(signals.force, 0.0)
    most, keep, gain, between = _bristles(pad, hidden, fn, v, signals.dt)
    fade, extra = _fading(pad, hidden, fn, np.linalg.norm(v, axis=2))
    step = gain[..., None] * between
    z, states = np.zeros(v.shape[1:]), np.zeros_like(v)
    for t in range(1, len(v)):
        (held,) = np.nonzero(fn[t] > 0)
        now, n = z[held] * keep[t, held, None] + step[t, held], normal[t, held]
        now -= (now * n).sum(axis=1)[:, None] * n
        reach = np.sqrt((now * now).sum(axis=1))
        now *= np.minimum(1.0, most[t, held] / np.maximum(reach, 1e-30))[:, None]
        z = np.zeros_like(z)
        z[held] = now
        states[t] = z
    force = pad.sigma0 * states + pad.sigma1 * (v - fade[..., None] * states) + (pad.ct + extra)[..., None] * v
    return np.where(fn[..., None] > 0, force, 0.0)


def _fading(pad: Pad, hidden: tuple[Hidden, ...], fn: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, n) 1/s: sigma0 |v| / g, at which bristles fade; and N·s/m of drag that effects add."""
    mu = pad.mud + (pad.mus - pad.mud) * np.exp(-((speed / pad.x0) ** 2))
    extra = np.zeros_like(fn)
    for effect in hidden:
        if effect.friction is not None:
            factor, more = effect.friction(speed, fn, pad)
            mu, extra = mu * factor, extra + more
    return pad.sigma0 * speed / np.maximum(fn * mu, 1e-12), extra


def _bristles(pad: Pad, hidden: tuple[Hidden, ...], fn: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, ...]:
    """Largest deflection at each sample, what is kept and gained over the step before it, and its mean velocity."""
    between, load = v.copy(), fn.copy()
    between[1:] = 0.5 * (v[1:] + v[:-1])
    load[1:] = np.where(fn[:-1] > 0, 0.5 * (fn[1:] + fn[:-1]), fn[1:])
    fade, _ = _fading(pad, hidden, load, np.linalg.norm(between, axis=2))
    keep = np.exp(-fade * dt)
    gain = np.where(fade * dt > 1e-9, (1 - keep) / np.where(fade > 0, fade, 1.0), dt)
    most = pad.mus * np.ones_like(fn)
    for effect in hidden:
        if effect.friction is not None:
            most = most * effect.friction(np.zeros_like(fn), fn, pad)[0]
    return most * fn / pad.sigma0, keep, gain, between
