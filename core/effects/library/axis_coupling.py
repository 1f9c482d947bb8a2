# SPDX-License-Identifier: GPL-3.0-or-later
"""The three axes of a magnetometer couple: its axes are misaligned, or soft iron beside it distorts the field."""

from __future__ import annotations

import numpy as np

from ...errors import EffectError
from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar

AXES = ("x", "y", "z")
PAIRS = (("xy", 0, 1), ("yz", 1, 2), ("xz", 0, 2))


def _mixed(signal: np.ndarray, matrix: np.ndarray, transducers: TransducerArray) -> np.ndarray:
    """The channels of each magnetometer, multiplied by a matrix (3, 3)."""
    if signal.shape[1] % 3:
        raise EffectError(
            f"Effect 'axis-coupling' of sensor '{transducers.name}' needs three channels for each magnetometer, and it has "
            f"{signal.shape[1]} channels: use 'crosstalk' instead."
        )
    return (signal.reshape(len(signal), -1, 3) @ matrix.T).reshape(signal.shape)


def rotation(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Turn the field by the vector of rotation (Rodrigues' formula)."""
    vector = np.array([scalar(values, axis) for axis in AXES])
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return signal
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return _mixed(signal, matrix, transducers)


def soft_iron(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """Add shares of the other axes, alike in both directions, as linearly magnetised iron does."""
    matrix = np.eye(3)
    for name, i, j in PAIRS:
        matrix[i, j] = matrix[j, i] = scalar(values, name)
    return _mixed(signal, matrix, transducers)


KIND = Kind(
    name="axis-coupling",
    title="Axis Coupling",
    text="Each axis of a magnetometer shows a part of the other two; channels come as x, y, z.",
    site="readout",
    order=52,
    forms=(
        Form(
            "rotation",
            "r = R f of each magnetometer,  R a rotation",
            "Goldstein, Classical Mechanics (1980), section 4-7: rotation of a vector about an axis",
            tuple(
                Parameter(axis, "rad", 0.05, -3.2, 3.2, f"Rotation about {axis}, as a vector of rotation.", neutral=0.0)
                for axis in AXES
            ),
            memoryless=rotation,
            couples=True,
            needs="axes",
            is_tried=False,  # curves of single channels do the same, and more, as long as one stimulus moves them all
        ),
        Form(
            "soft-iron",
            "r = (1 + S) f of each magnetometer,  S symmetric",
            "Gebre-Egziabher et al., J. Aerosp. Eng. 19 (2006): soft iron beside a magnetometer",
            tuple(
                Parameter(
                    name, "1", 0.05, -0.9, 0.9, f"Share of {name[0]} in {name[1]}, and of {name[1]} in {name[0]}.", neutral=0.0
                )
                for name, _, _ in PAIRS
            ),
            memoryless=soft_iron,
            couples=True,
            needs="axes",
            is_tried=False,  # as above
        ),
    ),
    experiment="press and shear the skin along each axis in turn, and turn it in a constant field without touching it",
    drawing=Drawing("texel", values={"rotation": {"x": 0.2, "z": 0.3}, "soft-iron": {"xy": 0.2, "yz": -0.3, "xz": 0.1}}),
)
