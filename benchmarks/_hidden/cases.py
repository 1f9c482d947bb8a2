# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases: a pad, an indenter, six trials, something hidden or nothing; written as a rig, with the answer kept apart.

Each case follows from its kind and number alone. How strong a hidden effect is, is told by what it does to the recording: its
root mean square is between 4 and 12 % of the full range, six to twenty times the noise, so that it is worth finding and does
not drown all else.
"""

from __future__ import annotations

import csv
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .other import MAKERS, OUTSIDE
from .own import OWN
from .world import COLUMNS, PITCH, RATE, ROWS, SECONDS, THICKNESS, Hidden, Pad, Probe, Signals, net_force, respond

TRIALS = (("fit", 4), ("check", 2))
SHARE = (0.04, 0.12)
"""Of the full range: what a hidden effect does to the recording, root mean square."""
IN_FORCE = ("stribeck", "viscous-friction")
"""Effects that show in the net force along the surface and not in the readings."""
KINDS = ("other", "own", "none", "two", "outside", "poor")


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes
    ----------
    kind : str
    number : int
    hidden : tuple of Hidden
    pad : Pad
    probe : Probe
    times, paths : lists of arrays
    readings, forces : lists of arrays, with noise
    noise : float
        Standard deviation in the sensor's unit.
    words : dict
        What the rig says of the sensor; not always true.
    """

    kind: str
    number: int
    hidden: tuple[Hidden, ...]
    pad: Pad
    probe: Probe
    times: list[np.ndarray]
    paths: list[np.ndarray]
    readings: list[np.ndarray]
    forces: list[np.ndarray]
    noise: float
    words: dict

    @property
    def answer(self) -> list[str]:
        """Names of what is hidden."""
        return [effect.name for effect in self.hidden]


def names_for(kind: str) -> list[str]:
    """What can be hidden in a kind of case; a case's number runs through them."""
    return list({"other": MAKERS, "own": OWN, "outside": OUTSIDE}.get(kind, {"": None}))


def draw(kind: str, number: int) -> Case:
    """Return case `number` of a kind; the same every time."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), number])
    pad = _pad(rng)
    ball = bool(rng.integers(2)) if kind != "poor" else True
    probe = Probe(rng.uniform(9e-3, 16e-3), None) if ball else Probe(None, (0.04, 0.07, 0.02))
    names = _names(kind, number, rng, ball)
    makers = OWN if kind == "own" else {**MAKERS, **OUTSIDE}
    times, paths = _poor(rng, probe) if kind == "poor" else _trials(rng, probe, pad)
    hidden: tuple[Hidden, ...] = ()
    for name in names:
        hidden += (_calibrated(makers[name], name, rng, pad, probe, times, paths),)
    signals = [respond(probe, pad, time, path, hidden) for time, path in zip(times, paths, strict=True)]
    full = max(float(np.abs(s.reading - pad.zero).max()) for s in signals)
    noise = rng.uniform(0.003, 0.01) * full
    coloured = kind == "none" and number % 3 == 2
    readings = [s.reading + noise * _noise(rng, s.reading.shape, coloured) for s in signals]
    largest = max(float(np.abs(net_force(s)).max()) for s in signals)
    forces = [net_force(s) + 0.003 * largest * _noise(rng, (len(s.time), 3), coloured) for s in signals]
    return Case(kind, number, hidden, pad, probe, times, paths, readings, forces, noise, _words(rng, pad, kind, number))


def _pad(rng) -> Pad:
    k = float(np.exp(rng.uniform(np.log(30), np.log(120))))
    mus = rng.uniform(0.4, 0.7)
    unit, gain, zero = [
        ("N", 1.0, 0.0),
        ("counts", rng.uniform(500, 2000), rng.uniform(20, 80)),
        ("V", rng.uniform(1, 4), 0.2),
    ][rng.integers(3)]
    return Pad(
        k, 0.01 * k, mus, rng.uniform(0.6, 0.95) * mus, rng.uniform(0.005, 0.03), 0.5 * k, 0.005 * k, 0.01, gain, zero, unit
    )


def _names(kind: str, number: int, rng, ball: bool) -> list[str]:
    if kind in ("none", "poor"):
        return [] if kind == "none" else [["creep", "hysteresis", "lag", "gain-mismatch"][number % 4]]
    pool = names_for(kind) if kind != "two" else list(MAKERS)
    # A flat indenter loads all texels alike: where the pad sits, and what neighbours do, cannot show under it.
    blind = () if ball else ("misalignment", "load-spreading", "crosstalk")
    if kind != "two":
        name = pool[number % len(pool)]
        return [name if name not in blind else pool[(number + 7) % len(pool)]]
    clear = [name for name in pool if name not in (*blind, "noise", "quantization", "offset", "dead-texels")]
    first, second = rng.choice(clear, size=2, replace=False)
    return [str(first), str(second)]


def _words(rng, pad: Pad, kind: str, number: int) -> dict:
    """What the rig says: rounded nominal values, now and then wrong ones."""
    wrong = kind == "none" and number % 3 == 1
    k = pad.k * (rng.uniform(0.6, 1.6) if wrong else rng.uniform(0.95, 1.05))
    words = {
        "thickness": THICKNESS,
        "k": float(f"{k:.3g}"),
        "cn": float(f"{0.01 * k:.3g}"),
        "sigma0": float(f"{pad.sigma0:.4g}"),
    }
    words |= {
        "sigma1": float(f"{pad.sigma1:.4g}"),
        "ct": pad.ct,
        "mus": round(pad.mus, 2),
        "mud": round(pad.mud, 2),
        "x0": round(pad.x0, 3),
    }
    words["unit"] = pad.unit
    if pad.unit == "N" or not wrong:
        words |= {"gain": float(f"{pad.gain:.4g}"), "zero": float(f"{pad.zero:.4g}")}
    return words


def _noise(rng, shape, coloured: bool) -> np.ndarray:
    white = rng.normal(size=shape)
    if not coloured:
        return white
    keep, out = 0.9, np.empty(shape)
    out[0] = white[0]
    for t in range(1, len(out)):
        out[t] = keep * out[t - 1] + np.sqrt(1 - keep**2) * white[t]
    return out


# --- what the probe does


def _trials(rng, probe: Probe, pad: Pad) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Six different programmes of 25 s: staircase, cycles, press and hold, slides; two more of all to check on."""
    deep = 3e-3
    makers = (_staircase, _cycles, _holds, _slides, _mixture, _mixture)
    paths = [maker(rng, deep) for maker in makers]
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    return [time] * len(paths), [_path(time, knots, probe) for knots in paths]


