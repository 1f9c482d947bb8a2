# SPDX-License-Identifier: GPL-3.0-or-later
"""Features of a rig, and those of simulated cases, from which the methods of :mod:`._learned` learn what hides in a rig.

The features say what the residual of a refitted base model does with depth, speed, history, places and the clock. The simulated
cases have none to three effects in the library's own forms (kind "simulated" of ``_hidden.cases``). Their features take ten
minutes of one core, once; they are kept in build/gap, and more are added to them.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import sys
import tomllib
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from ._hidden import cases
from ._hidden.world import COLUMNS, PITCH, ROWS, Contact, Pad, Probe, touch

COUNT = 1000
"""Simulations that the methods learn from."""
FIRST = 10_000_000
"""Number of the first of them."""
LABELS = (*cases.ORDER, "nothing")
GRID = Pad(*(1.0,) * 10, "N")
"""Of which only the places of the texels count."""
EVERY = 4
"""Every so many samples are fitted."""
STILL = 1e-5
"""Slower than this, m/s, a texel's depth stands still: files have seven digits."""
SPEEDS = (1e-3, 7e-3, 2e-2, 6e-2, 1.0)
"""Bounds of the speeds of sliding that are told apart, m/s."""

Trial = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Times (T,), the probe's path (T, 3), readings (T, n), forces (T, 3)."""


# --- features


def read(rig: Path) -> tuple[Probe, list[Trial]]:
    """Read what :func:`features` needs from a rig of the benchmark."""
    table = tomllib.loads(rig.read_text(encoding="utf-8"))
    grid = table["sensor"].get("grid", {})
    if (grid.get("rows"), grid.get("columns"), grid.get("pitch")) != (ROWS, COLUMNS, [PITCH, PITCH]):
        raise ValueError(f"{rig} has another grid than the simulations: the methods that learn from them cannot say anything")
    shape = table["indenter"]["shape"]
    probe = Probe(shape["sphere"], None) if "sphere" in shape else Probe(None, tuple(shape["box"]))
    trials = []
    for trial in table["trial"]:
        with (rig.parent / trial["file"]).open(encoding="utf-8", newline="") as file:
            header = next(csv.reader(file))
            values = np.loadtxt(file, delimiter=",")
        column = {name: values[:, i] for i, name in enumerate(header)}
        reading = np.stack([column[f"texel_{i}"] for i in range(ROWS * COLUMNS)], axis=1)
        path, force = (np.stack([column[name] for name in names], axis=1) for names in ("xyz", [f"force_{a}" for a in "xyz"]))
        trials.append((column["time"], path, reading, force))
    return probe, trials


def features(probe: Probe, trials: list[Trial]) -> np.ndarray:
    """(p,) float: what a refitted base model leaves of a rig's recordings, in numbers without units."""
    contacts = [touch(probe, GRID, time, path) for time, path, _, _ in trials]
    contacts = [replace(c, pace=np.where(np.abs(c.pace) > STILL, c.pace, 0.0)) for c in contacts]
    base = [np.stack([np.ones_like(c.depth), c.depth, c.pace], axis=-1).reshape(-1, 3) for c in contacts]
    gram, along = (sum(x.T @ y for x, y in zip(base, some, strict=True)) for some in (base, [t[2].ravel() for t in trials]))
    weights = np.linalg.solve(gram + 1e-12 * np.diag(np.diag(gram)), along)
    full = max(float(np.abs(t[2] - weights[0]).max()) for t in trials)
    left = [(t[2] - (b @ weights).reshape(t[2].shape)) / full for t, b in zip(trials, base, strict=True)]
    deep = max(float(c.depth.max()) for c in contacts)
    found = [*_explained(probe, contacts, left, deep), *_curves(contacts, left, deep), *_noise(contacts, trials, left, deep)]
    found += [*_texels(contacts, left, deep), *_forces(contacts, trials)]
    return np.nan_to_num(np.arcsinh(np.array(found, dtype=float)), posinf=0.0, neginf=0.0)


