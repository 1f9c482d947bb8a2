# SPDX-License-Identifier: GPL-3.0-or-later
"""A flat pad of texels, an indenter on a path, and what the texels feel: closed forms, in plain numpy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

ROWS, COLUMNS, PITCH = 14, 6, 3.4e-3
THICKNESS = 6e-3
RATE = 50.0
"""Samples per second."""
SECONDS = 25.0
FINE = 4
"""Steps of the friction between two samples."""


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


@dataclass
class Signals:
    """What happens in one trial: T samples of n texels. Hidden effects change it in place, stage by stage."""

    time: np.ndarray
    path: np.ndarray  # (T, 3) m, the probe's middle
    depth: np.ndarray  # (T, n) m
    normal: np.ndarray  # (T, n, 3) the probe's outward normal where it touches
    pace: np.ndarray  # (T, n) m/s, depth rate along the normal
    force: np.ndarray  # (T, n) N, elastic and damped
    shear: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (T, n, 3) N
    reading: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (T, n) in the sensor's unit

    @property
    def dt(self) -> float:
        return float(self.time[1] - self.time[0])


@dataclass(frozen=True)
class Hidden:
    """One hidden effect, cut into the stages at which it can act; each is a function of the signals, or None.

    `place` moves the path that the texels really meet, `force` changes normal forces, `friction` is a factor on the friction
    coefficient and an extra viscous coefficient as functions of speed and normal force, `reading` changes readings.
    """

    name: str
    form: str
    strength: float
    place: Callable[[np.ndarray], np.ndarray] | None = None
    force: Callable[[Signals, Pad], None] | None = None
    friction: Callable[[np.ndarray, np.ndarray, Pad], tuple[np.ndarray, np.ndarray]] | None = None
    reading: Callable[[Signals, Pad], None] | None = None
    values: dict = field(default_factory=dict)


def touch(probe: Probe, pad: Pad, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depth along the probe's normal (T, n) and that normal (T, n, 3) under a probe whose middle follows `path`."""
    x, y = pad.place.T
    normal = np.zeros((len(path), len(x), 3))
    if probe.radius is None:
        inside = (np.abs(x - path[:, :1]) <= probe.size[0] / 2) & (np.abs(y - path[:, 1:2]) <= probe.size[1] / 2)
        sunk = probe.lowest - path[:, 2:]
        normal[..., 2] = -1.0
        return np.where(inside & (sunk > 0), sunk, 0.0), normal
    dx, dy = x - path[:, :1], y - path[:, 1:2]
    left = probe.radius**2 - dx**2 - dy**2
    high = np.sqrt(np.maximum(left, 0.0))  # of the ball's middle above the point where it meets the texel's line
    sunk = high - path[:, 2:]
    normal[..., 0], normal[..., 1], normal[..., 2] = dx / probe.radius, dy / probe.radius, -high / probe.radius
    return np.where((left > 0) & (sunk > 0), sunk * high / probe.radius, 0.0), normal


def respond(
    probe: Probe, pad: Pad, time: np.ndarray, path: np.ndarray, hidden: tuple[Hidden, ...] = (), slides: bool = True
) -> Signals:
    """Run one trial with everything that is hidden in it, without noise; friction, the slowest part, only if it `slides`."""
    for effect in hidden:
        if effect.place is not None:
            path = effect.place(path)
    depth, normal = touch(probe, pad, path)
    velocity = np.gradient(path, time, axis=0)
    pace = np.where(depth > 0, np.einsum("ti,tni->tn", velocity, normal), 0.0)
    force = np.where(depth > 0, np.maximum(pad.k * depth + pad.cn * pace, 0.0), 0.0)
    signals = Signals(time, path, depth, normal, pace, force)
    for effect in hidden:
        if effect.force is not None:
            effect.force(signals, pad)
    signals.shear = _friction(signals, pad, velocity, hidden) if slides else np.zeros_like(normal)
    signals.reading = pad.zero + pad.gain * signals.force
    for effect in hidden:
        if effect.reading is not None:
            effect.reading(signals, pad)
    return signals


def net_force(signals: Signals) -> np.ndarray:
    """(T, 3) N: what the probe does to the sensor, normal and friction together."""
    return (signals.force[..., None] * signals.normal + signals.shear).sum(axis=1)


def _friction(signals: Signals, pad: Pad, velocity: np.ndarray, hidden: tuple[Hidden, ...]) -> np.ndarray:
    """LuGre per texel (Canudas de Wit 1995): dz/dt = v - sigma0 |v| z / g, exact for constant v between fine steps."""
    sliding = velocity[:, None, :] - signals.normal * np.einsum("ti,tni->tn", velocity, signals.normal)[..., None]
    shear = np.zeros_like(signals.normal)
    z = np.zeros(signals.normal.shape[1:])
    step = signals.dt / FINE
    for t in range(len(signals.time)):
        fn = np.maximum(signals.force[t], 0.0)
        held = fn > 0
        v = sliding[t]
        speed = np.linalg.norm(v, axis=1)
        mu = pad.mud + (pad.mus - pad.mud) * np.exp(-((speed / pad.x0) ** 2))
        extra = np.zeros_like(speed)
        for effect in hidden:
            if effect.friction is not None:
                factor, more = effect.friction(speed, fn, pad)
                mu, extra = mu * factor, extra + more
        g = np.maximum(fn * mu, 1e-12)
        fade = pad.sigma0 * speed / g
        with np.errstate(divide="ignore", invalid="ignore"):
            keep = np.exp(-fade * step)
            gain = np.where(fade * step > 1e-9, (1 - keep) / np.where(fade > 0, fade, 1.0), step)
        if t > 0:
            for _ in range(FINE):
                z = z * keep[:, None] + gain[:, None] * v
        z = np.where(held[:, None], z, 0.0)
        z -= np.einsum("ni,ni->n", z, signals.normal[t])[:, None] * signals.normal[t]
        reach = np.linalg.norm(z, axis=1)
        most = pad.mus * fn / pad.sigma0
        z *= np.where(reach > most, most / np.maximum(reach, 1e-30), 1.0)[:, None]
        rate = v - fade[:, None] * z
        force = pad.sigma0 * z + pad.sigma1 * rate + (pad.ct + extra)[:, None] * v
        shear[t] = np.where(held[:, None], force, 0.0)
    return shear
