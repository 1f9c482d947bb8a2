# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels in another order than the texels: reversed, mirrored, or some of them swapped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..dataset.rig import Rig, Trial
from ..forward.response_check import centred
from ..forward.stimulus import Stimulus
from .data_fault import DataFault

MOST_CHANNELS = 1024
"""Number of texels above which the table of all pairs is not computed."""
LEAST_ORDER, BETTER_ORDER = 0.5, 0.5
"""Another order of all channels is found if their squared correlation with the loads is at least the first, and it leaves less
than the second of the squares that the given order leaves."""
SWAPPED_LEAVES = 0.35
"""Two channels are swapped if each leaves less than this share of its squares with the other's load."""
LEAST_LOADED = 0.002
"""Least variance of a texel's load, as a share of the largest, for its channel to be judged."""


def find_channel_faults(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Return channels in another order, or swapped channels, in all recordings of a rig."""
    recorded = [s for s in stimuli if s.trial.reading is not None]
    n = len(rig.texels)
    if not recorded or not 2 <= n <= MOST_CHANNELS:
        return []
    xx, xy, yy = _moments(recorded, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        squared = np.nan_to_num(xy * xy / np.outer(xx, yy))  # [texel, channel]
    loaded = xx > LEAST_LOADED * xx.max()
    if loaded.sum() < 2:
        return []
    names = tuple(s.trial.name for s in recorded)

    def left(order: np.ndarray) -> float:
        """Share of the squares of the channels that the loads of their texels leave."""
        weight = yy[order]
        return 1.0 - float((weight * squared[np.arange(n), order]).sum() / max(float(weight.sum()), 1e-300))

    given = left(np.arange(n))
    orders = _orders(rig, n)
    best, what = min((left(order), what) for what, order in orders.items())
    if 1.0 - best > LEAST_ORDER and best < BETTER_ORDER * given:
        said = f"{what}, the loads explain {1.0 - best:.0%} of the readings, and {1.0 - given:.0%} as they are"
        return [DataFault("reversed-channels", names, said, partial(_reordered, order=orders[what]))]
    pairs = _swapped(squared, loaded & (yy > 0))
    if not pairs:
        return []
    order = np.arange(n)
    for a, b in pairs:
        order[[a, b]] = b, a
    listed = ", ".join(f"texel_{a} and texel_{b}" for a, b in pairs[:3])
    more = f" and {len(pairs) - 3} more" if len(pairs) > 3 else ""
    a, b = pairs[0]
    said = (
        f"{listed}{more} each follow the other's load (texel_{a}: correlation {squared[b, a] ** 0.5:.2f} with the load of "
        f"texel_{b}, {squared[a, a] ** 0.5:.2f} with its own)"
    )
    return [DataFault("swapped-channels", names, said, partial(_reordered, order=order))]


def _moments(recorded: Sequence[Stimulus], n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Variances of loads (n,) and responses (n,), and their covariances [texel, channel] (n, n)."""
    xx, xy, yy = np.zeros(n), np.zeros((n, n)), np.zeros(n)
    for s in recorded:
        assert s.trial.reading is not None
        x, y = s.load - s.load.mean(axis=0), centred(s.load, s.trial.reading)[1]
        xx, xy, yy = xx + (x * x).sum(axis=0), xy + x.T @ y, yy + (y * y).sum(axis=0)
    return xx, xy, yy


def _orders(rig: Rig, n: int) -> dict[str, np.ndarray]:
    """Orders that exporters mix up: for each texel the number of the channel that would be its own."""
    orders = {"in reverse order": np.arange(n)[::-1]}
    if rig.grid is not None:
        rows, columns, _ = rig.grid
        table = np.arange(n).reshape(rows, columns)
        if rows > 1 and columns > 1:
            orders["with rows in reverse order"] = table[::-1].ravel()
            orders["with columns in reverse order"] = table[:, ::-1].ravel()
            orders["column by column"] = np.arange(n).reshape(columns, rows).T.ravel()
    return orders


def _swapped(squared: np.ndarray, judged: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of channels that leave far less with each other's load than with their own."""
    followed = np.argmax(np.where(judged[:, None], squared, -1.0), axis=0).tolist()  # by each channel: whose load
    pairs = [(a, b) for a, b in enumerate(followed) if judged[a] and a < b and followed[b] == a]
    left = 1.0 - squared
    return [(a, b) for a, b in pairs if all(left[j, i] < SWAPPED_LEAVES * left[i, i] for i, j in ((a, b), (b, a)))]


def _reordered(trial: Trial, order: np.ndarray) -> Trial:
    assert trial.reading is not None
    return replace(trial, reading=trial.reading[:, order])