def _path(time: np.ndarray, knots: list[tuple[float, float, float, float]], probe: Probe) -> np.ndarray:
    """Straight lines between (time, x, y, depth), the last of them until the end."""
    knots = np.array(knots)
    x, y, depth = (np.interp(time, knots[:, 0], knots[:, i]) for i in (1, 2, 3))
    return np.stack([x, y, probe.lowest - depth], axis=1)


def _spots(rng, count: int) -> np.ndarray:
    """(count, 2) metres: places on the pad, spread along it."""
    y = np.linspace(-0.32, 0.32, count) * ROWS * PITCH
    return np.stack([rng.uniform(-0.25, 0.25, count) * COLUMNS * PITCH, rng.permutation(y)], axis=1)


UP = -1e-3
"""Depth while nothing touches, metres."""


def _staircase(rng, deep):
    (x, y), steps = _spots(rng, 1)[0], rng.permutation([0.25, 0.5, 0.75, 1.0])
    knots, t = [(0, x, y, UP), (1.0, x, y, UP)], 1.0
    for share in (*np.sort(steps), *np.sort(steps)[-2::-1]):
        knots += [(t + 0.6, x, y, deep * share), (t + 2.4, x, y, deep * share)]
        t += 2.4
    return [*knots, (t + 0.8, x, y, UP), (SECONDS, x, y, UP)]


def _cycles(rng, deep):
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for (x, y), period in zip(_spots(rng, 4), (0.8, 1.6, 3.0, 1.2), strict=True):
        knots += [(t + 0.3, x, y, UP)]
        t += 0.3
        for depth in rng.uniform(0.5, 1.0, 3) * deep:
            knots += [(t + period / 2, x, y, depth), (t + period, x, y, UP)]
            t += period
    return [*knots, (SECONDS, x, y, UP)]


def _holds(rng, deep):
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for (x, y), hold in zip(_spots(rng, 3), (3.0, 8.0, 4.0), strict=True):
        depth, quick = deep * rng.uniform(0.6, 1.0), rng.uniform(0.15, 0.4)
        knots += [(t + 0.3, x, y, UP), (t + 0.3 + quick, x, y, depth), (t + 0.3 + quick + hold, x, y, depth)]
        knots += [(t + 0.6 + quick + hold, x, y, UP), (t + 2.0 + quick + hold, x, y, UP)]
        t += 2.0 + quick + hold
    return [*knots, (SECONDS, x, y, UP)]


def _slides(rng, deep):
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for depth in rng.permutation([0.6, 0.9]) * deep:
        y = 0.25 * ROWS * PITCH * rng.choice([-1, 1])
        knots += [(t + 0.3, 0, y, UP), (t + 0.9, 0, y, depth), (t + 1.3, 0, y, depth)]
        t += 1.3
        for speed in rng.permutation([0.004, 0.012, 0.04, 0.1]):
            y = -y
            travel = 2 * abs(y) / speed
            travel = min(travel, 3.5)
            y = float(np.clip(y, -abs(y), abs(y)))
            goal = np.clip(-y + np.sign(y) * speed * travel, -abs(y), abs(y))
            knots += [(t + travel, 0, goal, depth), (t + travel + 0.4, 0, goal, depth)]
            t, y = t + travel + 0.4, goal
        knots += [(t + 0.5, 0, y, UP)]
        t += 0.8
    return [*knots, (max(SECONDS, t), 0, y, UP)]


