# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects in other formulas than the library's, one or two for each name; `strength` of 1 is strong, near 0 nothing.

Forms come from the literature of the effect where it has another one; a comment names it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .world import COLUMNS, RATE, ROWS, Hidden, Pad, Signals

Maker = Callable[[np.random.Generator, float], Hidden]


def _elastic(change: Callable[[Signals, Pad], np.ndarray]) -> Callable[[Signals, Pad], None]:
    """An effect that multiplies the normal force by what `change` returns."""

    def act(signals: Signals, pad: Pad) -> None:
        signals.force = np.maximum(signals.force * change(signals, pad), 0.0)

    return act


def stiffening(rng, strength) -> Hidden:
    """sinh law of soft tissue (Demiray): f = k L sinh(d / L)."""
    length = 4e-3 / max(strength, 1e-6) ** 0.5

    def factor(s, pad):
        x = np.maximum(s.depth, 1e-9) / length
        return np.sinh(np.minimum(x, 20)) / x

    return Hidden("stiffening", "sinh", strength, force=_elastic(factor), values={"length": length})


def softening(rng, strength) -> Hidden:
    """Mullins as a Weibull damage in the deepest penetration so far that acts only below it (after Ogden and Roxburgh)."""
    deep = rng.uniform(1.5e-3, 3e-3)

    def factor(s, pad):
        most = np.maximum.accumulate(s.depth, axis=0)
        below = np.clip(1.0 - s.depth / np.maximum(most, 1e-9), 0, 1)
        return 1.0 - 0.9 * min(strength, 1.0) * (1 - np.exp(-((most / deep) ** 1.5))) * np.tanh(3 * below) ** 0.5

    return Hidden("softening", "weibull", strength, force=_elastic(factor))


def hysteresis(rng, strength) -> Hidden:
    """Dahl's model of friction inside the material: dh = r (1 - h sign(ḋ)) |dd|, the force is k d + h per texel."""
    reach = rng.uniform(0.25e-3, 0.6e-3)

    def act(s, pad):
        h = np.zeros(s.depth.shape[1])
        for t in range(1, len(s.time)):
            step = s.depth[t] - s.depth[t - 1]
            h = h + (np.sign(step) - h) * (1 - np.exp(-np.abs(step) / reach))
            h[s.depth[t] <= 0] = 0.0
            s.force[t] = np.maximum(s.force[t] * (1 + 0.4 * strength * h), 0.0)

    return Hidden("hysteresis", "dahl", strength, force=act)


def creep(rng, strength) -> Hidden:
    """Stress relaxation by Kohlrausch's stretched exponential in each texel's depth history."""
    tau, beta = np.exp(rng.uniform(np.log(0.8), np.log(4.0))), rng.uniform(0.45, 0.7)

    def act(s, pad):
        lag = s.time - s.time[0]
        memory = 0.7 * min(strength, 1.2) * (1 - np.exp(-((lag / tau) ** beta)))
        steps = np.diff(pad.k * s.depth, axis=0, prepend=0.0)
        n = 2 * len(lag)
        relaxed = np.fft.irfft(np.fft.rfft(steps, n, axis=0) * np.fft.rfft(memory, n)[:, None], n, axis=0)[: len(lag)]
        s.force = np.where(s.depth > 0, np.maximum(s.force - relaxed, 0.0), 0.0)

    return Hidden("creep", "stretched", strength, force=act, values={"tau": tau, "beta": beta})


def adhesion(rng, strength) -> Hidden:
    """A cohesive zone (Dugdale, rounded): on the way out a texel pulls, most where the depth goes to zero."""
    width = rng.uniform(0.3e-3, 0.8e-3)

    def act(s, pad):
        touched = np.maximum.accumulate(s.depth, axis=0) > 0.3e-3
        leaving = touched & (s.pace < 0) & (s.depth > 0)
        pull = strength * pad.k * 1.2e-3 * np.exp(-((s.depth / width) ** 2)) * (1 - np.exp(-s.depth / (0.1 * width)))
        s.force = s.force - np.where(leaving, pull, 0.0)

    return Hidden("adhesion", "cohesive", strength, force=act)


def wear(rng, strength) -> Hidden:
    """Stiffness lost with the work of pressing and sliding, by a rational law."""

    def factor(s, pad):
        speed = np.linalg.norm(np.gradient(s.path, s.time, axis=0), axis=1)[:, None]
        work = np.cumsum(s.force * speed, axis=0) * s.dt
        w = work / max(float(work[-1].max()), 1e-12)
        return 1.0 / (1.0 + 1.5 * strength * w)

    return Hidden("wear", "rational", strength, force=_elastic(factor))


