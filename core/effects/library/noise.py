# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading is noisy. The noise depends only on seed, texel and time, so any frame can be computed by itself."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.random_streams import normal, ticks
from ..engine.specification import SCATTER, Drawing, Form, Kind, TransducerArray, scalar


def white(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add independent numbers to all samples."""
    return signal + scalar(values, "spread") * _normal(seed, ticks(time), signal.shape[1])


def proportional(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add noise in proportion to the reading."""
    return signal + scalar(values, "share") * (signal - transducers.zero) * _normal(seed, ticks(time), signal.shape[1])


def coloured(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add noise that is correlated over τ.

    Normal numbers are drawn at every multiple of τ and interpolated linearly, then scaled to the same variance everywhere.
    """
    place = np.asarray(time, float) / scalar(values, "time")
    left = np.floor(place)
    share = (place - left)[:, None]
    corners, where = np.unique(np.concatenate([left, left + 1.0]).astype(np.int64), return_inverse=True)
    drawn = _normal(seed, corners, signal.shape[1])[where.ravel()]
    mixed = (1.0 - share) * drawn[: len(left)] + share * drawn[len(left) :]
    return signal + scalar(values, "spread") * mixed / np.sqrt((1.0 - share) ** 2 + share**2)


def _normal(seed: int, moments: np.ndarray, texels: int) -> np.ndarray:
    """Return normal numbers for these times (counters, (t,)) and all texels, (t, texels)."""
    return normal("noise", seed, moments[:, None], np.arange(texels)[None, :])


_SPREAD = Parameter("spread", "unit", 0.002, 0.0, 1e4, "Standard deviation s.", neutral=0.0)

_SECOND = np.linspace(0, 1, 501)


KIND = Kind(
    name="noise",
    title="Noise",
    text="The reading is noisy.",
    site="readout",
    order=66,
    forms=(
        Form(
            "white",
            "r = r₀ + s ε,  ε normal",
            "JCGM 100 (2008), section 4.2: repeatability",
            (_SPREAD,),
            memoryless=white,
            after_conversion=True,
            random=True,
        ),
        Form(
            "proportional",
            "r = r₀ · (1 + s ε),  ε normal",
            "JCGM 100 (2008), section 4.2: relative repeatability",
            (Parameter("share", "1", 0.02, 0.0, 1.0, "Standard deviation s as a share of the reading.", neutral=0.0),),
            memoryless=proportional,
            after_conversion=True,
            random=True,
        ),
        Form(
            "coloured",
            "r = r₀ + s ε(t),  ε normal with correlation over τ",
            "Perlin, SIGGRAPH (1985): noise on a lattice; IEEE Std 952 (1997), annex C: correlated noise",
            (_SPREAD, Parameter("time", "s", 0.2, 1e-3, 1e3, "Time τ over which it is correlated.", log=True)),
            memoryless=coloured,
            after_conversion=True,
            random=True,
        ),
    ),
    experiment="record a minute at rest, unloaded and under a constant load",
    drawing=Drawing(
        time=_SECOND,
        depth=0.001 * np.sin(np.pi * _SECOND) ** 2,
        values={"white": {"spread": 0.03}, "proportional": {"share": 0.05}, "coloured": {"spread": 0.06}},
    ),
    found_by=SCATTER,
)
