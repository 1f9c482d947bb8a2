# SPDX-License-Identifier: GPL-3.0-or-later
"""Smallest and largest value, mean and deviation of numbers that come in parts."""

from __future__ import annotations

from typing import Any

import numpy as np

BLOCK_NUMBERS = 1 << 16
"""Numbers that are taken into account at once: 512 kB, as much as the cache of a core holds. Half as many took a quarter more
time."""


class RunningStatistics:
    """Statistics of (F, …) values over all F of all parts, for each number by itself.

    Parts are joined by the formula of Chan, Golub and LeVeque (1979), which loses no digits to large means.
    """

    def __init__(self) -> None:
        self._count = 0
        self._shape: tuple[int, ...] = (1,)
        self._least: Any = None
        self._most: Any = None
        self._mean: Any = None
        self._squares: Any = None

    def add(self, values: np.ndarray) -> None:
        """Take the next part into account."""
        part = np.asarray(values).reshape(len(values), -1)
        if len(part) == 0:
            return
        self._shape = values.shape[1:] or (1,)
        rows = max(1, BLOCK_NUMBERS // part.shape[1])
        for at in range(0, len(part), rows):
            self._add_block(part[at : at + rows])

    def _add_block(self, part: np.ndarray) -> None:
        """Take (F, n) values into account that fit into a processor's cache."""
        least, most = part.min(axis=0), part.max(axis=0)
        wide = part.astype(float)
        mean = wide.sum(axis=0) / len(part)
        wide -= mean
        squares = np.einsum("ij,ij->j", wide, wide)
        if self._count == 0:
            self._count, self._least, self._most, self._mean, self._squares = len(part), least, most, mean, squares
            return
        total = self._count + len(part)
        apart = mean - self._mean
        self._mean = self._mean + apart * (len(part) / total)
        self._squares = self._squares + squares + np.square(apart) * (self._count * len(part) / total)
        self._least, self._most = np.minimum(self._least, least), np.maximum(self._most, most)
        self._count = total

    def result(self) -> dict[str, Any]:
        """Return the statistics as LeRobot's ``stats.json`` has them; the deviation is that of all values, not of a sample."""
        deviation = np.sqrt(self._squares / self._count)
        found = {"min": self._least, "max": self._most, "mean": self._mean, "std": deviation}
        shaped = {name: np.asarray(values, float).reshape(self._shape).tolist() for name, values in found.items()}
        return {**shaped, "count": [self._count]}
