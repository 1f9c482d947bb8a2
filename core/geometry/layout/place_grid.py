# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows and columns of a few places, as of magnetometers on a circuit board, for images with a pixel of each."""

from __future__ import annotations

import numpy as np

from .grid_layout import GridLayout

SAME_LINE = 1 / 3
"""Largest step between two places of one row or column, as a share of the distance between neighbours."""
MOST_EMPTY = 4
"""Most pixels for each place. A cross of five has nine, half of them empty; places that lie anyhow form no grid."""


def grid_of_places(place: np.ndarray, along: np.ndarray, across: np.ndarray) -> GridLayout:
    """Return rows and columns for places that lie in such; others get one row, in their order.

    Parameters
    ----------
    place : (k, 3) float, m
    along, across : (3,) float
        Directions in which columns and rows are counted.
    """
    count = len(place)
    flat = place @ np.stack([along, across], axis=1)
    apart = np.linalg.norm(flat[:, None] - flat[None], axis=2) + np.where(np.eye(count) > 0, np.inf, 0.0)
    step = SAME_LINE * float(np.median(apart.min(axis=1))) if count > 1 else 1.0
    column, row = (_lines(values, step) for values in flat.T)
    rows, columns = int(row.max()) + 1, int(column.max()) + 1
    if len(np.unique(row * columns + column)) < count or rows * columns > MOST_EMPTY * count:
        return GridLayout(1, count, np.zeros(count, int), np.arange(count))
    return GridLayout(rows, columns, row, column)


def _lines(values: np.ndarray, step: float) -> np.ndarray:
    """Return for each value the number of its line: lines are further apart than a step."""
    order = np.argsort(values, kind="stable")
    line = np.empty(len(values), int)
    line[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > step)])
    return line
