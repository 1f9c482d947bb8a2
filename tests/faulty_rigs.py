# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs with a fault of the data, as loggers and their users make them, and healthy ones, by a generator of its own.

gel      a ball on a 6 × 4 grid, forces by a power law that relaxes, readings in newtons
counts   a ball on a 4 × 5 grid, readings that fall with the load like a resistance, in whole counts
foam     a plate on three channels of unequal gain, known depth, plateau of a foam, net force as well

Each sensor has one effect of its own or none, because a sensor with an effect is no fault of the data. The rules of
`core/gap/data_faults` were set on the family "gel", numbers below 1000.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.benchmarks._recordings import Recording

EFFECTS = ("none", "relaxes", "late", "loop", "gains", "offsets", "drifts", "bends", "steps", "shifted")
"""What a healthy sensor may do, by turns."""


@dataclass
class Measured:
    """One recording: columns by name, and which of them are stimulus and response."""

    name: str
    use: str
    columns: dict[str, np.ndarray]

    @property
    def responses(self) -> list[str]:
        """Names of the response columns."""
        return [name for name in self.columns if name.startswith(("texel_", "force_"))]

    @property
    def step(self) -> float:
        """Seconds between samples."""
        return float(self.columns["time"][1] - self.columns["time"][0])


@dataclass
class Family:
    """A family of sensors: lines of the rig above its trials, and a function that records them."""

    sensor: str
    record: Callable[[np.random.Generator, str], list[Measured]]


def _depths(rng, time: np.ndarray) -> np.ndarray:
    """Presses of unequal depth, speed and length over time, metres; negative without contact."""
    knots, values, t = [0.0, 0.7], [-8e-4, -8e-4], 0.7
    while t < time[-1]:
        deep, quick, hold, back = (
            rng.uniform(0.8e-3, 2.4e-3),
            rng.uniform(0.15, 1.2),
            rng.uniform(0.1, 2.5),
            rng.uniform(0.2, 1.0),
        )
        for length, depth in ((quick, deep), (hold, deep), (back, -8e-4), (rng.uniform(0.3, 0.9), -8e-4)):
            t += length
            knots.append(t)
            values.append(depth)
    return np.interp(time, knots, values)


def _low_passed(signal: np.ndarray, share: float) -> np.ndarray:
    """Exponential mean with a share of the new sample."""
    from scipy.signal import lfilter

    return lfilter([share], [1.0, share - 1.0], signal, axis=0)


def _acted(effect: str, rng_seed: int, force: np.ndarray, step: float) -> np.ndarray:
    """Forces or readings (T, n) of a sensor with an effect, before noise; the same sensor for the same seed."""
    rng, n, full = np.random.default_rng(rng_seed), force.shape[1], float(np.abs(force).max())
    if effect == "relaxes":
        share = rng.uniform(0.15, 0.35)
        return force - share * sum(_low_passed(force, step / tau) for tau in (0.3, 1.1, 5.0)) / 3.0
    if effect == "late":
        return _low_passed(_low_passed(force, min(1.0, step / rng.uniform(0.03, 0.12))), 0.6)
    if effect == "loop":
        width, held = 0.12 * full, np.zeros(n)
        out = np.empty_like(force)
        for t, now in enumerate(force):
            held = np.clip(held, now - width, now + width)
            out[t] = 0.75 * now + 0.25 * np.maximum(held, 0.0)
        return out
    if effect == "gains":
        return force * rng.uniform(0.7, 1.3, n)
    if effect == "offsets":
        return force + 0.06 * full * rng.normal(size=n)
    if effect == "drifts":
        time = step * np.arange(len(force))[:, None]
        return force + 0.1 * full * (1.0 - np.exp(-time / rng.uniform(4.0, 20.0)))
    if effect == "bends":
        return 0.6 * full * np.tanh(force / (0.6 * full))
    if effect == "steps":
        size = full / rng.integers(30, 120)
        return size * np.round(force / size)
    return force


def _ball(rows: int, columns: int, pitch: float, rng, time: np.ndarray, moved: np.ndarray) -> tuple[dict, np.ndarray]:
    """Pose columns of a ball of 9 mm that presses here and there, and depths (T, n) of the texels."""
    depth, radius = _depths(rng, time), 9e-3
    jumps = np.cumsum(np.diff(depth > 0, prepend=False) & (depth <= 0))  # a new place after each press
    spots = rng.uniform(-0.35, 0.35, (int(jumps[-1]) + 1, 2)) * [columns * pitch, rows * pitch]
    place = spots[jumps]
    row, column = np.divmod(np.arange(rows * columns), columns)
    x = (column - 0.5 * (columns - 1)) * pitch + moved[0]
    y = (row - 0.5 * (rows - 1)) * pitch + moved[1]
    away = (x - place[:, :1]) ** 2 + (y - place[:, 1:]) ** 2
    height = np.sqrt(np.maximum(radius**2 - away, 0.0))
    sunk = np.maximum(height - (radius - depth)[:, None], 0.0) * height / radius
    return {"x": place[:, 0], "y": place[:, 1], "z": radius - depth}, sunk


