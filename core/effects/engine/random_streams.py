# SPDX-License-Identifier: GPL-3.0-or-later
"""Counter-based random number streams: each number is a function of its counters, so frames can be computed in any order.

A number is a hash (Steele, Lea and Flood, OOPSLA 2014: SplitMix64) of the stream's name, the seed, the texel and the time. No
generator keeps a state. Times are counted in microseconds.
"""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import ArrayLike

TICKS_PER_SECOND = 1e6
FINEST, COARSEST = 10, 20
"""Logarithms of the resolution and the length of a random walk: it is drawn every 2⁻¹⁰ s, linear in between, and stops after
2²⁰ s, twelve days."""


def uniform(stream: str, seed: int, *counters: ArrayLike) -> np.ndarray:
    """Return uniformly distributed numbers in (0, 1).

    Parameters
    ----------
    stream : str
        Streams of different names are independent.
    seed : int
    *counters : (...) int
        Which numbers of the stream; the result has the shape that they broadcast to.
    """
    start = np.uint64(zlib.crc32(stream.encode()) << 32 | (seed & 0xFFFFFFFF))
    state = _mixed(np.atleast_1d(start))
    with np.errstate(over="ignore"):
        for counter in counters:
            state = _mixed(state ^ (np.asarray(counter, dtype=np.int64).astype(np.uint64) * np.uint64(0xD1342543DE82EF95)))
    return ((state >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53


def normal(stream: str, seed: int, *counters: ArrayLike) -> np.ndarray:
    """Return normally distributed numbers of mean 0 and variance 1 (Box and Muller); arguments as in :func:`uniform`."""
    radius = np.sqrt(-2.0 * np.log(uniform(stream, seed, *counters)))
    return radius * np.cos(2.0 * np.pi * uniform(stream + "'", seed, *counters))


def ticks(time: np.ndarray) -> np.ndarray:
    """Return times (t,) in seconds as counters."""
    return np.round(np.asarray(time, float) * TICKS_PER_SECOND).astype(np.int64)


def random_walk(stream: str, seed: int, time: np.ndarray, texels: int) -> np.ndarray:
    """Return Brownian motions that start from 0 at time 0, (t, n) float, one per texel, with a variance of 1 per second.

    Lévy's construction: the value halfway between two known points is their mean plus a normal number with a quarter of the
    variance of the interval. So the value at any time is found without computing the times before it.
    """
    texel = np.arange(texels)
    time = np.clip(np.asarray(time, float), 0.0, 2.0**COARSEST)
    left, width = np.zeros(len(time), dtype=np.int64), 2.0**COARSEST
    low = np.zeros((len(time), texels))
    high = np.sqrt(width) * normal(stream, seed, -1, texel[None, :]) + low
    for level in range(COARSEST + FINEST):
        index, where = np.unique(left, return_inverse=True)
        kick = normal(stream, seed, level, index[:, None], texel[None, :])[where.ravel()]
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
