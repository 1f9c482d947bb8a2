# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects in other formulas than the library's, one or two for each name; `strength` of 1 is strong, near 0 nothing.

Forms come from the literature of the effect where it has another one; a comment names it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .world import COLUMNS, RATE, ROWS, Hidden, N, Pad, Signals, faded

Maker = Callable[[np.random.Generator, float], Hidden]


def by_name(*makers: Maker) -> dict[str, Maker]:
    """Return makers by the names of the effects, which are those of the functions."""
    return {maker.__name__.replace("_", "-"): maker for maker in makers}


def _elastic(change: Callable[[Signals, Pad], np.ndarray]) -> Callable[[Signals, Pad], np.ndarray]:
    """An effect that multiplies the normal force by what `change` returns."""
    return lambda s, pad: np.maximum(s.force * change(s, pad), 0.0)


def stiffening(rng, strength) -> Hidden:
    """sinh law of soft tissue (Demiray): f = k L sinh(d / L)."""
    length = 4e-3 / max(strength, 1e-6) ** 0.5

    def factor(s, pad):
        x = np.maximum(s.depth, 1e-9) / length
        return np.sinh(np.minimum(x, 20)) / x

    return Hidden("stiffening", "sinh", force=_elastic(factor))


def softening(rng, strength) -> Hidden:
    """Mullins as a Weibull damage in the deepest penetration so far that acts only below it (after Ogden and Roxburgh)."""
    deep = rng.uniform(1.5e-3, 3e-3)

    def factor(s, pad):
        most = np.maximum.accumulate(s.depth, axis=0)
        below = np.clip(1.0 - s.depth / np.maximum(most, 1e-9), 0, 1)
        return 1.0 - 0.9 * min(strength, 1.0) * (1 - np.exp(-((most / deep) ** 1.5))) * np.tanh(3 * below) ** 0.5

    return Hidden("softening", "weibull", force=_elastic(factor))


def hysteresis(rng, strength) -> Hidden:
    """Preisach: a crowd of relays in each transducer, each on above one load and off below a smaller one.

    Relays in the force would generate energy in every press, so the net force is unchanged.
    """
    count, deep = 160, 3.2e-3
    off = rng.uniform(0, 1, count)
    on = off + rng.uniform(0.1, 0.3) * rng.uniform(0, 1, count)
    share = min(0.5 * strength, 0.9)

    def act(s, pad):
        state, top = np.zeros((s.depth.shape[1], count), bool), pad.gain * pad.k * deep
        for t, reading in enumerate(s.reading):
            load = (reading[:, None] - pad.zero) / top
            state = (state & (load > off)) | (load > on)
            s.reading[t] = (1 - share) * reading + share * (pad.zero + top * state.mean(axis=1))
        return s.reading

    return Hidden("hysteresis", "crowd of relays", reading=act)


def creep(rng, strength) -> Hidden:
    """Stress relaxation by Kohlrausch's stretched exponential in each texel's depth history."""
    tau, beta = np.exp(rng.uniform(np.log(0.8), np.log(4.0))), rng.uniform(0.45, 0.7)

    def act(s, pad):
        memory = 0.7 * min(strength, 1.2) * (1 - np.exp(-(((s.time - s.time[0]) / tau) ** beta)))
        return np.where(s.depth > 0, np.maximum(s.force - faded(pad.k * s.depth, memory), 0.0), 0.0)

    return Hidden("creep", "stretched", force=act)


def adhesion(rng, strength) -> Hidden:
    """A cohesive zone (Dugdale, rounded): on the way out a texel pulls, most where the depth goes to zero."""
    width = rng.uniform(0.3e-3, 0.8e-3)

    def act(s, pad):
        touched = np.maximum.accumulate(s.depth, axis=0) > 0.3e-3
        leaving = touched & (s.contact.pace < 0) & (s.depth > 0)
        pull = strength * pad.k * 1.2e-3 * np.exp(-((s.depth / width) ** 2)) * (1 - np.exp(-s.depth / (0.1 * width)))
        return s.force - np.where(leaving, pull, 0.0)

    return Hidden("adhesion", "rounded Dugdale", force=act)


def wear(rng, strength) -> Hidden:
    """Stiffness lost with the work of pressing and sliding, by a rational law."""

    def factor(s, pad):
        speed = np.linalg.norm(s.contact.velocity, axis=1)[:, None]
        work = np.cumsum(s.force * speed, axis=0) * s.dt  # J
        return 1.0 / (1.0 + 1.5 * strength * work / (pad.k * 3e-3 * 0.03))

    return Hidden("wear", "rational", force=_elastic(factor))


def _neighbours(values: np.ndarray) -> np.ndarray:
    """(T, n) sum over the four direct neighbours of each texel; at the rim the texel itself stands in."""
    grid = values.reshape(len(values), ROWS, COLUMNS)
    padded = np.pad(grid, ((0, 0), (1, 1), (1, 1)), mode="edge")
    total = padded[:, :-2, 1:-1] + padded[:, 2:, 1:-1] + padded[:, 1:-1, :-2] + padded[:, 1:-1, 2:]
    return total.reshape(values.shape)