def _recorded(name: str, use: str, time, stimulus: dict, readings: np.ndarray) -> Measured:
    return Measured(name, use, {"time": time, **stimulus, **{f"texel_{i}": r for i, r in enumerate(readings.T)}})


def _gel(rng, effect: str) -> list[Measured]:
    seed, k, step = int(rng.integers(2**31)), rng.uniform(70, 90), 1.0 / rng.choice([40, 50, 60])
    moved = rng.uniform(-1e-3, 1e-3, 2) if effect == "shifted" else np.zeros(2)
    made = []
    for i in range(4):
        time = step * np.arange(int(rng.uniform(14.0, 22.0) / step))
        stimulus, depth = _ball(6, 4, 3.2e-3, rng, time, moved)
        force = k * depth * (1.0 + 0.3 * depth / 2e-3)
        force = _acted(effect, seed, force, step)
        force = force + rng.uniform(0.003, 0.008) * force.max() * rng.normal(size=force.shape)
        made.append(_recorded(f"r{i}", "check" if i == 3 else "fit", time, stimulus, force))
    return made


def _counts(rng, effect: str) -> list[Measured]:
    seed, step = int(rng.integers(2**31)), 1.0 / rng.choice([30, 80])
    moved = rng.uniform(-1e-3, 1e-3, 2) if effect == "shifted" else np.zeros(2)
    made = []
    for i in range(4):
        time = step * np.arange(int(rng.uniform(12.0, 25.0) / step))
        stimulus, depth = _ball(4, 5, 4e-3, rng, time, moved)
        load = _acted(effect, seed, 60.0 * depth**1.1 / 1e-3**0.1, step)
        reading = 3200.0 - 2400.0 * load / (load.max() + np.abs(load)) + rng.uniform(2.0, 6.0) * rng.normal(size=load.shape)
        made.append(_recorded(f"r{i}", "check" if i == 3 else "fit", time, stimulus, np.round(reading)))
    return made


def _foam(rng, effect: str) -> list[Measured]:
    seed, step, made = int(rng.integers(2**31)), 1.0 / rng.choice([50, 100]), []
    for i in range(4):
        time = step * np.arange(int(rng.uniform(12.0, 18.0) / step))
        depth = _depths(rng, time)
        strain = np.maximum(depth, 0.0)[:, None] / 4e-3
        total = 30.0 * (strain + 0.5 * strain**4 - 0.3 * strain**2) * 4e-3
        force = _acted(effect, seed, np.repeat(total * 80.0 / 30.0, 3, axis=1) * [1.1, 0.9, 1.0], step)
        noise = 0.005 * float(np.abs(force).max())
        net = np.stack([0.0 * time, 0.0 * time, -force.sum(axis=1)], axis=1) + 2.0 * noise * rng.normal(size=(len(time), 3))
        one = _recorded(
            f"r{i}", "check" if i == 3 else "fit", time, {"depth": depth}, force + noise * rng.normal(size=force.shape)
        )
        one.columns |= {f"force_{axis}": net[:, j] for j, axis in enumerate("xyz")}
        made.append(one)
    return made


FAMILIES = {
    "gel": Family(
        "grid = { rows = 6, columns = 4, pitch = 0.0032 }\nthickness = 0.006\nk = 85.0\n[indenter]\nshape = { sphere = 0.009 }",
        _gel,
    ),
    "counts": Family(
        'grid = { rows = 4, columns = 5, pitch = 0.004 }\nthickness = 0.006\nunit = "counts"\n'
        "[indenter]\nshape = { sphere = 0.009 }",
        _counts,
    ),
    "foam": Family("grid = { rows = 1, columns = 3, pitch = 0.01 }\nthickness = 0.006\nk = 75.0", _foam),
}


# --- faults

ALL, ONE = "all", "one"


@dataclass(frozen=True)
class FaultyCase:
    """A rig in files, the kind of its fault (empty for none), and the names of the recordings that have it."""

    kind: str
    where: tuple[str, ...]
    path: Path


def _shifted(rng, one: Measured, plan: dict) -> None:
    drawn = float(rng.choice([-1, 1]) * rng.uniform(0.2, 1.2))
    if plan["scope"] == ALL and drawn > 0:
        drawn += 0.3  # a sensor may be late by less
    late = plan.setdefault("late", drawn)
    _resample(rng, one, lambda time: time - late)


def _resample(rng, one: Measured, clock: Callable[[np.ndarray], np.ndarray]) -> None:
    """Take each response at another time; noise is that of the nearest sample, so that nothing is smoothed."""
    time = one.columns["time"]
    _take(rng, one, np.round((clock(time) - time[0]) / one.step).astype(int))


