# SPDX-License-Identifier: GPL-3.0-or-later
"""Unit scale, gravity and frame rate of a scene. All of Palpate's own quantities are in SI units."""

from __future__ import annotations

import numpy as np


def metres_per_unit(scene) -> float:
    """Return the length of one Blender unit, metres. Without a unit system Blender ignores its scale, and so does this."""
    settings = scene.unit_settings
    return 1.0 if settings.system == "NONE" else float(settings.scale_length)


def gravity(scene) -> np.ndarray:
    """Return the gravity of a scene, (3,) float, m/s².

    The scene's number is taken in m/s² for any unit scale, as Blender's own physics does: a scene in millimetres keeps −9.81.
    """
    return np.array([as_typed(value) for value in scene.gravity]) if scene.use_gravity else np.zeros(3)


def frames_per_second(scene) -> float:
    """Return the frame rate, divided by its base (30 / 1.001 is 29.97)."""
    return scene.render.fps / scene.render.fps_base


def as_typed(value: float) -> float:
    """Return the number that the user typed. Blender stores 32 bits of it, which would turn 0.0583 into 0.05829999968."""
    return float(str(np.float32(value)))