def load_spreading(rng, strength) -> Hidden:
    """A cover in bending: a few rounds of diffusion between neighbours, which keeps the sum.

    It spreads what the texels under it carry; the probe touches its outer face, whose friction and net force stay.
    """

    def act(s, pad):
        share, carried = min(0.2 * strength, 0.22), s.reading - pad.zero
        for _ in range(4):
            carried = carried + share * (_neighbours(carried) - 4 * carried)
        return pad.zero + carried

    return Hidden("load-spreading", "diffusion", reading=act)


def crosstalk(rng, strength) -> Hidden:
    """Traces side by side in a ribbon: each row and column couples into the others, the less the farther they are apart."""
    fade = rng.uniform(1.0, 2.0)

    def act(s, pad):
        signal = (s.reading - pad.zero).reshape(-1, ROWS, COLUMNS)
        for axis, count in ((1, ROWS), (2, COLUMNS)):
            apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
            couple = np.where(apart == 0, 1.0, 0.15 * strength * np.exp(-(apart - 1) / fade))
            signal = np.moveaxis(np.tensordot(signal, couple, (axis, 0)), -1, axis)
        return pad.zero + signal.reshape(s.reading.shape)

    return Hidden("crosstalk", "ribbon", reading=act)


def gain_mismatch(rng, strength) -> Hidden:
    """Log-normal gains on top of a slope across the pad, of texels that are each bent a little as well."""
    y, x = np.mgrid[-1 : 1 : ROWS * 1j, -1 : 1 : COLUMNS * 1j]
    tilt = rng.normal(size=2)
    gain = np.exp(strength * (0.35 * rng.normal(size=N) + 0.2 * (tilt[0] * x + tilt[1] * y).ravel()))
    bend = 0.15 * strength * rng.normal(size=N)

    def act(s, pad):
        x = (s.reading - pad.zero) / (pad.gain * pad.k * 3e-3)
        return s.reading + pad.gain * pad.k * 3e-3 * x * (gain / gain.mean() * (1 + bend * np.clip(x, -1.5, 1.5)) - 1)

    return Hidden("gain-mismatch", "lognormal and bent", reading=act)


def dead_texels(rng, strength) -> Hidden:
    """Texels with a broken joint: stuck at the value without load or at another one, or all but deaf."""
    middle = [r * COLUMNS + c for r in range(3, 11) for c in range(1, 5)]
    dead = rng.choice(middle, size=max(1, round(5 * min(strength, 1.6))), replace=False)
    level, deaf = rng.choice([0.0, 0.0, 1.0], size=len(dead)), rng.choice([0.0, 0.0, 0.05], size=len(dead))

    def act(s, pad):
        stuck = pad.gain * pad.k * 3e-3 * 0.2 * level
        s.reading[:, dead] = pad.zero + stuck + deaf * (s.reading[:, dead] - pad.zero)
        return s.reading

    return Hidden("dead-texels", "broken", reading=act)


def dead_zone(rng, strength) -> Hidden:
    """Nothing up to a force, then a quadratic onset that runs into the line."""

    def act(s, pad):
        start = pad.k * 1.5e-3 * strength
        x = np.maximum(s.reading - pad.zero, 0) / pad.gain
        onset = np.maximum(x - 0.5 * start, 0.0)
        return pad.zero + pad.gain * np.where(onset < start, onset**2 / (2 * start), onset - start / 2)

    return Hidden("dead-zone", "quadratic", reading=act)


def saturation(rng, strength) -> Hidden:
    """A voltage divider (Tekscan-like) put through an arctangent."""

    def act(s, pad):
        top = pad.k * 4e-3 / strength
        x = (s.reading - pad.zero) / pad.gain
        return pad.zero + pad.gain * top * 2 / np.pi * np.arctan(np.pi / 2 * x / top)

    return Hidden("saturation", "arctan", reading=act)


def lag(rng, strength) -> Hidden:
    """A dead time and a low pass behind it, as of a filtered converter that is asked over a bus."""
    tau, dead = 0.15 * strength, 0.15 * strength * rng.uniform(0.3, 1.0)

    def act(s, pad):
        keep = np.exp(-s.dt / max(tau, 1e-6))
        late = np.stack([np.interp(s.time - dead, s.time, channel) for channel in s.reading.T], axis=1)
        state = late[0].copy()
        for t in range(len(s.time)):
            state = keep * state + (1 - keep) * late[t]
            s.reading[t] = state
        return s.reading

    return Hidden("lag", "dead time and low pass", reading=act)


