# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects in the formulas of the library, written down a second time from docs/effects.md, with their true values."""

from __future__ import annotations

import numpy as np

from .other import Maker
from .world import COLUMNS, DEEP, PITCH, ROWS, Hidden, N, Pad, faded


def _between(rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _either(*makers: Maker) -> Maker:
    """One of several forms."""
    return lambda rng, strength: makers[rng.integers(len(makers))](rng, strength)


def _forms(maker, *forms: tuple) -> Maker:
    """One of several forms of one maker, by its first arguments."""
    return lambda rng, strength: maker(*forms[rng.integers(len(forms))], rng, strength)


def _over_depth(name: str, form: str, strength: float, factor, values: dict) -> Hidden:
    """An elastic force times a function of the depth alone."""
    return Hidden(name, form, elastic=lambda s, pad: s.force * factor(s.depth), values=values)


def polynomial(rng, strength) -> Hidden:
    power = float(rng.uniform(1.0, 2.5))
    depth = 4e-3 / strength ** (1 / power)
    return _over_depth(
        "stiffening", "polynomial", strength, lambda d: 1 + (d / depth) ** power, {"depth": depth, "exponent": power}
    )


def exponential(rng, strength) -> Hidden:
    depth = 5e-3 / strength

    def factor(d):
        x = np.clip(d / depth, 1e-9, 50)
        return np.expm1(x) / x

    return _over_depth("stiffening", "exponential", strength, factor, {"depth": depth})


def peak(rng, strength) -> Hidden:
    share, depth = min(0.5 * strength, 0.85), _between(rng, 1e-3, 2.5e-3)

    def act(s, pad):
        return s.force * (1 - share * -np.expm1(-np.maximum.accumulate(s.depth, axis=0) / depth))

    return Hidden("softening", "peak", elastic=act, values={"share": share, "depth": depth})


def ogden_roxburgh(rng, strength) -> Hidden:
    from scipy.special import erf

    share, width = min(0.6 * strength, 0.85), float(rng.uniform(0.3, 1.0))

    def act(s, pad):
        work = 0.5 * s.force * s.depth
        most = np.maximum(np.maximum.accumulate(work, axis=0), 1e-30)
        return s.force * (1 - share * erf((1 - work / most) / width))

    return Hidden("softening", "ogden-roxburgh", elastic=act, values={"share": share, "width": width})


def duhem(rng, strength) -> Hidden:
    width, depth = min(0.35 * strength, 0.85), _between(rng, 0.2e-3, 0.6e-3)

    def act(s, pad):
        z = np.zeros(N)
        steps = np.diff(s.depth, axis=0, prepend=0.0)
        for t, step in enumerate(steps):
            aim = np.where(step >= 0, 1.0, -1.0)
            z = aim + (z - aim) * np.exp(-np.abs(step) / depth)
            s.force[t] *= 1 + width * z
            z = np.where(s.depth[t] > 0, z, 0.0)
        return s.force

    return Hidden("hysteresis", "duhem", elastic=act, values={"width": width, "depth": depth})


def maxwell_slip(rng, strength) -> Hidden:
    share, scale = min(0.5 * strength, 0.9), float(rng.uniform(0.1, 0.35))

    def act(s, pad):
        force = scale * pad.k * DEEP  # depends on the pad: told with the others below
        limit = force * np.array([0.4, 0.8, 1.2, 1.6])
        springs, before = np.zeros((N, 4)), np.zeros(N)
        for t in range(len(s.time)):
            now = s.force[t].copy()
            springs = np.clip(springs + (now - before)[:, None], -limit, limit)
            s.force[t] = (1 - share) * now + share * springs.mean(axis=1)
            springs[s.depth[t] <= 0] = 0.0
            before = now
        return s.force

    return Hidden("hysteresis", "maxwell-slip", elastic=act, values={"share": share, "force / k": scale * DEEP})


def _low_pass(x: np.ndarray, dt: float, tau: float, first: np.ndarray) -> np.ndarray:
    """``tau q' = x - q`` for x that is straight between samples."""
    keep, out = np.exp(-dt / tau), np.empty_like(x)
    new = 1 - (1 - keep) * tau / dt
    old = 1 - keep - new
    out[0] = first
    for t in range(1, len(x)):
        out[t] = keep * out[t - 1] + old * x[t - 1] + new * x[t]
    return out


def relaxing(rng, strength) -> Hidden:
    amount, time = min(0.5 * strength, 0.9), _between(rng, 0.5, 5.0)

    def act(s, pad):
        return s.force - amount * _low_pass(s.force, s.dt, time, np.zeros(N))

    return Hidden("creep", "exponential", elastic=act, values={"amount": amount, "time": time})


def logarithmic(rng, strength) -> Hidden:
    amount, time = min(0.1 * strength, 0.14), _between(rng, 0.1, 0.5)

    def act(s, pad):
        inside = (np.arange(8) + 0.5) / 8  # of a step along which the force grows evenly
        at = (np.arange(len(s.time))[:, None] + inside) * s.dt
        memory = amount * np.log10(1 + at / time).mean(axis=1)
        return s.force - faded(s.force, memory)

    return Hidden("creep", "logarithmic", elastic=act, values={"amount": amount, "time": time})


def _worn(law, form: str, rng, strength) -> Hidden:
    def act(s, pad):
        life = 4.0 * pad.k * DEEP / strength
        put_on = np.cumsum(np.maximum(np.diff(s.force, axis=0, prepend=0.0), 0.0), axis=0)
        before = np.vstack([np.zeros((1, N)), put_on[:-1]])
        return s.force * law(before / life)

    return Hidden("wear", form, elastic=act, values={"life / k": 4.0 * DEEP / strength})


def unloading(rng, strength) -> Hidden:
    width = _between(rng, 0.1e-3, 0.4e-3)

    def act(s, pad):
        pull, u = strength * pad.k * 1e-3, np.zeros(N)
        steps = np.diff(s.depth, axis=0, prepend=0.0)
        for t, step in enumerate(steps):
            aim = np.where(step >= 0, 0.0, 1.0)
            u = np.where(s.depth[t] > 0, aim + (u - aim) * np.exp(-np.abs(step) / width), 0.0)
            s.force[t] -= pull * u
        return s.force

    return Hidden("adhesion", "unloading", force=act, values={"pull / k": strength * 1e-3, "depth": width})


def steady_pull(rng, strength) -> Hidden:
    width = _between(rng, 0.05e-3, 0.15e-3)

    def act(s, pad):
        return s.force + strength * pad.k * 1e-3 * np.expm1(-s.depth / width)

    return Hidden("adhesion", "constant", force=act, values={"pull / k": strength * 1e-3, "depth": width})


def _spread(form: str, size: str, weight, rng, strength) -> Hidden:
    width = 3e-3 * strength

    def act(s, pad):
        apart = np.linalg.norm(pad.place[:, None] - pad.place[None], axis=2)
        shares = weight(apart / width)
        shares /= shares.sum(axis=0)
        return pad.zero + (s.reading - pad.zero) @ shares.T

    return Hidden("load-spreading", form, reading=act, values={size: width})


def neighbours(rng, strength) -> Hidden:
    share = min(0.1 * strength, 0.25)

    def act(s, pad):
        x = (s.reading - pad.zero).reshape(-1, ROWS, COLUMNS)
        out = x.copy()
        out[:, 1:] += share * x[:, :-1]
        out[:, :-1] += share * x[:, 1:]
        out[:, :, 1:] += share * x[:, :, :-1]
        out[:, :, :-1] += share * x[:, :, 1:]
        return pad.zero + out.reshape(s.reading.shape)

    return Hidden("crosstalk", "neighbours", reading=act, values={"share": share})


def lines(rng, strength) -> Hidden:
    share = 0.6 * strength

    def act(s, pad):
        x = (s.reading - pad.zero).reshape(-1, ROWS, COLUMNS)
        leak = x.mean(axis=1, keepdims=True) + x.mean(axis=2, keepdims=True)
        return pad.zero + (x + share * leak).reshape(s.reading.shape)

    return Hidden("crosstalk", "lines", reading=act, values={"share": share})


def _gains(form: str, strength: float, gain: np.ndarray, values: dict) -> Hidden:
    return Hidden("gain-mismatch", form, reading=lambda s, pad: pad.zero + (s.reading - pad.zero) * gain, values=values)


def listed_gains(rng, strength) -> Hidden:
    gain = np.exp(0.4 * strength * rng.normal(size=N))
    return _gains("listed", strength, gain / gain.mean(), {})


def gradient(rng, strength) -> Hidden:
    turn = rng.uniform(0, 2 * np.pi)
    gx, gy = (float(np.clip(0.45 * strength * f(turn), -0.5, 0.5)) for f in (np.cos, np.sin))
    y, x = np.mgrid[-1 : 1 : ROWS * 1j, -1 : 1 : COLUMNS * 1j]
    return _gains("gradient", strength, (1 + gx * x + gy * y).ravel(), {"along_x": gx, "along_y": gy})


def silent(rng, strength) -> Hidden:
    middle = [r * COLUMNS + c for r in range(3, 11) for c in range(1, 5)]
    dead = rng.choice(middle, size=max(1, round(5 * min(strength, 1.6))), replace=False)

    def act(s, pad):
        s.reading[:, dead] = pad.zero
        return s.reading

    return Hidden("dead-texels", "listed", reading=act)


def _blunt(law, form: str, rng, strength) -> Hidden:
    def act(s, pad):
        f = np.maximum(s.reading - pad.zero, 0.0) / pad.gain
        return pad.zero + pad.gain * law(f, pad.k * 1.2e-3 * strength)

    return Hidden("dead-zone", form, reading=act, values={"threshold / k": 1.2e-3 * strength})


def _full(law, form: str, rng, strength) -> Hidden:
    level = DEEP / (0.6 + strength if form == "clip" else strength)

    def act(s, pad):
        top = pad.gain * pad.k * level
        return pad.zero + top * law((s.reading - pad.zero) / top)

    return Hidden("saturation", form, reading=act, values={"level / k gain": level})


def first_order(rng, strength) -> Hidden:
    time = 0.2 * strength

    def act(s, pad):
        return _low_pass(s.reading, s.dt, time, s.reading[0])

    return Hidden("lag", "first-order", reading=act, values={"time": time})


def dead_time(rng, strength) -> Hidden:
    time = 0.2 * strength

    def act(s, pad):
        return np.stack([np.interp(s.time - time, s.time, channel) for channel in s.reading.T], axis=1)

    return Hidden("lag", "dead-time", reading=act, values={"time": time})


def _drifting(form: str, strength: float, course, values: dict) -> Hidden:
    def act(s, pad):
        return s.reading + pad.gain * pad.k * course(s.time - s.time[0])[:, None]

    return Hidden("drift", form, reading=act, values=values)


def steady_drift(rng, strength) -> Hidden:
    rate = DEEP * 0.01 * strength * float(rng.choice([-1, 1]))
    return _drifting("linear", strength, lambda t: rate * t, {"rate / k gain": rate})


def warm_up(rng, strength) -> Hidden:
    amount, time = DEEP * 0.2 * strength, _between(rng, 4.0, 12.0)
    return _drifting("warm-up", strength, lambda t: -amount * np.expm1(-t / time), {"amount / k gain": amount, "time": time})


def listed_offsets(rng, strength) -> Hidden:
    zero = 0.2 * strength * DEEP * rng.normal(size=N)
    return Hidden("offset", "listed", reading=lambda s, pad: s.reading + pad.gain * pad.k * zero)


def proportional(rng, strength) -> Hidden:
    def act(s, pad):
        return s.reading + 0.25 * strength * (s.reading - pad.zero) * rng.normal(size=s.reading.shape)

    return Hidden("noise", "proportional", reading=act)


def steps(rng, strength) -> Hidden:
    def act(reading, pad):
        step = pad.gain * pad.k * DEEP * 0.3 * strength
        return step * np.round(reading / step)

    return Hidden("quantization", "round", convert=act, values={"step / k gain": DEEP * 0.3 * strength})


def shift(rng, strength) -> Hidden:
    turn = rng.uniform(0, 2 * np.pi)
    by = PITCH * strength * np.array([np.cos(turn), np.sin(turn)])
    values = {"x": float(by[0]), "y": float(by[1])}
    return Hidden("misalignment", "shift", place=lambda places: places + by, values=values)


def _slippery(law, form: str, rng, strength) -> Hidden:
    rise, speed = min(1.5 * strength, 3.8), _between(rng, 4e-3, 0.03)

    def factor(v, fn, pad):
        return 1 + rise * law(v / speed), np.zeros_like(v)

    return Hidden("stribeck", form, friction=factor, values={"rise": rise, "speed": speed})


def viscous(rng, strength) -> Hidden:
    def law(v, fn, pad):
        return np.ones_like(v), np.full_like(v, 0.01 * pad.k * strength)

    return Hidden("viscous-friction", "linear", friction=law, values={"viscosity / k": 0.01 * strength})


def viscous_load(rng, strength) -> Hidden:
    def law(v, fn, pad):
        return np.ones_like(v), 8.0 * strength * np.maximum(fn, 0.0)

    return Hidden("viscous-friction", "load", friction=law, values={"viscosity": 8.0 * strength})


OWN: dict[str, Maker] = {
    "stiffening": _either(polynomial, exponential),
    "softening": _either(peak, ogden_roxburgh),
    "hysteresis": _either(duhem, maxwell_slip),
    "creep": _either(relaxing, logarithmic),
    "adhesion": _either(unloading, steady_pull),
    "wear": _forms(_worn, (lambda a: np.exp(-a), "exponential"), (lambda a: np.maximum(1 - a, 0.0), "linear")),
    "load-spreading": _forms(
        _spread,
        ("gaussian", "width", lambda r: np.exp(-0.5 * r * r)),
        ("half-space", "thickness", lambda r: (1 + r * r) ** -2.5),
    ),
    "crosstalk": _either(neighbours, lines),
    "gain-mismatch": _either(listed_gains, gradient),
    "dead-texels": silent,
    "dead-zone": _forms(_blunt, (lambda f, t: np.maximum(f - t, 0.0), "hard"), (lambda f, t: f * f / (f + t), "soft")),
    "saturation": _forms(
        _full,
        (lambda x: np.clip(x, -1, 1), "clip"),
        (np.tanh, "tanh"),
        (lambda x: x / (1 + np.abs(x)), "rational"),
    ),
    "lag": _either(first_order, dead_time),
    "drift": _either(steady_drift, warm_up),
    "offset": listed_offsets,
    "quantization": steps,
    "noise": proportional,
    "misalignment": shift,
    "stribeck": _forms(_slippery, (lambda x: np.exp(-x * x), "gaussian"), (lambda x: np.exp(-x), "exponential")),
    "viscous-friction": _either(viscous, viscous_load),
}


def true_value(effect: Hidden, name: str, pad: Pad) -> float | None:
    """Return the true value of a parameter in its own unit; None where it is not one number that is known."""
    scales = {name: 1.0, f"{name} / k": pad.k, f"{name} / k gain": pad.k * pad.gain}
    for key, scale in scales.items():
        if key in effect.values:
            return float(effect.values[key]) * scale
    return None
