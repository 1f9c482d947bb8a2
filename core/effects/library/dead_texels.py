# SPDX-License-Identifier: GPL-3.0-or-later
"""Some texels report nothing, or a constant value."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.random_streams import uniform
from ..engine.specification import EXACT_FORM_ERROR, SILENT_TEXELS, Drawing, Form, Kind, TransducerArray, scalar


def _dead(values: Values, seed: int, texels: int) -> np.ndarray:
    """Return which texels are dead, (texels,) bool."""
    return uniform("dead-texels", seed, np.arange(texels)) < scalar(values, "share")


def random(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Read zero where a texel is dead."""
    return np.where(_dead(values, seed, signal.shape[1]), 0.0, signal)


def listed(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Read zero where a texel is listed as dead; a number between 0 and 1 weakens the texel."""
    return signal * (1.0 - np.asarray(values["dead"]))


def stuck(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Read one constant value where a texel is dead."""
    return np.where(_dead(values, seed, signal.shape[1]), transducers.zero + scalar(values, "level"), signal)


def held(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Read a constant value of its own where a texel is listed as dead."""
    gone = np.asarray(values["dead"])
    return (1.0 - gone) * signal + gone * np.asarray(values["level"])


_DEAD = Parameter(
    "dead",
    "1",
    0.0,
    0.0,
    1.0,
    "1 for each dead texel, 0 for the others, less than 1 where a texel still answers.",
    per_texel=True,
    neutral=0.0,
)
_SHARE = Parameter("share", "1", 0.1, 0.0, 1.0, "Share of the texels that are dead.", neutral=0.0)

KIND = Kind(
    name="dead-texels",
    title="Dead Texels",
    text="Some texels do not respond to load.",
    site="readout",
    order=45,
    forms=(
        Form(
            "random",
            "rᵢ = 0 for a share of the texels",
            "Ni et al., ACM Trans. Sens. Netw. 5 (2009): fault types",
            (_SHARE,),
            memoryless=random,
            random=True,
        ),
        Form(
            "listed",
            "rᵢ = (1 − deadᵢ) · fᵢ",
            "Ni et al., ACM Trans. Sens. Netw. 5 (2009): fault types",
            (_DEAD,),
            memoryless=listed,
            error=EXACT_FORM_ERROR,  # every texel that is silent is one of these
        ),
        Form(
            "held",
            "rᵢ = (1 − deadᵢ) · r₀ᵢ + deadᵢ · Lᵢ",
            "Ni et al., ACM Trans. Sens. Netw. 5 (2009): stuck-at fault",
            (_DEAD, Parameter("level", "unit", 0.1, -1e5, 1e5, "Reading L at which a dead texel stays.", per_texel=True)),
            memoryless=held,
            after_conversion=True,
            error=EXACT_FORM_ERROR,  # every stuck-at fault has this form
        ),
        Form(
            "stuck",
            "rᵢ = r₀ + L for a share of the texels",
            "Ni et al., ACM Trans. Sens. Netw. 5 (2009): stuck-at fault",
            (_SHARE, Parameter("level", "unit", 0.1, -1e5, 1e5, "Constant reading L, counted from the reading without load.")),
            memoryless=stuck,
            after_conversion=True,
            random=True,
        ),
    ),
    experiment="press every texel once",
    drawing=Drawing("texel", values={"random": {"share": 0.12}, "stuck": {"share": 0.12, "level": 0.4, "seed": 2}}),
    found_by=SILENT_TEXELS,
)