def _columns(probe: Probe, c: Contact, deep: float) -> dict[str, list[np.ndarray]]:
    """(T, n) each: what may explain a residual, by groups."""
    from scipy.signal import lfilter

    x, dt = c.depth / deep, float(c.time[1] - c.time[0])
    held, v = x > 0, c.pace / deep
    most = np.maximum.accumulate(x, axis=0)
    put_on = np.cumsum(np.maximum(np.diff(x, axis=0, prepend=0.0), 0.0), axis=0)
    settled = [lfilter([1 - np.exp(-dt / tau)], [1, -np.exp(-dt / tau)], x, axis=0) for tau in (0.15, 0.6, 2.5, 10.0)]
    clock = ((c.time - c.time[0]) / (c.time[-1] - c.time[0]))[:, None] + np.zeros_like(x)
    grid = x.reshape(-1, ROWS, COLUMNS)
    around = np.zeros_like(grid)
    around[:, 1:] += grid[:, :-1]
    around[:, :-1] += grid[:, 1:]
    around[:, :, 1:] += grid[:, :, :-1]
    around[:, :, :-1] += grid[:, :, 1:]
    along = [np.broadcast_to(grid.mean(axis=axis, keepdims=True), grid.shape).reshape(x.shape) for axis in (1, 2)]
    pose = [touch(probe, GRID, c.time, c.path + 1e-4 * step).depth / deep - x for step in np.eye(3)[:2]]
    return {
        "curve": [x**2, x**3, held.astype(float), np.minimum(x, 0.2)],
        "rate": [v, np.gradient(v, dt, axis=0)],
        "loop": [np.sign(v) * held, np.sign(v) * x, x * (v < 0), (v < 0) * np.exp(-((x / 0.15) ** 2)) * held],
        "settling": settled,
        "deepest": [most - x, x * most, x * np.sqrt(most - x)],
        "wear": [x * put_on, x * np.sqrt(put_on)],
        "clock": [clock, np.sqrt(clock), x * clock],
        "neighbours": [around.reshape(x.shape)],
        "lines": along,
        "pose": pose,
    }


def _explained(probe: Probe, contacts: list[Contact], left: list[np.ndarray], deep: float) -> list[float]:
    """What each group of columns explains by itself, with which weights, and what all of them leave."""
    made = [_columns(probe, c, deep) for c in contacts]
    groups = {name: len(some) for name, some in made[0].items()}
    stacked = [np.stack([p[::EVERY].ravel() for some in one.values() for p in some], axis=1) for one in made]
    targets = [r[::EVERY].ravel() for r in left]
    gram = sum(a.T @ a for a in stacked)
    along = sum(a.T @ r for a, r in zip(stacked, targets, strict=True))
    total, rows = sum(float(r @ r) for r in targets), sum(len(r) for r in targets)
    size = np.sqrt(np.diag(gram) + 1e-12)
    found, start = [10.0 * np.sqrt(total / rows)], 0
    for count in (*groups.values(), len(size)):
        here = slice(start, start + count) if count < len(size) else slice(0, count)
        scaled = gram[here, here] / np.outer(size[here], size[here]) + 1e-6 * np.eye(count)
        right = along[here] / size[here]
        weights = np.linalg.solve(scaled, right)
        found += [float(weights @ right) / max(total, 1e-30), *(weights / np.sqrt(max(total, 1e-30)))]
        start += count
    return found


