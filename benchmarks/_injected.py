# SPDX-License-Identifier: GPL-3.0-or-later
"""A known effect, in a formula that the library does not have, put on top of real recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ._recordings import Recording

SHARE = 0.08
"""Root mean square of what is injected, of the range of the readings."""

Change = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


def _low_pass(time: np.ndarray, x: np.ndarray, tau: float) -> np.ndarray:
    out = x.copy()
    for t in range(1, len(x)):
        out[t] = x[t] + (out[t - 1] - x[t]) * np.exp(-(time[t] - time[t - 1]) / tau)
    return out


def lag(time, x, strength):
    """Three equal low passes in turn."""
    for _ in range(3):
        x = _low_pass(time, x, 0.03 * strength * (time[-1] - time[0]) + 1e-9)
    return x


def saturation(time, x, strength):
    """An arctangent."""
    return np.arctan(x * strength) / strength


def dead_zone(time, x, strength):
    """A quadratic onset that runs into the line."""
    size, start = np.abs(x), 0.3 * strength
    return np.sign(x) * np.where(size < 2 * start, size**2 / (4 * start), size - start)


def drift(time, x, strength):
    """A power of the time."""
    return x + 0.3 * strength * ((time - time[0]) / (time[-1] - time[0]))[:, None] ** 1.3


def creep(time, x, strength):
    """The reading goes on rising, with two times."""
    long = time[-1] - time[0]
    return x + strength * (0.3 * _low_pass(time, x, 0.03 * long) + 0.3 * _low_pass(time, x, 0.15 * long))


CHANGES: dict[str, Change] = {"lag": lag, "saturation": saturation, "dead-zone": dead_zone, "drift": drift, "creep": creep}


def with_effect(recording: Recording, name: str) -> Recording:
    """Return recordings in which an effect changes all readings by :data:`SHARE` of their range."""
    columns = [key for key in recording.trials[0][2] if key.startswith("texel_")]
    readings = [np.stack([trial[key] for key in columns], axis=1) for _, _, trial in recording.trials]
    zero = np.median([r[0] for r in readings], axis=0)
    full = max(float(np.abs(r - zero).max()) for r in readings)

    def changed(strength: float) -> list[np.ndarray]:
        made = []
        for (_, _, trial), r in zip(recording.trials, readings, strict=True):
            made.append(zero + full * CHANGES[name](trial["time"], (r - zero) / full, strength))
        return made

    low, high = 1e-3, 30.0
    for _ in range(30):
        middle = float(np.sqrt(low * high))
        moved = np.concatenate([(a - b).ravel() for a, b in zip(changed(middle), readings, strict=True)])
        low, high = (middle, high) if np.sqrt(np.mean(moved**2)) < SHARE * full else (low, middle)
    trials = []
    for (trial, use, old), new in zip(recording.trials, changed(low), strict=True):
        trials.append((trial, use, old | {key: new[:, i] for i, key in enumerate(columns)}))
    return replace(recording, name=f"{recording.name} with {name}", trials=trials)
