# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a free or driven body starts: its location and rotation at the first frame.

While playing displaces a body, or a bake moves it by keyframes, its properties keep the start, so that it can be
restored exactly.
"""

from __future__ import annotations

import numpy as np

MOVED_BY_FORCES = ("FREE", "DRIVEN")
"""Values of the property `body` of objects that forces move."""


def transform_channels(obj) -> np.ndarray:
    """Return location, Euler, quaternion and axis-angle rotation of an object, (14,) float."""
    return np.concatenate([obj.location, obj.rotation_euler, obj.rotation_quaternion, obj.rotation_axis_angle])


def set_transform_channels(obj, values: np.ndarray) -> None:
    """Give an object the values of :func:`transform_channels`."""
    obj.location, obj.rotation_euler = values[:3], values[3:6]
    obj.rotation_quaternion, obj.rotation_axis_angle = values[6:10], values[10:14]


def store_start(obj, matrix: np.ndarray) -> None:
    """Store where a body starts, before it is moved for the first time; later calls change nothing.

    Parameters
    ----------
    obj : Object
    matrix : (4, 4) float
        Its world matrix at the first frame.
    """
    settings = obj.palpate
    if not settings.has_start:
        settings.start_matrix = matrix.ravel()
        settings.start_channels = transform_channels(obj)
        settings.has_start = True


def restore_unless_moved(obj) -> None:
    """Move an object back to its start when neither a run nor a bake will move it, because its role or body has changed."""
    settings = obj.palpate
    if (settings.body not in MOVED_BY_FORCES or settings.role == "NONE") and not settings.is_baked:
        restore_start(obj)


def restore_start(obj) -> None:
    """Move a body back to its start, equal to the last bit, and delete the stored start."""
    if obj.palpate.has_start:
        set_transform_channels(obj, np.array(obj.palpate.start_channels))
        for name in ("has_start", "start_matrix", "start_channels"):
            obj.palpate.property_unset(name)
