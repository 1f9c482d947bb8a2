# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of a sensor that is not mounted where its rig says: off in all six numbers, alone or beside one other effect.

A ball presses, holds and slides. The true contact is computed by moving the ball into the sensor's own frame; a library would
move the texels. Each case follows from its kind and number alone.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .rig_text import csv_header, rig_head

ROWS, COLUMNS, PITCH = 8, 6, 3.4e-3
RATE, SECONDS = 40.0, 16.0
TRIALS = ("fit", "fit", "fit", "fit", "check", "check")
KINDS = ("mounted", "mounted-beside")
LARGEST = {"shift": 2.5e-3, "height": 0.8e-3, "turn": 0.12, "tilt": 0.05}
"""Largest errors of a mounted sensor: metres along the surface and along the normal, rad about the normal and about the axes of
the surface; each number is at least a quarter of its largest."""


@dataclass(frozen=True)
class Mounting:
    """A case: its answer, the rig's words, and time, path and readings of each trial."""

    kind: str
    number: int
    answer: list[str]
    values: dict[str, float]
    radius: float
    words: dict
    times: list[np.ndarray]
    paths: list[np.ndarray]
    readings: list[np.ndarray]


def draw(kind: str, number: int) -> Mounting:
    """Return case `number` of a kind; the same every time."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), number])
    radius, k = rng.uniform(8e-3, 14e-3), float(np.exp(rng.uniform(np.log(30), np.log(120))))
    values = _values(rng)
    other = list(BESIDE)[number % len(BESIDE)] if kind == "mounted-beside" else ""
    times, paths = zip(*(_trial(rng, radius) for _ in TRIALS), strict=True)
    places = places_of()
    forces = [pressed(places, _into_sensor(path, values), radius, k, time) for path, time in zip(paths, times, strict=True)]
    if other:
        act = BESIDE[other](rng, k)
        forces = [act(force, time) for force, time in zip(forces, times, strict=True)]
    full = max(float(np.abs(force).max()) for force in forces)
    noise = rng.uniform(0.003, 0.008) * full
    readings = [force + noise * rng.normal(size=force.shape) for force in forces]
    words = {"k": float(f"{k * rng.uniform(0.9, 1.1):.3g}"), "cn": float(f"{0.01 * k:.3g}"), "unit": "N"}
    answer = ["misalignment", *([other] if other else [])]
    return Mounting(kind, number, answer, values, radius, words, list(times), list(paths), readings)


def draw_in_place(other: str, number: int, rate: float) -> Mounting:
    """Return a sensor with one effect of :data:`BESIDE` that is where its rig says, sampled at a rate (Hz)."""
    rng = np.random.default_rng([zlib.crc32(other.encode()), number])
    radius, k = rng.uniform(8e-3, 14e-3), float(np.exp(rng.uniform(np.log(30), np.log(120))))
    times, paths = zip(*(_trial(rng, radius, rate) for _ in TRIALS), strict=True)
    forces = [pressed(places_of(), path, radius, k, time) for path, time in zip(paths, times, strict=True)]
    act = BESIDE[other](rng, k)
    forces = [act(force, time) for force, time in zip(forces, times, strict=True)]
    noise = rng.uniform(0.003, 0.008) * max(float(np.abs(force).max()) for force in forces)
    readings = [force + noise * rng.normal(size=force.shape) for force in forces]
    words = {"k": float(f"{k * rng.uniform(0.9, 1.1):.3g}"), "cn": float(f"{0.01 * k:.3g}"), "unit": "N"}
    return Mounting("in-place", number, [other], {}, radius, words, list(times), list(paths), readings)


def thinned(case: Mounting, by: int) -> Mounting:
    """The same recordings with every `by`-th sample."""
    parts = {name: [one[::by] for one in getattr(case, name)] for name in ("times", "paths", "readings")}
    return replace(case, **parts)


def _values(rng) -> dict[str, float]:
    """The six numbers, each between a quarter of its largest value and that value, of either sign."""
    sizes = {"x": "shift", "y": "shift", "z": "height", "about_x": "tilt", "about_y": "tilt", "about_z": "turn"}
    return {name: float(LARGEST[size] * rng.uniform(0.25, 1.0) * rng.choice([-1, 1])) for name, size in sizes.items()}


def places_of(rows: int = ROWS, columns: int = COLUMNS) -> np.ndarray:
    """(n, 2) metres: x and y of each texel, row by row."""
    y, x = np.mgrid[0:rows, 0:columns] * PITCH
    return np.stack([x.ravel() - x.mean(), y.ravel() - y.mean()], axis=1)


def _into_sensor(path: np.ndarray, values: dict[str, float]) -> np.ndarray:
    """The ball's middle (T, 3) in the frame of a sensor that is turned and shifted by these values."""
    a, b, c = values["about_x"], values["about_y"], values["about_z"]
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return (path - np.array([values["x"], values["y"], values["z"]])) @ (about_x @ about_y @ about_z)


