# SPDX-License-Identifier: GPL-3.0-or-later
"""The texels are not where the model has them: a sensor was mounted at an angle, or an array has slipped.

The axes go through the centre of the texels: x along their mean x axis, z along their mean normal.
"""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import EXACT_FORM_ERROR, Drawing, Form, Kind, scalar


def displaced(
    position: np.ndarray, normal: np.ndarray, tangent: np.ndarray, values: Values
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotate about z, then about y, then about x, and translate."""
    up = _unit(normal.sum(axis=0), np.array([0.0, 0.0, 1.0]))
    across = tangent.sum(axis=0)
    across = across - (across @ up) * up
    across = _unit(across, np.cross(up, np.eye(3)[np.abs(up).argmin()]))
    frame = np.stack([across, np.cross(up, across), up], axis=1)
    given = {key: scalar(values, key) for key in values}
    rotation = frame @ _rotation(given.get("about_x", 0.0), given.get("about_y", 0.0), given.get("about_z", 0.0)) @ frame.T
    shift = frame @ np.array([given.get("x", 0.0), given.get("y", 0.0), given.get("z", 0.0)])
    centre = position.mean(axis=0)
    return centre + (position - centre) @ rotation.T + shift, normal @ rotation.T, tangent @ rotation.T


def _unit(vector: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Return a vector of length one, in the direction of `otherwise` if the vector is zero."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-9 else otherwise / np.linalg.norm(otherwise)


def _rotation(x: float, y: float, z: float) -> np.ndarray:
    """Return the matrix of the rotations by these angles (rad) about the axes."""
    (a, b), (c, d), (e, f) = ((np.cos(angle), np.sin(angle)) for angle in (x, y, z))
    about_x = np.array([[1, 0, 0], [0, a, -b], [0, b, a]])
    about_y = np.array([[c, 0, d], [0, 1, 0], [-d, 0, c]])
    about_z = np.array([[e, -f, 0], [f, e, 0], [0, 0, 1]])
    return about_x @ about_y @ about_z


_X = Parameter("x", "m", 0.001, -0.05, 0.05, "Shift along the columns.", neutral=0.0)
_Y = Parameter("y", "m", 0.0, -0.05, 0.05, "Shift along the rows.", neutral=0.0)
_TURN = Parameter("about_z", "rad", 0.05, -0.8, 0.8, "Turn about the normal.", neutral=0.0)
_HEIGHT = Parameter("z", "m", 0.0, -0.02, 0.02, "Shift along the normal.", neutral=0.0)
_TILT_X = Parameter("about_x", "rad", 0.03, -0.5, 0.5, "Turn about the texels' x axis.", neutral=0.0)
_TILT_Y = Parameter("about_y", "rad", 0.0, -0.5, 0.5, "Turn about the texels' y axis.", neutral=0.0)

KIND = Kind(
    name="misalignment",
    title="Misalignment",
    text="The texels are shifted or turned against the model's.",
    site="contact",
    order=0,
    forms=(
        Form(
            "shift",
            "p = p₀ + s",
            "Craig, Introduction to Robotics (2005), section 2.8: a frame's error as a rigid motion",
            (_X, _Y),
            placement=displaced,
        ),
        Form(
            "turn",
            "p = R_z (p₀ − m) + m + s",
            "Craig, Introduction to Robotics (2005), section 2.8",
            (_X, _Y, _TURN),
            placement=displaced,
        ),
        Form(
            "tilt",
            "p = R_x R_y (p₀ − m) + m + z",
            "Craig, Introduction to Robotics (2005), section 2.8",
            (_TILT_X, _TILT_Y, _HEIGHT),
            placement=displaced,
        ),
        Form(
            "rigid",
            "p = R_x R_y R_z (p₀ − m) + m + s",
            "Craig, Introduction to Robotics (2005), section 2.8: all six numbers of a rigid motion",
            (_X, _Y, _HEIGHT, _TILT_X, _TILT_Y, _TURN),
            placement=displaced,
            error=EXACT_FORM_ERROR,  # every motion of a rigid sensor is one of these
        ),
    ),
    experiment="press at many known places, also beyond the edges",
    drawing=Drawing(
        "ball",
        values={"shift": {"x": 0.0, "y": 0.005}, "turn": {"x": 0.003, "y": 0.0, "about_z": 0.4}, "tilt": {"about_x": 0.08}},
    ),
    known_from=("places",),
)