def _take(rng, one: Measured, index: np.ndarray) -> None:
    """Take the responses of other samples; before and after the recording the sensor rests, as in its first half second."""
    resting = rng.integers(0, int(0.5 / one.step), len(index))
    index = np.where((index >= 0) & (index < len(index)), index, resting)
    for name in one.responses:
        one.columns[name] = one.columns[name][index]


def _swapped(rng, one: Measured, plan: dict) -> None:
    names = [name for name in one.responses if name.startswith("texel_")]
    pairs = plan.setdefault("pairs", rng.permutation(len(names))[: 2 * int(rng.integers(1, 4))].reshape(-1, 2))
    for a, b in pairs:
        one.columns[names[a]], one.columns[names[b]] = one.columns[names[b]], one.columns[names[a]]


def _reversed(rng, one: Measured, plan: dict) -> None:
    names = [name for name in one.responses if name.startswith("texel_")]
    values = [one.columns[name] for name in names][::-1]
    one.columns.update(zip(names, values, strict=True))


def _stuck(rng, one: Measured, plan: dict) -> None:
    length, count = int(rng.uniform(0.8, 2.5) / one.step), len(one.columns["time"])
    start = int(rng.integers(count // 5, count - length - 5))
    for name in one.responses:
        one.columns[name] = one.columns[name].copy()
        one.columns[name][start : start + length] = one.columns[name][start]


def _repeated(rng, one: Measured, plan: dict) -> None:
    every = plan.setdefault("every", int(rng.integers(2, 6)))
    index = np.arange(len(one.columns["time"])) // every * every
    for name in one.responses:
        one.columns[name] = one.columns[name][index]


def _unit(rng, one: Measured, plan: dict) -> None:
    factor = plan.setdefault("factor", float(rng.choice([10.0, 0.1, 9.81, 1 / 9.81])))
    for name in one.responses:
        if name.startswith("texel_"):
            one.columns[name] = one.columns[name] * factor


def _railed(rng, one: Measured, plan: dict) -> None:
    names = [name for name in one.responses if name.startswith("texel_")]
    values = np.stack([one.columns[name] for name in names])
    rest = np.median(values[:, : int(0.5 / one.step)])  # a converter has one rail: the same side in all recordings
    sign = plan.setdefault("side", 1.0 if values.max() - rest > rest - values.min() else -1.0)
    rail = plan.setdefault("rail", float(rest + sign * rng.uniform(0.45, 0.8) * np.abs(values - rest).max()))
    for name in names:
        one.columns[name] = np.minimum(one.columns[name], rail) if sign > 0 else np.maximum(one.columns[name], rail)


def _negated(rng, one: Measured, plan: dict) -> None:
    for name in one.responses:
        if name.startswith("texel_") or not plan["mixed"]:
            one.columns[name] = -one.columns[name]


KINDS: dict[str, tuple[Callable, tuple[str, ...]]] = {
    "clock-shift": (_shifted, (ALL, ONE)),
    "swapped-channels": (_swapped, (ALL,)),
    "reversed-channels": (_reversed, (ALL,)),
    "stuck-logger": (_stuck, (ONE,)),
    "repeated-samples": (_repeated, (ALL, ONE)),
    "unit": (_unit, (ALL, ONE)),
    "saturated-converter": (_railed, (ALL,)),
    "sign": (_negated, (ALL, ONE)),
}
"""Faults, and whether they are in all recordings or in one."""


def _differ(columns: dict[str, np.ndarray], before: dict[str, np.ndarray]) -> bool:
    """Whether a fault changed anything: a recording may never come near a rail."""
    return any(not np.array_equal(columns[name], before[name]) for name in columns)


def draw(family: str, kind: str, number: int, folder: Path) -> FaultyCase:
    """Write case `number` of a family and a fault (empty for none) into a folder; the same every time."""
    rng = np.random.default_rng([sum(map(ord, family)), sum(map(ord, kind or "healthy")), number])
    made, effect = FAMILIES[family], EFFECTS[number % len(EFFECTS)]
    trials = made.record(rng, effect)
    where: tuple[str, ...] = ()
    if kind:
        act, scopes = KINDS[kind]
        scope = scopes[int(rng.integers(len(scopes)))]
        hit = trials if scope == ALL else [trials[int(rng.integers(3))]]
        plan = {"scope": scope, "mixed": bool(rng.integers(2))}
        before = [dict(one.columns) for one in hit]
        for one in hit:
            act(rng, one, plan)
        where = tuple(one.name for one, columns in zip(hit, before, strict=True) if _differ(one.columns, columns))
    trials = [(one.name, one.use, one.columns) for one in trials]
    path = Recording(f"{family} {number}", made.sensor, trials).write(folder)
    return FaultyCase(kind, where, path)


def is_right(case: FaultyCase, said: list[tuple[str, tuple[str, ...]]]) -> bool:
    """Return whether exactly the fault of a case is said (kind, recordings)."""
    recordings = {name for kind, names in said for name in names if kind == case.kind}
    return {kind for kind, _ in said} == {case.kind} and recordings == set(case.where)