def pressed(places: np.ndarray, middle: np.ndarray, radius: float, k: float, time: np.ndarray) -> np.ndarray:
    """Spring and damper of each texel along the ball's normal, where the texel's own line meets the ball, (T, n) N."""
    away = middle[:, None, :2] - places
    left = radius**2 - (away**2).sum(axis=2)
    high = np.sqrt(np.maximum(left, 0.0))
    sunk = high - middle[:, 2:]
    depth = np.where((left > 0) & (sunk > 0), sunk * high / radius, 0.0)
    velocity = np.gradient(middle, time, axis=0)[:, None, :]
    normal = np.concatenate([-away, -high[:, :, None]], axis=2) / radius
    pace = (velocity * normal).sum(axis=2)
    return np.where(depth > 0, np.maximum(k * depth + 0.01 * k * pace, 0.0), 0.0)


def _trial(rng, radius: float, rate: float = RATE) -> tuple[np.ndarray, np.ndarray]:
    """Presses at five places: held, repeated, and slid along the surface."""
    knots = [(0.0, 0.0, 0.0, -1e-3), (0.8, 0.0, 0.0, -1e-3)]
    t = 0.8
    for y in rng.permutation(np.linspace(-0.35, 0.35, 4)) * ROWS * PITCH:
        x, deep, quick = rng.uniform(-0.3, 0.3) * COLUMNS * PITCH, rng.uniform(1.2e-3, 2.8e-3), rng.uniform(0.1, 0.8)
        knots += [(t + 0.3, x, y, -1e-3), (t + 0.3 + quick, x, y, deep), (t + 1.3 + quick, x, y, deep)]
        t += 1.3 + quick
        if rng.random() < 0.5:
            x = -x
            knots += [(t + 0.6, x, y, deep)]
            t += 0.6
        else:
            knots += [(t + 0.3, x, y, 0.3 * deep), (t + 0.6, x, y, deep)]
            t += 0.6
        knots += [(t + 0.3, x, y, -1e-3), (t + 0.7, x, y, -1e-3)]
        t += 0.7
    table = np.array([*knots, (max(t + 0.1, SECONDS), x, y, -1e-3)])
    time = np.arange(round(SECONDS * rate) + 1) / rate
    along = [np.interp(time, table[:, 0], table[:, i]) for i in (1, 2, 3)]
    return time, np.stack([along[0], along[1], radius - along[2]], axis=1)


# --- what is hidden beside it, in formulas of its own


def _creep(rng, k):
    """Relaxation by three equal exponentials."""
    amount, times = rng.uniform(0.25, 0.4), rng.uniform(0.3, 3.0, 3)

    def act(force, time):
        out, dt = force.copy(), time[1] - time[0]
        for tau in times:
            state = np.zeros(force.shape[1])
            for i in range(1, len(force)):
                state = state + (1.0 - np.exp(-dt / tau)) * (force[i] - state)
                out[i] -= amount / 3 * state
        return out

    return act


def _saturation(rng, k):
    """An arctangent, steep at first."""
    level = rng.uniform(1.0, 2.0) * k * 1.5e-3
    return lambda force, time: level * np.arctan(force / level)


def _gains(rng, k):
    """A gain for each texel, uniform."""
    gain = rng.uniform(0.7, 1.3, ROWS * COLUMNS)
    return lambda force, time: force * gain


def _drift(rng, k):
    """The root of the time, one rate for all texels."""
    most = rng.uniform(0.06, 0.15) * k * 2.5e-3 * rng.choice([-1, 1])
    return lambda force, time: force + most * np.sqrt(time / time[-1])[:, None]


def _lag(rng, k):
    """A moving mean over a window."""
    width = int(rng.integers(6, 14))

    def act(force, time):
        padded = np.vstack([np.repeat(force[:1], width - 1, axis=0), force])
        total = np.cumsum(np.vstack([np.zeros((1, force.shape[1])), padded]), axis=0)
        return (total[width:] - total[:-width]) / width

    return act


def _hysteresis(rng, k):
    """Coulomb elements of four breakaway forces, that stick and slip in parallel."""
    share, slips = rng.uniform(0.3, 0.5), np.array([0.02, 0.05, 0.1, 0.2]) * k * 2.5e-3

    def act(force, time):
        out = force.copy()
        for slip in slips:
            at = np.zeros(force.shape[1])
            for i in range(len(force)):
                at = np.clip(at, force[i] - slip, force[i] + slip)
                out[i] += share / len(slips) * (force[i] - at)
        return np.where(force > 0, out, 0.0)

    return act


def _stiffening(rng, k):
    """A hyperbolic sine of the force."""
    level = rng.uniform(0.5, 0.9) * k * 2.5e-3
    return lambda force, time: level * np.sinh(force / level)


BESIDE = {
    "creep": _creep,
    "saturation": _saturation,
    "gain-mismatch": _gains,
    "drift": _drift,
    "lag": _lag,
    "hysteresis": _hysteresis,
    "stiffening": _stiffening,
}


def write(case: Mounting, folder: Path) -> Path:
    """Write a case as a rig and return the path of its TOML file; nothing in the folder tells the answer."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = rig_head(f"mounting {case.number}", (ROWS, COLUMNS, PITCH), case.words, case.radius)
    header = csv_header(ROWS * COLUMNS)
    for i, use in enumerate(TRIALS):
        lines += ["[[trial]]", f'file = "trial_{i}.csv"', f'use = "{use}"']
        table = np.column_stack([case.times[i], case.paths[i], case.readings[i]])
        np.savetxt(folder / f"trial_{i}.csv", table, "%.7g", ",", header=header, comments="")
    path = folder / "rig.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
