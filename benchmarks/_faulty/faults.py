# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults that are put into recordings, as loggers and their users make them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .sensors import EFFECTS, FAMILIES, Measured

ALL, ONE = "all", "one"


@dataclass(frozen=True)
class FaultyCase:
    """A rig in files, the kind of its fault (empty for none), and the names of the recordings that have it."""

    family: str
    kind: str
    where: tuple[str, ...]
    effect: str
    path: Path


def _shifted(rng, one: Measured, plan: dict) -> None:
    drawn = float(rng.choice([-1, 1]) * rng.uniform(0.2, 1.2))
    if plan["scope"] == ALL and drawn > 0:
        drawn += 0.3  # a sensor may be late by less
    late = plan.setdefault("late", drawn)
    _resample(rng, one, lambda time: time - late)


def _apart(rng, one: Measured, plan: dict) -> None:
    rate = plan.setdefault("rate", float(rng.choice([-1, 1]) * rng.uniform(0.015, 0.05)))
    _resample(rng, one, lambda time: time[0] + (time - time[0]) * (1.0 + rate))


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


def _dropped(rng, one: Measured, plan: dict) -> None:
    lost, count = int(rng.uniform(0.25, 0.8) / one.step), len(one.columns["time"])
    start = int(rng.integers(count // 4, count // 2))
    index = np.arange(count)
    index[start:] += lost
    _take(rng, one, index)


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
    "clock-rate": (_apart, (ALL, ONE)),
    "swapped-channels": (_swapped, (ALL,)),
    "reversed-channels": (_reversed, (ALL,)),
    "stuck-logger": (_stuck, (ONE,)),
    "repeated-samples": (_repeated, (ALL, ONE)),
    "dropped-samples": (_dropped, (ONE,)),
    "unit": (_unit, (ALL, ONE)),
    "saturated-converter": (_railed, (ALL,)),
    "sign": (_negated, (ALL, ONE)),
}
"""Faults, and whether they are in all recordings or in one."""


def kinds_for(family: str) -> list[str]:
    """Return the faults that recordings of a family can show: channels under a plate all carry the same load."""
    return [kind for kind in KINDS if FAMILIES[family].has_places or not kind.endswith("-channels")]


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
        if kind in ("unit", "sign") and not made.in_newtons:
            scope = ONE  # nothing says what a count is
        hit = trials if scope == ALL else [trials[int(rng.integers(3))]]
        plan = {"scope": scope, "mixed": bool(rng.integers(2))}
        before = [dict(one.columns) for one in hit]
        for one in hit:
            act(rng, one, plan)
        where = tuple(one.name for one, columns in zip(hit, before, strict=True) if _differ(one.columns, columns))
    folder.mkdir(parents=True, exist_ok=True)
    lines = ['format = "palpate-rig/1"', f'name = "{family} {number}"', "[sensor]", made.sensor]
    for one in trials:
        lines += ["[[trial]]", f'file = "{one.name}.csv"', f'use = "{one.use}"']
        table = np.column_stack(list(one.columns.values()))
        rows = [",".join(f"{value:.9g}" for value in row) for row in table.tolist()]
        (folder / f"{one.name}.csv").write_text("\n".join([",".join(one.columns), *rows]) + "\n", encoding="utf-8")
    path = folder / "rig.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return FaultyCase(family, kind, where, effect, path)