def _curves(contacts: list[Contact], left: list[np.ndarray], deep: float) -> list[float]:
    """Mean residuals over depth, on the way in, held and out, and without load over the time."""
    x, r = (np.concatenate([one.ravel() for one in some]) for some in ([c.depth / deep for c in contacts], left))
    v = np.concatenate([(c.pace / deep).ravel() for c in contacts])
    t = np.concatenate([np.broadcast_to(((c.time - c.time[0]) / 25.0)[:, None], c.depth.shape).ravel() for c in contacts])
    found = []
    for way in (v > 0.02, np.abs(v) <= 0.02, v < -0.02):
        held = way & (x > 0)
        bins = np.minimum((x[held] * 6).astype(int), 5)
        count = np.bincount(bins, minlength=6)
        found += list(30.0 * np.bincount(bins, r[held], minlength=6) / np.maximum(count, 1))
    free = x == 0
    bins = np.minimum((t[free] * 4).astype(int), 3)
    return found + list(30.0 * np.bincount(bins, r[free], minlength=4) / np.maximum(np.bincount(bins, minlength=4), 1))


def _noise(contacts: list[Contact], trials: list[Trial], left: list[np.ndarray], deep: float) -> list[float]:
    """How readings shake, over depth, and whether they come in steps."""
    x = np.concatenate([c.depth[1:-1].ravel() / deep for c in contacts])
    shake = np.concatenate([(r[1:-1] - 0.5 * (r[2:] + r[:-2])).ravel() for r in left])
    free = shake[x == 0]
    quiet = float(np.std(free)) if len(free) > 10 else float(np.std(shake))
    found = [np.log(quiet + 1e-4)]
    for low, high in ((1e-9, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 2.0)):
        some = shake[(x > low) & (x <= high)]
        found.append(np.log((np.median(np.abs(some)) + 1e-4) / (quiet + 1e-4)) if len(some) > 10 else 0.0)
        found.append(np.log((np.std(some) + 1e-4) / (quiet + 1e-4)) if len(some) > 10 else 0.0)
    moving = [(np.abs(np.diff(r, axis=0)) < 1e-5)[np.abs(c.pace[1:]) > 0] for c, r in zip(contacts, left, strict=True)]
    found.append(float(np.concatenate(moving).mean()) if sum(map(len, moving)) else 0.0)
    size = max(float(np.abs(t[2]).max()) for t in trials)
    found.append(float(np.mean([len(np.unique(np.round(t[2] / size, 5))) / 1e4 for t in trials])))
    calm = [(r[1:] * r[:-1])[(c.depth[1:] == 0)].sum() for c, r in zip(contacts, left, strict=True)]
    power = [(r[1:] ** 2)[(c.depth[1:] == 0)].sum() for c, r in zip(contacts, left, strict=True)]
    return [*found, float(sum(calm) / max(sum(power), 1e-30))]


def _texels(contacts: list[Contact], left: list[np.ndarray], deep: float) -> list[float]:
    """How texels differ in gain and offset, how rows and columns share in it, and which hardly respond."""
    x, r = (np.concatenate(some) for some in ([c.depth / deep for c in contacts], left))
    free = (x == 0).astype(float)
    offset = (r * free).sum(axis=0) / np.maximum(free.sum(axis=0), 1.0)
    slope = ((r - offset) * x).sum(axis=0) / np.maximum((x**2).sum(axis=0), 1e-9)
    touched = x.max(axis=0) > 0.2
    found = []
    for values in (offset, np.where(touched, slope, np.median(slope[touched]) if touched.any() else 0.0)):
        grid = (values - np.median(values)).reshape(ROWS, COLUMNS)
        total = float((grid**2).sum()) + 1e-12
        sides = [float((grid.mean(axis=axis) ** 2).sum()) * grid.shape[axis] / total for axis in (0, 1)]
        smooth = float((np.diff(grid, axis=0) ** 2).sum() + (np.diff(grid, axis=1) ** 2).sum()) / total
        found += [30.0 * np.sqrt(total / values.size), *sides, smooth, 3.0 * grid.min(), 3.0 * grid.max()]
    still = np.concatenate(left).std(axis=0) + 1e-9
    return [
        *found,
        float((slope[touched] < -0.5).mean()) if touched.any() else 0.0,
        float(np.log(still.max() / np.median(still))),
    ]


