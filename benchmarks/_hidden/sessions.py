# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of one sensor that is recorded seven times: something goes on from recording to recording, or nothing does.

What the sensor remembers is computed along the whole session, with its pauses. The rig says it in one of three ways
(:data:`CLOCKS`): with `session` and `started`, with files that each begin at zero and no word of a session, or with one clock
that went on. Each case follows from its kind, its clock and its number alone. Cases numbered below 1000 have formulas of their
own (:data:`DEVELOPMENT`), so that rules are not set on those that judge them (:data:`SEALED`).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .rig_text import csv_header, rig_head

ROWS, COLUMNS, PITCH = 6, 4, 3.4e-3
RATE, SECONDS = 25.0, 14.0
RECORDINGS, CHECKED = 7, 2
CLOCKS = ("session", "own", "one")
KINDS = ("wear", "drift", "softening", "warm-up", "healthy")
FIRST_SEALED = 1000
NAMES = {"wear": "wear", "drift": "drift", "softening": "softening", "warm-up": "warm-up"}
"""What the library calls each of them."""

Act = Callable[[list[np.ndarray], list[np.ndarray]], list[np.ndarray]]
"""Forces and times (s since the session began) of all recordings, in order, to those that the sensor gives."""


@dataclass(frozen=True)
class Case:
    """A case: the names that are right, the rig's words, and times, paths and readings of each recording in order."""

    kind: str
    clock: str
    number: int
    answer: tuple[str, ...]
    radius: float
    words: dict
    starts: list[float]
    times: list[np.ndarray]
    paths: list[np.ndarray]
    readings: list[np.ndarray]
    checked: tuple[int, ...]


def draw(kind: str, clock: str, number: int) -> Case:
    """Return case `number` of a kind and a clock; the same every time."""
    rng = np.random.default_rng([zlib.crc32(f"{kind} {clock}".encode()), number])
    radius, k = rng.uniform(7e-3, 12e-3), float(np.exp(rng.uniform(np.log(30), np.log(120))))
    deep = rng.uniform(1.5e-3, 3e-3)
    programme = (_presses, _cycles)[rng.integers(2)]
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    paths = [_path(time, programme(rng, deep), radius) for _ in range(RECORDINGS)]
    pauses = np.exp(rng.uniform(np.log(5.0), np.log(rng.choice([30.0, 200.0])), RECORDINGS - 1))
    starts = np.concatenate([[0.0], np.cumsum(pauses + SECONDS)])
    forces = [pressed(places_of(), path, radius, k, time) for path in paths]
    if kind != "healthy":
        forms = DEVELOPMENT[kind] if number < FIRST_SEALED else SEALED[kind]
        act = forms[number % len(forms)](rng, k * deep, float(starts[-1] + SECONDS))
        forces = act(forces, [start + time for start in starts])
    noise = rng.uniform(0.003, 0.008) * max(float(np.abs(force).max()) for force in forces)
    readings = [force + noise * rng.normal(size=force.shape) for force in forces]
    words = {"k": float(f"{k * rng.uniform(0.9, 1.1):.3g}"), "cn": float(f"{0.01 * k:.3g}"), "unit": "N"}
    checked = tuple(sorted(int(i) for i in rng.choice(np.arange(1, RECORDINGS), CHECKED, replace=False)))
    answer = (NAMES[kind],) if kind != "healthy" else ()
    if kind == "warm-up" and clock == "own":
        answer = ("drift",)  # without a clock, a gain that moves by itself is a drift
    elif kind == "warm-up" and forms[number % len(forms)] is _warming_of_both:
        answer = ("warm-up", "drift")
    if clock == "own" and kind == "softening":
        answer = ("softening", "wear")  # the gain falls from file to file; that it stops to do so, few files show
    return Case(kind, clock, number, answer, radius, words, list(starts), [time] * RECORDINGS, paths, readings, checked)


def places_of() -> np.ndarray:
    """(n, 2) metres: x and y of each texel, row by row."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS] * PITCH
    return np.stack([x.ravel() - x.mean(), y.ravel() - y.mean()], axis=1)


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


def _path(time: np.ndarray, knots: list[tuple[float, float, float, float]], radius: float) -> np.ndarray:
    """The ball's middle (T, 3), m, on straight lines between (time, x, y, depth)."""
    table = np.array(knots)
    x, y, depth = (np.interp(time, table[:, 0], table[:, i]) for i in (1, 2, 3))
    return np.stack([x, y, radius - depth], axis=1)


