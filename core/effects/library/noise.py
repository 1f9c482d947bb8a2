# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading trembles. The numbers depend on seed, texel and moment alone, so any frame can be computed by itself."""

from __future__ import annotations

import numpy as np

from ...model.effect import Values
from ...model.parameter import Parameter
from ..engine.random_streams import normal, ticks
from ..engine.specification import Form, Kind, TransducerArray, scalar


def white(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Each sample by itself."""
    return x + scalar(values, "spread") * _normal(seed, ticks(time), x.shape[1])


def proportional(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """The more, the more is read."""
    return x + scalar(values, "share") * (x - transducers.zero) * _normal(seed, ticks(time), x.shape[1])


def coloured(x: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Normal numbers at every multiple of τ, linear in between, and scaled to the same variance everywhere."""
    place = np.asarray(time, float) / scalar(values, "time")
    left = np.floor(place)
    share = (place - left)[:, None]
    corners, where = np.unique(np.concatenate([left, left + 1.0]).astype(np.int64), return_inverse=True)
    drawn = _normal(seed, corners, x.shape[1])[where.ravel()]
    mixed = (1.0 - share) * drawn[: len(left)] + share * drawn[len(left) :]
    return x + scalar(values, "spread") * mixed / np.sqrt((1.0 - share) ** 2 + share**2)


def _normal(seed: int, moments: np.ndarray, texels: int) -> np.ndarray:
    return normal("noise", seed, moments[:, None], np.arange(texels)[None, :])


_SPREAD = Parameter("spread", "unit", 0.002, 0.0, 1e4, "Standard deviation s.")

KIND = Kind(
    name="noise",
    title="Noise",
    text="The reading trembles.",
    site="readout",
    order=66,
    forms=(
        Form(
            "white",
            "r = r₀ + s ε,  ε normal",
            "JCGM 100 (2008), section 4.2: repeatability",
            (_SPREAD,),
            neutral={"spread": 0.0},
            memoryless=white,
            after_conversion=True,
            random=True,
        ),
        Form(
            "proportional",
            "r = r₀ · (1 + s ε),  ε normal",
            "JCGM 100 (2008), section 4.2: relative repeatability",
            (Parameter("share", "1", 0.02, 0.0, 1.0, "Standard deviation s as a share of the reading."),),
            neutral={"share": 0.0},
            memoryless=proportional,
            after_conversion=True,
            random=True,
        ),
        Form(
            "coloured",
            "r = r₀ + s ε(t),  ε normal with correlation over τ",
            "Perlin, SIGGRAPH (1985): noise on a lattice; IEEE Std 952 (1997), annex C: correlated noise",
            (_SPREAD, Parameter("time", "s", 0.2, 1e-3, 1e3, "Time τ over which it is correlated.", log=True)),
            neutral={"spread": 0.0},
            memoryless=coloured,
            after_conversion=True,
            random=True,
        ),
    ),
)
