# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of :mod:`.cases` under other conditions (:data:`CONDITIONS`), with one hidden effect or two of another family.

Pad, indenter, trials, strength and size of the noise are those that the formula's kind has under the same number, so that a
condition can be compared with its absence case by case. ``friction`` and ``pairs`` hide other effects than their number says.
"""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from . import cases
from .world import COLUMNS, ROWS

CONDITIONS = ("coloured", "missing", "mesh", "friction", "pairs")
"""Coloured noise on readings and forces; empty cells of readings; a rig whose texels are the vertices of a mesh; friction or
nothing; two effects, both in formulas of :mod:`.third`."""
FORMULAS = ("own", "other", "third")
"""Whose formulas a case's number runs through."""
MISSING = ("2 %", "10 %", "40 %", "stretch")
"""What is missing: a share of all cells of readings, at random, or a stretch of one texel's column in each recording. A case's
number runs through them, one further after every round through the effects."""
SHARES = (0.02, 0.1, 0.4)
STRETCH = (0.2, 0.6)
"""Least and largest share of a recording that a stretch takes."""
NOTHING_EVERY = 4
"""One in so many cases of friction has nothing hidden."""


def draw(condition: str, number: int) -> cases.Case:
    """Return case `number` of a condition; the same every time."""
    if condition == "friction":
        return _friction(number)
    if condition == "pairs":
        return _pair(number)
    formula = FORMULAS[number % len(FORMULAS)]
    case = cases.draw(formula, number, coloured=True if condition == "coloured" else None)
    if condition == "missing":
        rng = np.random.default_rng([zlib.crc32(condition.encode()), number])
        return replace(case, readings=_emptied(case.readings, way_of(condition, number), rng))
    return case


def way_of(condition: str, number: int) -> str:
    """Return which of :data:`MISSING` a case has; "" for other conditions."""
    if condition != "missing":
        return ""
    rounds = number // len(cases.names_for("own"))
    return MISSING[(number + rounds) % len(MISSING)]


def _friction(number: int) -> cases.Case:
    """Effects on friction, in turn with each formula, or nothing."""
    if number % NOTHING_EVERY == NOTHING_EVERY - 1:
        return replace(cases.draw(FORMULAS[0], number, names=()), kind="none")
    place = number - number // NOTHING_EVERY  # of this case among those with something hidden
    name = cases.IN_FORCE[place // len(FORMULAS) % len(cases.IN_FORCE)]
    return cases.draw(FORMULAS[place % len(FORMULAS)], number, names=(name,))


def _pair(number: int) -> cases.Case:
    """Two effects in formulas of the third family."""
    plain = cases.draw("third", number, names=())
    names = cases.several_names(np.random.default_rng([zlib.crc32(b"pairs"), number]), 2, plain.probe.radius is not None)
    return replace(cases.draw("third", number, names=names), kind="two")


def _emptied(readings: list[np.ndarray], way: str, rng: np.random.Generator) -> list[np.ndarray]:
    """Readings (T, texels) of each recording with cells that are not numbers."""
    emptied = [reading.copy() for reading in readings]
    texel = rng.integers(readings[0].shape[1])
    for reading in emptied:
        if way == "stretch":
            length = round(rng.uniform(*STRETCH) * len(reading))
            first = rng.integers(len(reading) - length + 1)
            reading[first : first + length, texel] = np.nan
        else:
            reading[rng.random(reading.shape) < SHARES[MISSING.index(way)]] = np.nan
    return emptied


# --- files


def write(condition: str, case: cases.Case, folder: Path) -> Path:
    """Write a case as a rig, on a mesh if that is its condition, and return the path of its TOML file."""
    if condition != "mesh":
        return cases.write(case, folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "sensor.ply").write_text(_mesh(case), encoding="utf-8")
    return cases.write(case, folder, places='mesh = "sensor.ply"')


def _mesh(case: cases.Case) -> str:
    """A flat mesh of triangles that face up, as a PLY file; vertex i is texel i. Each square is cut along either diagonal."""
    rng = np.random.default_rng([zlib.crc32(b"mesh"), case.number])
    corner = (np.arange(ROWS - 1)[:, None] * COLUMNS + np.arange(COLUMNS - 1)).ravel()
    square = np.stack([corner, corner + 1, corner + COLUMNS + 1, corner + COLUMNS], axis=1)
    square = np.where(rng.integers(2, size=(len(square), 1)) > 0, square, np.roll(square, 1, axis=1))
    triangles = np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])
    lines = [
        "ply", "format ascii 1.0", f"element vertex {ROWS * COLUMNS}", *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header",
        *(f"{x!r} {y!r} 0" for x, y in case.pad.place.tolist()),
        *(f"3 {a} {b} {c}" for a, b, c in triangles.tolist()),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"