def _places(rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 2) metres: places that together touch every texel, in any order."""
    y = rng.permutation(np.linspace(-0.33, 0.33, count)) * ROWS * PITCH
    return np.stack([rng.uniform(-0.3, 0.3, count) * COLUMNS * PITCH, y], axis=1)


def _presses(rng, deep):
    """Four places: pressed at several speeds, held, half unloaded and pressed again."""
    knots, t = [(0.0, 0.0, 0.0, -1e-3), (0.8, 0.0, 0.0, -1e-3)], 0.8
    for x, y in _places(rng, 4):
        depth, quick = deep * rng.uniform(0.5, 1.0), rng.uniform(0.15, 0.8)
        knots += [(t + 0.3, x, y, -1e-3), (t + 0.3 + quick, x, y, depth), (t + 1.3 + quick, x, y, depth)]
        t += 1.3 + quick
        knots += [(t + 0.3, x, y, 0.3 * depth), (t + 0.6, x, y, depth), (t + 0.9, x, y, -1e-3), (t + 1.2, x, y, -1e-3)]
        t += 1.2
    return [*knots, (max(SECONDS, t + 0.1), x, y, -1e-3)]


def _cycles(rng, deep):
    """Three places: four cycles each, of various depths and one period, and a hold at the last."""
    knots, t = [(0.0, 0.0, 0.0, -1e-3), (0.8, 0.0, 0.0, -1e-3)], 0.8
    for x, y in _places(rng, 3):
        knots += [(t + 0.3, x, y, -1e-3)]
        t += 0.3
        period = rng.uniform(0.5, 0.9)
        for share in rng.uniform(0.4, 1.0, 4):
            knots += [(t + period / 2, x, y, deep * share), (t + period, x, y, -2e-4)]
            t += period
    knots += [(t + 0.3, x, y, 0.8 * deep), (t + 1.8, x, y, 0.8 * deep), (t + 2.1, x, y, -1e-3)]
    return [*knots, (max(SECONDS, t + 2.2), x, y, -1e-3)]


# --- what goes on: a quantity that has grown along the session, and what it does


def _grown(forces: list[np.ndarray], rates: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """For each recording what each texel has gathered up to each sample, (T, n), if `rates` says what a sample adds."""
    before, found = np.zeros(forces[0].shape[1]), []
    for force in forces:
        gathered = before + np.cumsum(rates(force), axis=0)
        before = gathered[-1]
        found.append(gathered)
    return found


def _rises(force: np.ndarray) -> np.ndarray:
    """Load that each sample puts on, N."""
    return np.maximum(np.diff(force, axis=0, prepend=0.0), 0.0)


def _losing(rates: Callable[[np.ndarray], np.ndarray], left: Callable[[np.ndarray], np.ndarray]) -> Act:
    """The force times what is `left` of it, a function of the gathered over its mean of all touched texels at the end."""

    def act(forces, times):
        gathered = _grown(forces, rates)
        last = gathered[-1][-1]
        scale = float(last[last > 0].mean())
        return [force * left(own / scale) for force, own in zip(forces, gathered, strict=True)]

    return act


def _impulse_wear(rng, load, seconds):
    """A loss that goes with the root of the impulse."""
    most = rng.uniform(0.15, 0.35)
    return _losing(lambda force: force / RATE, lambda x: np.maximum(1.0 - most * np.sqrt(x), 0.1))


def _rational_wear(rng, load, seconds):
    """One over one plus the sum of loads put on."""
    most = rng.uniform(0.2, 0.5)
    return _losing(_rises, lambda x: 1.0 / (1.0 + most * x))


def _power_wear(rng, load, seconds):
    """A loss with a power of the integral of the squared load, after which nothing is left to lose."""
    most, power = rng.uniform(0.2, 0.4), rng.uniform(0.7, 1.2)
    return _losing(lambda force: force**2 / RATE, lambda x: 1.0 - 0.8 * np.tanh(most / 0.8 * x**power))


def _root_drift(rng, load, seconds):
    """The root of the time."""
    most = rng.uniform(0.06, 0.15) * load * rng.choice([-1, 1])
    return lambda forces, times: [f + most * np.sqrt(t / seconds)[:, None] for f, t in zip(forces, times, strict=True)]


def _logarithmic_drift(rng, load, seconds):
    """The logarithm of the time, a little different in each texel."""
    most, early = rng.uniform(0.06, 0.15) * load * rng.choice([-1, 1]), rng.uniform(0.05, 0.3) * seconds
    spread = 1.0 + 0.1 * rng.normal(size=ROWS * COLUMNS)

    def act(forces, times):
        shape = [np.log1p(t / early) / np.log1p(seconds / early) for t in times]
        return [f + most * s[:, None] * spread for f, s in zip(forces, shape, strict=True)]

    return act


def _swinging_drift(rng, load, seconds):
    """Half a swing of the room's temperature beside a steady rise."""
    most, phase = rng.uniform(0.05, 0.12) * load * rng.choice([-1, 1]), rng.uniform(-1.0, 1.0)

    def act(forces, times):
        shape = [t / seconds + 0.5 * (np.sin(np.pi * t / seconds + phase) - np.sin(phase)) for t in times]
        return [f + most * s[:, None] for f, s in zip(forces, shape, strict=True)]

    return act