def _neighbours(values: np.ndarray) -> np.ndarray:
    """(T, n) sum over the four direct neighbours of each texel; at the rim the texel itself stands in."""
    grid = values.reshape(len(values), ROWS, COLUMNS)
    padded = np.pad(grid, ((0, 0), (1, 1), (1, 1)), mode="edge")
    total = padded[:, :-2, 1:-1] + padded[:, 2:, 1:-1] + padded[:, 1:-1, :-2] + padded[:, 1:-1, 2:]
    return total.reshape(values.shape)


def load_spreading(rng, strength) -> Hidden:
    """A cover in bending: a few rounds of diffusion between neighbours, which keeps the sum."""

    def act(s, pad):
        share = min(0.2 * strength, 0.22)
        for _ in range(4):
            s.force = s.force + share * (_neighbours(s.force) - 4 * s.force)

    return Hidden("load-spreading", "diffusion", strength, force=act)


def crosstalk(rng, strength) -> Hidden:
    """Leakage along the wires: a share of the mean of a texel's row and of its column is added."""

    def act(s, pad):
        signal = (s.reading - pad.zero).reshape(-1, ROWS, COLUMNS)
        leak = signal.mean(axis=1, keepdims=True) + signal.mean(axis=2, keepdims=True)
        s.reading = pad.zero + (signal + 0.6 * strength * leak).reshape(s.reading.shape)

    return Hidden("crosstalk", "wires", strength, reading=act)


def gain_mismatch(rng, strength) -> Hidden:
    """Log-normal gains on top of a slope across the pad."""
    y, x = np.mgrid[-1 : 1 : ROWS * 1j, -1 : 1 : COLUMNS * 1j]
    tilt = rng.normal(size=2)
    gain = np.exp(strength * (0.35 * rng.normal(size=ROWS * COLUMNS) + 0.2 * (tilt[0] * x + tilt[1] * y).ravel()))

    def act(s, pad):
        s.reading = pad.zero + (s.reading - pad.zero) * gain / gain.mean()

    return Hidden("gain-mismatch", "lognormal", strength, reading=act)


def dead_texels(rng, strength) -> Hidden:
    """Texels whose reading is stuck, some at the value without load and some at another."""
    middle = [r * COLUMNS + c for r in range(3, 11) for c in range(1, 5)]
    dead = rng.choice(middle, size=max(1, round(5 * min(strength, 1.6))), replace=False)
    level = rng.choice([0.0, 0.0, 1.0], size=len(dead))

    def act(s, pad):
        s.reading[:, dead] = pad.zero + pad.gain * 0.03 * level

    return Hidden("dead-texels", "stuck", strength, reading=act, values={"texels": sorted(int(i) for i in dead)})


def dead_zone(rng, strength) -> Hidden:
    """Nothing up to a force, then a quadratic onset that runs into the line."""

    def act(s, pad):
        start = 0.06 * strength
        x = np.maximum(s.reading - pad.zero, 0) / pad.gain
        onset = np.maximum(x - 0.5 * start, 0.0)
        s.reading = pad.zero + pad.gain * np.where(onset < start, onset**2 / (2 * start), onset - start / 2)

    return Hidden("dead-zone", "quadratic", strength, reading=act)


def saturation(rng, strength) -> Hidden:
    """A voltage divider (Tekscan-like) put through an arctangent."""

    def act(s, pad):
        top = 0.18 / strength
        x = (s.reading - pad.zero) / pad.gain
        s.reading = pad.zero + pad.gain * top * 2 / np.pi * np.arctan(np.pi / 2 * x / top)

    return Hidden("saturation", "arctan", strength, reading=act)


def lag(rng, strength) -> Hidden:
    """Two equal low passes behind each other."""
    tau = 0.12 * strength

    def act(s, pad):
        keep = np.exp(-s.dt / max(tau, 1e-6))
        for _ in range(2):
            state = s.reading[0].copy()
            for t in range(len(s.time)):
                state = keep * state + (1 - keep) * s.reading[t]
                s.reading[t] = state

    return Hidden("lag", "second order", strength, reading=act, values={"tau": tau})


def drift(rng, strength) -> Hidden:
    """The zero wanders with a power of the time, a little differently in each texel."""
    power, spread = rng.uniform(0.6, 1.5), 1 + 0.2 * rng.normal(size=ROWS * COLUMNS)

    def act(s, pad):
        s.reading = s.reading + pad.gain * 0.05 * strength * ((s.time[:, None] - s.time[0]) / 25.0) ** power * spread

    return Hidden("drift", "power", strength, reading=act)


