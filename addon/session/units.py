# SPDX-License-Identifier: GPL-3.0-or-later
"""The only place that knows the scene's unit scale. Everything of Palpate's own is in SI units, also in the panels."""

from __future__ import annotations

import numpy as np


def metres_per_unit(scene) -> float:
    """Length of one Blender unit. Without a unit system Blender ignores its scale, and so does this."""
    settings = scene.unit_settings
    return 1.0 if settings.system == "NONE" else float(settings.scale_length)


def gravity(scene) -> np.ndarray:
    """(3,) float, m/s².

    The scene's number is taken in m/s² whatever the unit scale, as Blender's own physics takes it: who models in millimetres
    leaves it at −9.81.
    """
    return np.array([as_typed(value) for value in scene.gravity]) if scene.use_gravity else np.zeros(3)


def frames_per_second(scene) -> float:
    """Frame rate, with its base (30 / 1.001 is 29.97)."""
    return scene.render.fps / scene.render.fps_base


def as_typed(value: float) -> float:
    """Return the number that the user typed: Blender keeps 32 bits of it, and 0.0583 would become 0.05829999968."""
    return float(str(np.float32(value)))