def _rational_softening(rng, load, seconds):
    """Soft after a path of loads, by a rational law that soon comes to its end."""
    share, early = rng.uniform(0.2, 0.4), rng.uniform(0.04, 0.12)
    return _losing(_rises, lambda x: 1.0 - share * x**1.5 / (early**1.5 + x**1.5))


def _counted_softening(rng, load, seconds):
    """A loss that dies away with the count of loads of each texel, by a power of it (Basquin)."""
    share, power = rng.uniform(0.25, 0.4), rng.uniform(0.8, 1.5)

    def act(forces, times):
        threshold = 0.2 * load
        loads = _grown(forces, lambda f: np.diff(f > threshold, axis=0, prepend=False).clip(0).astype(float) * (f > threshold))
        return [
            f * (1.0 - share * (1.0 - (1.0 + np.maximum(n - 1.0, 0.0)) ** -power)) for f, n in zip(forces, loads, strict=True)
        ]

    return act


def _stepped_softening(rng, load, seconds):
    """Two kinds of bonds that break after a short and after a longer way of loads."""
    share, early = rng.uniform(0.25, 0.4), rng.uniform(0.02, 0.06)
    return _losing(_rises, lambda x: 1.0 - share * (1.0 - 0.5 * np.exp(-x / early) - 0.5 * np.exp(-x / (4.0 * early))))


def _exponential_warming(rng, load, seconds):
    """A gain that approaches its end by two exponentials."""
    most, tau = rng.uniform(0.15, 0.35) * rng.choice([-1, 1]), rng.uniform(0.1, 0.3) * seconds

    def act(forces, times):
        shape = [1.0 - 0.7 * np.exp(-t / tau) - 0.3 * np.exp(-t / (0.3 * tau)) for t in times]
        return [f * (1.0 + most * s)[:, None] for f, s in zip(forces, shape, strict=True)]

    return act


def _rational_warming(rng, load, seconds):
    """A gain that approaches its end by a rational law."""
    most, tau = rng.uniform(0.25, 0.5) * rng.choice([-1, 1]), rng.uniform(0.15, 0.4) * seconds
    return lambda forces, times: [f * (1.0 + most * t / (t + tau))[:, None] for f, t in zip(forces, times, strict=True)]


def _warming_of_both(rng, load, seconds):
    """Gain and zero follow one temperature that rises as a stretched exponential."""
    most, tau = rng.uniform(0.15, 0.3) * rng.choice([-1, 1]), rng.uniform(0.15, 0.4) * seconds
    zero = 0.15 * most * load

    def act(forces, times):
        shape = [1.0 - np.exp(-((t / tau) ** 0.7)) for t in times]
        return [f * (1.0 + most * s)[:, None] + zero * s[:, None] for f, s in zip(forces, shape, strict=True)]

    return act


DEVELOPMENT = {
    "wear": (_impulse_wear,),
    "drift": (_root_drift,),
    "softening": (_rational_softening,),
    "warm-up": (_exponential_warming,),
}
SEALED = {
    "wear": (_rational_wear, _power_wear),
    "drift": (_logarithmic_drift, _swinging_drift),
    "softening": (_counted_softening, _stepped_softening),
    "warm-up": (_rational_warming, _warming_of_both),
}


def write(case: Case, folder: Path) -> Path:
    """Write a case as a rig and return the path of its TOML file; nothing in the folder tells the answer."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = rig_head(f"session {case.number}", (ROWS, COLUMNS, PITCH), case.words, case.radius)
    header = csv_header(ROWS * COLUMNS)
    for i in range(RECORDINGS):
        lines += ["[[trial]]", f'file = "recording_{i}.csv"', f'use = "{"check" if i in case.checked else "fit"}"']
        if case.clock == "session":
            lines += ['session = "bench"', f"started = {case.starts[i]:.3f}"]
        time = case.times[i] + (case.starts[i] if case.clock == "one" else 0.0)
        table = np.column_stack([time, case.paths[i], case.readings[i]])
        np.savetxt(folder / f"recording_{i}.csv", table, "%.9g", ",", header=header, comments="")
    path = folder / "rig.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