def _mixture(rng, deep):
    """Some of everything at other places, depths and speeds."""
    knots, t = [(0, 0, 0, UP), (1.0, 0, 0, UP)], 1.0
    for x, y in _spots(rng, 3):
        depth, quick = deep * rng.uniform(0.4, 1.0), np.exp(rng.uniform(np.log(0.15), np.log(1.0)))
        knots += [(t + 0.3, x, y, UP), (t + 0.3 + quick, x, y, depth), (t + 2.3 + quick, x, y, depth)]
        t += 2.3 + quick
        low, speed = 0.4 * depth, rng.uniform(0.005, 0.05)
        far = y + 0.006 * rng.choice([-1, 1])
        slide = 0.006 / speed
        knots += [
            (t + 0.5, x, y, low),
            (t + 1.0, x, y, depth),
            (t + 1.0 + slide, x, far, depth),
            (t + 1.4 + slide, x, far, depth),
        ]
        knots += [(t + 1.9 + slide, x, far, UP), (t + 2.9 + slide, x, far, UP)]
        t += 2.9 + slide
    return [*knots, (max(SECONDS, t), x, far, UP)]


def _poor(rng, probe: Probe) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Six times the same single slow press in one place: no rate, no hold, no other texels."""
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    knots = [(0, 0, 0, UP), (1, 0, 0, UP), (13, 0, 0, 3e-3), (25, 0, 0, UP)]
    return [time] * 6, [_path(time, knots, probe)] * 6


def _calibrated(maker, name: str, rng, pad: Pad, probe: Probe, times, paths) -> Hidden:
    """Return the effect at a strength at which it changes the recording by the wanted share of the full range."""
    seed = int(rng.integers(2**32))
    wanted = rng.uniform(*SHARE)
    slides = name in IN_FORCE
    plain = [respond(probe, pad, time, path, slides=slides) for time, path in zip(times, paths, strict=True)]

    def change(strength: float) -> float:
        effect = maker(np.random.default_rng(seed), strength)
        total, full = 0.0, 0.0
        for before, time, path in zip(plain, times, paths, strict=True):
            after = respond(probe, pad, time, path, (effect,), slides)
            a, b = (_seen(name, s, pad) for s in (after, before))
            loaded = (after.depth > 0) | (before.depth > 0)
            touched = loaded if a.ndim == 2 and a.shape == loaded.shape else loaded.any(axis=1)[:, None] & np.ones_like(a, bool)
            total += float(((a - b)[touched] ** 2).mean())
            full = max(full, float(np.abs(b).max()))
        return np.sqrt(total / len(plain)) / full

    low, high = np.log(0.02), np.log(3.0)
    if change(np.exp(high)) < wanted:
        return maker(np.random.default_rng(seed), float(np.exp(high)))
    for _ in range(7):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if change(np.exp(middle)) < wanted else (low, middle)
    return maker(np.random.default_rng(seed), float(np.exp(0.5 * (low + high))))


def _seen(name: str, signals: Signals, pad: Pad) -> np.ndarray:
    return net_force(signals)[:, :2] if name in IN_FORCE else signals.reading - pad.zero


# --- files


def write(case: Case, folder: Path) -> Path:
    """Write a case as a rig and return the path of its TOML file; nothing in the folder tells the answer."""
    folder.mkdir(parents=True, exist_ok=True)
    if case.probe.radius is not None:
        shape = f"{{ sphere = {case.probe.radius!r} }}"
    else:
        shape = f"{{ box = [{', '.join(map(repr, case.probe.size))}] }}"
    words = "\n".join(
        f"{key} = {value!r}" if not isinstance(value, str) else f'{key} = "{value}"' for key, value in case.words.items()
    )
    uses = [use for use, count in TRIALS for _ in range(count)]
    lines = [
        'format = "palpate-rig/1"', f'name = "case {case.number}"', "[sensor]",
        f"grid = {{ rows = {ROWS}, columns = {COLUMNS}, pitch = [{PITCH!r}, {PITCH!r}] }}", words,
        "[indenter]", f"shape = {shape}",
    ]  # fmt: skip
    header = ["time", "x", "y", "z", *(f"texel_{i}" for i in range(ROWS * COLUMNS)), "force_x", "force_y", "force_z"]
    for i, use in enumerate(uses):
        lines += ["[[trial]]", f'file = "trial_{i}.csv"', f'use = "{use}"']
        table = np.hstack([case.times[i][:, None], case.paths[i], case.readings[i], case.forces[i]])
        with open(folder / f"trial_{i}.csv", "w", newline="") as file:
            out = csv.writer(file)
            out.writerow(header)
            out.writerows([[f"{value:.7g}" for value in row] for row in table])
    path = folder / "rig.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def without(case: Case) -> Case:
    """Return the case with nothing hidden and the same noise level, to see what an effect has done."""
    rng = np.random.default_rng(case.number)
    signals = [respond(case.probe, case.pad, time, path) for time, path in zip(case.times, case.paths, strict=True)]
    return replace(case, hidden=(), readings=[s.reading + case.noise * rng.normal(size=s.reading.shape) for s in signals])