def _forces(contacts: list[Contact], trials: list[Trial]) -> list[float]:
    """Friction over speed, and the normal force that a line of depths leaves, on the way in, held and out."""
    lift = np.concatenate([(c.depth * c.normal[..., 2]).sum(axis=1) for c in contacts])
    force = np.concatenate([t[3] for t in trials])
    pace = np.concatenate([c.velocity[:, 2] for c in contacts])
    slide = np.concatenate([np.linalg.norm(c.velocity[:, :2], axis=1) for c in contacts])
    along = float(lift @ force[:, 2]) / max(float(lift @ lift), 1e-30)
    most = max(float(np.abs(force[:, 2]).max()), 1e-30)
    rest = (force[:, 2] - along * lift) / most
    load = np.abs(lift * along) / most
    found = [10.0 * float(rest.std())]
    for way in (pace < -1e-4, np.abs(pace) <= 1e-4, pace > 1e-4):
        for low, high in ((0.02, 0.3), (0.3, 1.5)):
            some = rest[way & (load > low) & (load <= high)]
            found.append(30.0 * float(some.mean()) if len(some) else 0.0)
    share = np.linalg.norm(force[:, :2], axis=1) / np.maximum(np.abs(force[:, 2]), 1e-30)
    sliding = (load > 0.2) & (slide > SPEEDS[0])
    means = []
    for low, high in zip(SPEEDS[:-1], SPEEDS[1:], strict=True):
        some = share[sliding & (slide > low) & (slide <= high)]
        means.append(float(np.median(some)) if len(some) > 5 else np.nan)
    middle = float(np.nanmean(means)) if np.isfinite(means).any() else 0.0
    bend = np.corrcoef(share[sliding], load[sliding])[0, 1] if sliding.sum() > 20 else 0.0
    return [*found, middle, *(10.0 * (m - middle) if np.isfinite(m) else 0.0 for m in means), float(bend)]


# --- simulations


def _simulated(number: int) -> dict[str, Any]:
    case = cases.draw("simulated", number)
    trials = list(zip(case.times, case.paths, case.readings, case.forces, strict=True))
    return {"number": number, "features": features(case.probe, trials).tolist(), "answer": case.answer}


def simulations(count: int | None = None, first: int = FIRST, folder: Path | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return features (N, p) of simulated cases and what they hold, (N, labels) bool; those that are missing are computed.

    Parameters
    ----------
    count : int, optional
        How many; by default as many as PALPATE_GAP_SIMULATIONS says, or :data:`COUNT`.
    first : int
        Number of the first.
    folder : path, optional
        Where they are kept, instead of build/gap.
    """
    count = int(os.environ.get("PALPATE_GAP_SIMULATIONS", str(COUNT))) if count is None else count
    house = Path(__file__).resolve().parent
    sources = [Path(__file__), *(house / "_hidden" / f"{name}.py" for name in ("cases", "own", "world"))]
    seen = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]
    folder = house.parent / "build" / "gap" if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"simulated-{seen}.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    kept = {one["number"]: one for one in map(json.loads, lines)}
    missing = [number for number in range(first, first + count) if number not in kept]
    if missing:
        print(f"Features of {len(missing)} simulated cases are computed once and kept in {path}.", file=sys.stderr, flush=True)
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        processes = int(os.environ.get("PALPATE_GAP_PROCESSES", "2"))
        with ProcessPoolExecutor(processes, get_context("spawn")) as pool, path.open("a", encoding="utf-8") as file:
            for one in pool.map(_simulated, missing):
                file.write(json.dumps(one) + "\n")
                file.flush()
                kept[one["number"]] = one
    chosen = [kept[number] for number in range(first, first + count)]
    holds = [[label in (one["answer"] or ["nothing"]) for label in LABELS] for one in chosen]
    return np.array([one["features"] for one in chosen]), np.array(holds)