def drift(rng, strength) -> Hidden:
    """The zero wanders with a power of the time, a little differently in each texel."""
    power, spread = rng.uniform(0.6, 1.5), 1 + 0.2 * rng.normal(size=N)

    def act(s, pad):
        return s.reading + pad.gain * pad.k * 3e-3 * 0.2 * strength * ((s.time[:, None] - s.time[0]) / 25.0) ** power * spread

    return Hidden("drift", "power", reading=act)


def offset(rng, strength) -> Hidden:
    """A cover that is stretched over the texels presses on each of them, by row and by texel, until the load takes over."""
    preload = np.abs(np.repeat(rng.normal(size=ROWS), COLUMNS) + 0.5 * rng.normal(size=N))

    def act(s, pad):
        rest = 0.2 * strength * pad.k * 3e-3 * preload
        load = np.maximum(s.reading - pad.zero, 0.0) / pad.gain
        return s.reading + pad.gain * rest / (1.0 + load / (pad.k * 3e-3))

    return Hidden("offset", "preload", reading=act)


def quantization(rng, strength) -> Hidden:
    """A converter behind a square root: steps that grow with the reading, and cut off instead of rounding."""

    def act(reading, pad):
        step, full = 0.15 * strength, pad.gain * pad.k * 3e-3
        x = (reading - pad.zero) / full
        root = np.sign(x) * np.sqrt(np.abs(x))
        return pad.zero + full * np.sign(root) * (step * np.floor(np.abs(root) / step)) ** 2

    return Hidden("quantization", "square root", convert=act)


def noise(rng, strength) -> Hidden:
    """Noise that grows with the load, heavier in its tails than a bell curve."""

    def act(s, pad):
        shake = rng.standard_t(5, size=s.reading.shape)
        return s.reading + strength * 0.25 * np.abs(s.reading - pad.zero) * shake

    return Hidden("noise", "of the load", reading=act)


def misalignment(rng, strength) -> Hidden:
    """The pad was glued on shifted and stretched."""
    shift, stretch = rng.normal(size=2), 1.0 + 0.04 * strength * rng.uniform(0.3, 1.0) * rng.choice([-1, 1])
    shift = 3e-3 * strength * shift / np.linalg.norm(shift)
    return Hidden("misalignment", "shift and stretch", place=lambda places: stretch * places + shift)


def stribeck(rng, strength) -> Hidden:
    """Friction weakens with the logarithm of the speed (rate-and-state friction at steady state)."""
    slow = 2e-3

    def law(speed, fn, pad):
        return np.maximum(1.0 - 0.18 * strength * np.log1p(speed / slow), 0.2), np.zeros_like(speed)

    return Hidden("stribeck", "logarithmic", friction=law)


def viscous_friction(rng, strength) -> Hidden:
    """A lubricating film: drag with a power of the speed below one."""

    def law(speed, fn, pad):
        drag = strength * 0.6 * np.maximum(fn, 0.0) * (np.maximum(speed, 1e-6) / 0.02) ** 0.6
        return np.ones_like(speed), drag / np.maximum(speed, 1e-6)

    return Hidden("viscous-friction", "film", friction=law)


MAKERS = by_name(
    stiffening, softening, hysteresis, creep, adhesion, wear, load_spreading, crosstalk, gain_mismatch, dead_texels, dead_zone,
    saturation, lag, drift, offset, quantization, noise, misalignment, stribeck, viscous_friction,
)  # fmt: skip


# --- what is in nobody's library


def hum(rng, strength) -> Hidden:
    """Mains hum that the sampling folds down to a few hertz."""
    pitch, phase = rng.uniform(2.5, 0.4 * RATE), rng.uniform(0, 6, size=N)

    def act(s, pad):
        return s.reading + pad.gain * pad.k * 3e-3 * 0.2 * strength * np.sin(2 * np.pi * pitch * s.time[:, None] + phase)

    return Hidden("hum", "sine", reading=act)


def temperature_swing(rng, strength) -> Hidden:
    """A swing of a temperature that nobody records takes gain and zero with it."""
    period, phase = rng.uniform(6, 14), rng.uniform(0, 6)

    def act(s, pad):
        swing = np.sin(2 * np.pi * s.time[:, None] / period + phase)
        return (
            pad.zero + (s.reading - pad.zero) * (1 + 0.35 * strength * swing) + pad.gain * pad.k * 3e-3 * 0.1 * strength * swing
        )

    return Hidden("temperature-swing", "sine", reading=act)


def jitter(rng, strength) -> Hidden:
    """The time stamps wander: what was read belongs to another moment."""

    def act(s, pad):
        wander = np.cumsum(rng.normal(size=len(s.time)))
        wander = 0.25 * strength * (wander - wander.mean()) / max(float(np.abs(wander - wander.mean()).max()), 1e-9)
        for i in range(s.reading.shape[1]):
            s.reading[:, i] = np.interp(s.time + wander, s.time, s.reading[:, i])
        return s.reading

    return Hidden("jitter", "wandering clock", reading=act)


OUTSIDE = by_name(hum, temperature_swing, jitter)
