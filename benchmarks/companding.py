# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps behind a converter that compands: of how many readings with steps they are seen, and how often without.

A ball presses a few texels with random depths. Of the readings with steps the converter is even after a square root, another
power from 0.5 to 2, a logarithm or the µ-law, has 6 to 12 bits, and noise acts before it. Without steps the readings have
noise alone, or hardly any, so that smooth presses themselves are regular. ``PALPATE_COMPANDING_CASES``
says how many have steps (default 120; as many have none), ``PALPATE_COMPANDING_SEED`` which.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator

import numpy as np

from palpate.core.gap.selection.companded_steps import CompandedSteps, companded_steps
from palpate.core.gap.selection.direct_estimates import even_steps, few_levels

MIDDLE_DEPTH = 3e-3


def presses(rng: np.random.Generator) -> np.ndarray:
    """Return loads (t, n) of a few texels under a ball, the largest about 1: smooth presses and cycles."""
    texels, number = int(rng.choice([1, 4, 16, 40])), int(rng.integers(3, 8))
    across = rng.uniform(0.0, 2e-3, texels) ** 2 / 16e-3
    gains = np.exp(0.1 * rng.standard_normal(texels))
    parts = []
    for _ in range(number):
        t = np.linspace(0.0, 1.0, int(rng.integers(120, 500)))
        depth = rng.uniform(0.4, 1.0) * MIDDLE_DEPTH * np.sin(np.pi * t) ** float(rng.choice([1.0, 2.0]))
        parts.append(gains * np.maximum(depth[:, None] - across, 0.0) / MIDDLE_DEPTH)
    return np.concatenate(parts)


def converter(rng: np.random.Generator, kind: str, full: float) -> tuple[Callable[..., np.ndarray], Callable[..., np.ndarray]]:
    """Return a converter of loads up to `full`, and the width of its step at a load."""
    steps = 2.0 ** int(rng.integers(6, 13))
    if kind in ("square root", "power"):
        p = 0.5 if kind == "square root" else float(rng.uniform(0.5, 2.0))
        rounding = float(rng.choice([0.0, 0.5]))

        def convert(load: np.ndarray) -> np.ndarray:
            code = np.floor(steps * (np.abs(load) / full) ** p + rounding)
            return np.asarray(np.sign(load) * full * (code / steps) ** (1.0 / p))

        return convert, lambda load: full / steps / p * (load / full) ** (1.0 - p)
    mu = 255.0 if kind == "mu-law" else float(np.exp(rng.uniform(np.log(5.0), np.log(300.0))))

    def compand(load: np.ndarray) -> np.ndarray:
        code = np.floor(steps * np.log1p(mu * np.abs(load) / full) / np.log1p(mu))
        return np.asarray(np.sign(load) * full / mu * np.expm1(code / steps * np.log1p(mu)))

    return compand, lambda load: np.log1p(mu) / mu * (full + mu * load) / steps


def moving(load: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Readings at which the load changes, at most 6000, as in the gap analysis."""
    found = reading[np.abs(np.gradient(load, axis=0)) > 1e-5]
    return np.asarray(found[:: max(1, len(found) // 6000)])


Width = Callable[..., np.ndarray]


def with_steps(seed: int) -> tuple[str, np.ndarray, float, Width]:
    """Return the kind of a companding converter, readings behind it, their noise, and the width of a step at a reading."""
    rng = np.random.default_rng([7, seed])
    kind = ("square root", "power", "logarithm", "mu-law")[seed % 4]
    load = presses(rng)
    convert, width = converter(rng, kind, float(load.max()) * float(rng.uniform(1.0, 1.6)))
    spread = rng.uniform(0.05, 0.5) * float(width(np.median(load[load > 0.0])))
    return kind, moving(load, convert(load + spread * rng.standard_normal(load.shape))), spread, width


def has_right_width(steps: CompandedSteps, values: np.ndarray, width: Width) -> bool:
    """Whether steps are as wide as the converter's, within a tenth, at small, middle and large readings."""
    at = np.quantile(values[values > 0.02 * values.max()], (0.1, 0.5, 0.9))
    reading = at[:, None] * (1.0 + 1e-6 * np.array([-1.0, 1.0]))
    slope = np.diff(steps.even(reading), axis=1)[:, 0] / np.diff(reading, axis=1)[:, 0]
    return bool(np.all(np.abs(1.0 / (steps.frequency * slope) / width(at) - 1.0) < 0.1))


def without_steps(seed: int, noisy: bool) -> np.ndarray:
    """Return readings with noise alone, or with hardly any."""
    rng = np.random.default_rng([8, seed, noisy])
    load = presses(rng)
    spread = 10.0 ** rng.uniform(-3.0, -1.5) if noisy else 10.0 ** rng.uniform(-6.0, -4.0)
    bent = load ** float(rng.uniform(0.5, 2.0))
    return moving(load, bent + spread * rng.standard_normal(load.shape))


def run() -> Iterator[dict]:
    """Count readings with steps in which they are seen, and readings without in which some are."""
    number, first = (
        int(os.environ.get("PALPATE_COMPANDING_CASES", "120")),
        int(os.environ.get("PALPATE_COMPANDING_SEED", "1000")),
    )
    start = time.process_time()
    seen: dict[str, list[bool]] = {}
    right, even = 0, 0
    for seed in range(first, first + number):
        kind, values, spread, width = with_steps(seed)
        found = companded_steps(values)
        seen.setdefault(kind, []).append(bool(found))
        right += bool(found) and has_right_width(found[0], values, width)
        even += few_levels(values) is not None or even_steps(values, spread) is not None
    for kind, cases in seen.items():
        yield {"name": f"companding, steps seen behind a {kind}, of {len(cases)}", "value": sum(cases), "unit": "readings"}
    yield {"name": f"companding, their widths within a tenth, of {number}", "value": right, "unit": "readings"}
    yield {"name": f"companding, seen by the test for even steps or few levels, of {number}", "value": even, "unit": "readings"}
    for noisy in (True, False):
        alarms = sum(bool(companded_steps(without_steps(first + i, noisy))) for i in range(number // 2))
        what = "noise" if noisy else "hardly any noise"
        yield {"name": f"companding, seen without steps, {what}, of {number // 2}", "value": alarms, "unit": "readings"}
    total = number + 2 * (number // 2)
    yield {"name": "companding, CPU per case", "value": (time.process_time() - start) / total, "unit": "s"}
