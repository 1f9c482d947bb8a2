# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts that build the sample scenes, and the .blend files that :mod:`.build_samples` has made with them."""

__all__ = [
    "build_samples",
    "demo",
    "fingertip",
    "gel",
    "geometries",
    "grasp",
    "grasps",
    "gripper",
    "hand",
    "pick_and_place",
    "scene_builder",
    "tilt",
    "weighing",
]
