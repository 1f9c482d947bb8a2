# SPDX-License-Identifier: GPL-3.0-or-later
"""A small pad of springs under a ball, in whose recordings tests of ``palpate gap`` hide effects."""

from __future__ import annotations

import numpy as np

ROWS, COLUMNS, PITCH, RADIUS, K = 5, 3, 4e-3, 14e-3, 60.0
SECONDS, RATE, DEEP = 22.0, 25.0, 2.5e-3
SENSOR = f"""
grid = {{ rows = {ROWS}, columns = {COLUMNS}, pitch = {PITCH} }}
thickness = 6e-3
k = {K}
cn = 0.0
unit = "N"
gain = 1.0
zero = 0.0
[indenter]
shape = {{ sphere = {RADIUS} }}
"""
"""Lines of a rig."""


def presses(rng: np.random.Generator) -> np.ndarray:
    """Return a path (T, 3) of the ball's centre: touches at several places, held and repeated."""
    time = np.arange(int(SECONDS * RATE)) / RATE
    knots, at = [(0.0, 0.0, 0.0, -1e-3), (1.0, 0.0, 0.0, -1e-3)], 1.0
    while at < SECONDS - 4.0:
        x, y = rng.uniform(-0.4, 0.4, 2) * np.array([COLUMNS, ROWS]) * PITCH
        deep, quick, hold = DEEP * rng.uniform(0.4, 1.0), rng.uniform(0.3, 1.0), rng.uniform(0.2, 2.0)
        knots += [(at + 0.3, x, y, -1e-3), (at + 0.3 + quick, x, y, deep), (at + 0.3 + quick + hold, x, y, deep)]
        at += 0.6 + 2.0 * quick + hold
        knots.append((at, x, y, -1e-3))
    table = np.array(knots)
    x, y, depth = (np.interp(time, table[:, 0], table[:, i]) for i in (1, 2, 3))
    return np.stack([x, y, RADIUS - depth], axis=1)


def loads(path: np.ndarray) -> np.ndarray:
    """Return forces (T, n) N of springs under the ball."""
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    x, y = (column - 0.5 * (COLUMNS - 1)) * PITCH, (row - 0.5 * (ROWS - 1)) * PITCH
    across = (path[:, :1] - x) ** 2 + (path[:, 1:2] - y) ** 2
    high = np.sqrt(np.maximum(RADIUS**2 - across, 0.0))  # of the ball's middle above the point where it meets the texel's line
    return K * np.maximum(high - path[:, 2:], 0.0) * high / RADIUS  # across the ball's surface


def columns_of(path: np.ndarray, readings: np.ndarray, **more: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of a recording of readings (T, n) along a path (T, 3) of the ball's centre."""
    texels = {f"texel_{i}": one for i, one in enumerate(readings.T)}
    return {"time": np.arange(len(path)) / RATE, **dict(zip("xyz", path.T, strict=True)), **texels, **more}
