# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers that are functions of what they are for, so that frames can be computed in any order.

Each number comes from a hash (Steele, Lea and Flood, OOPSLA 2014: SplitMix64) of seed, purpose, texel and moment; nothing is
drawn in turn. Moments are counted in microseconds.
"""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import ArrayLike

TICKS_PER_SECOND = 1e6
FINEST, COARSEST = 10, 20
"""A random walk is drawn at 2⁻¹⁰ s and linear in between; it begins to repeat nothing before 2²⁰ s, twelve days."""


def uniform(purpose: str, seed: int, *counters: ArrayLike) -> np.ndarray:
    """Return numbers in (0, 1), of the shape that the integer counters broadcast to."""
    start = np.uint64(zlib.crc32(purpose.encode()) << 32 | (seed & 0xFFFFFFFF))
    state = _mixed(np.atleast_1d(start))
    with np.errstate(over="ignore"):
        for counter in counters:
            state = _mixed(state ^ (np.asarray(counter, dtype=np.int64).astype(np.uint64) * np.uint64(0xD1342543DE82EF95)))
    return ((state >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53


def normal(purpose: str, seed: int, *counters: ArrayLike) -> np.ndarray:
    """Return normally distributed numbers of mean 0 and variance 1 (Box and Muller)."""
    radius = np.sqrt(-2.0 * np.log(uniform(purpose, seed, *counters)))
    return radius * np.cos(2.0 * np.pi * uniform(purpose + "'", seed, *counters))


def ticks(time: np.ndarray) -> np.ndarray:
    """Return moments (t,) as counters."""
    return np.round(np.asarray(time, float) * TICKS_PER_SECOND).astype(np.int64)


def random_walk(purpose: str, seed: int, time: np.ndarray, texels: int) -> np.ndarray:
    """Return Brownian motions from 0 at time 0, (t, n) float, of variance 1 per second, one per texel.

    By Lévy's construction: halfway between two known points lies their mean and a normal number of a quarter of the interval's
    variance. So any moment is known without what came before.
    """
    texel = np.arange(texels)
    time = np.clip(np.asarray(time, float), 0.0, 2.0**COARSEST)
    left, width = np.zeros(len(time), dtype=np.int64), 2.0**COARSEST
    low = np.zeros((len(time), texels))
    high = np.sqrt(width) * normal(purpose, seed, -1, texel[None, :]) + low
    for level in range(COARSEST + FINEST):
        index, where = np.unique(left, return_inverse=True)
        kick = normal(purpose, seed, level, index[:, None], texel[None, :])[where.ravel()]
        middle = 0.5 * (low + high) + 0.5 * np.sqrt(width) * kick
        width *= 0.5
        right = time >= (2 * left + 1) * width
        left = 2 * left + right
        low, high = np.where(right[:, None], middle, low), np.where(right[:, None], high, middle)
    share = np.clip(time / width - left, 0.0, 1.0)[:, None]
    result: np.ndarray = (1.0 - share) * low + share * high
    return result


def _mixed(state: np.ndarray) -> np.ndarray:
    """SplitMix64's finaliser, after one step of its counter."""
    with np.errstate(over="ignore"):
        state = state + np.uint64(0x9E3779B97F4A7C15)
        state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return state ^ (state >> np.uint64(31))