def offset(rng, strength) -> Hidden:
    """Each row of electronics has a zero of its own, and each texel one on top."""
    zero = np.repeat(rng.normal(size=ROWS), COLUMNS) + 0.5 * rng.normal(size=ROWS * COLUMNS)

    def act(s, pad):
        s.reading = s.reading + pad.gain * 0.03 * strength * zero

    return Hidden("offset", "rows", strength, reading=act)


def quantization(rng, strength) -> Hidden:
    """An 8-bit-like converter that cuts off instead of rounding."""

    def act(s, pad):
        step = pad.gain * 0.05 * strength
        s.reading = step * np.floor(s.reading / step)

    return Hidden("quantization", "truncating", strength, reading=act)


def noise(rng, strength) -> Hidden:
    """Noise that grows with the load, heavier in its tails than a bell curve."""

    def act(s, pad):
        shake = rng.standard_t(5, size=s.reading.shape)
        s.reading = s.reading + strength * 0.25 * np.abs(s.reading - pad.zero) * shake

    return Hidden("noise", "of the load", strength, reading=act)


def misalignment(rng, strength) -> Hidden:
    """The pad sits shifted, and turned about its normal, under the stage."""
    turn, shift = rng.normal() * 0.08 * strength, rng.normal(size=2)
    shift = 3e-3 * strength * shift / np.linalg.norm(shift)
    c, s = np.cos(turn), np.sin(turn)

    def place(path):
        moved = path.copy()
        moved[:, 0] = c * path[:, 0] - s * path[:, 1] + shift[0]
        moved[:, 1] = s * path[:, 0] + c * path[:, 1] + shift[1]
        return moved

    return Hidden("misalignment", "shift and turn", strength, place=place)


def stribeck(rng, strength) -> Hidden:
    """Friction weakens with the logarithm of the speed (rate-and-state friction at steady state)."""
    slow = 2e-3

    def law(speed, fn, pad):
        return np.maximum(1.0 - 0.18 * strength * np.log1p(speed / slow), 0.2), np.zeros_like(speed)

    return Hidden("stribeck", "logarithmic", strength, friction=law)


def viscous_friction(rng, strength) -> Hidden:
    """A lubricating film: drag with a power of the speed below one."""

    def law(speed, fn, pad):
        drag = strength * 0.6 * np.maximum(fn, 0.0) * (np.maximum(speed, 1e-6) / 0.02) ** 0.6
        return np.ones_like(speed), drag / np.maximum(speed, 1e-6)

    return Hidden("viscous-friction", "power", strength, friction=law)


MAKERS: dict[str, Maker] = {
    "stiffening": stiffening,
    "softening": softening,
    "hysteresis": hysteresis,
    "creep": creep,
    "adhesion": adhesion,
    "wear": wear,
    "load-spreading": load_spreading,
    "crosstalk": crosstalk,
    "gain-mismatch": gain_mismatch,
    "dead-texels": dead_texels,
    "dead-zone": dead_zone,
    "saturation": saturation,
    "lag": lag,
    "drift": drift,
    "offset": offset,
    "quantization": quantization,
    "noise": noise,
    "misalignment": misalignment,
    "stribeck": stribeck,
    "viscous-friction": viscous_friction,
}


# --- what is in nobody's library


def hum(rng, strength) -> Hidden:
    """Mains hum that the sampling folds down to a few hertz."""
    pitch, phase = rng.uniform(2.5, 0.4 * RATE), rng.uniform(0, 6, size=ROWS * COLUMNS)

    def act(s, pad):
        s.reading = s.reading + pad.gain * 0.06 * strength * np.sin(2 * np.pi * pitch * s.time[:, None] + phase)

    return Hidden("hum", "sine", strength, reading=act)


def temperature(rng, strength) -> Hidden:
    """A swing of temperature takes gain and zero with it."""
    period, phase = rng.uniform(6, 14), rng.uniform(0, 6)

    def act(s, pad):
        swing = np.sin(2 * np.pi * s.time[:, None] / period + phase)
        s.reading = pad.zero + (s.reading - pad.zero) * (1 + 0.35 * strength * swing) + pad.gain * 0.02 * strength * swing

    return Hidden("temperature", "swing", strength, reading=act)


def jitter(rng, strength) -> Hidden:
    """The time stamps wander: what was read belongs to another moment."""

    def act(s, pad):
        wander = np.cumsum(rng.normal(size=len(s.time)))
        wander = 0.25 * strength * (wander - wander.mean()) / max(float(np.abs(wander - wander.mean()).max()), 1e-9)
        for i in range(s.reading.shape[1]):
            s.reading[:, i] = np.interp(s.time + wander, s.time, s.reading[:, i])

    return Hidden("jitter", "wandering clock", strength, reading=act)


OUTSIDE: dict[str, Maker] = {"hum": hum, "temperature": temperature, "jitter": jitter}
