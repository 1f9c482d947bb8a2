# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame of the animation at which a scene stands. Keyframes, images and computed frames are counted in these frames.

Blender's Time Stretching (Output › Frame Range) makes the timeline run slower or faster than the animation. It changes how
long a bake is watched, not what is baked. Palpate therefore computes without it and shows results by the animation's time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress

WHOLE_FRAME_TOLERANCE = 1e-4
"""A time that is nearer than this many frames to a whole frame counts as that frame."""


def frames_per_timeline_frame(scene) -> float:
    """Return how many frames of the animation pass in one frame of the timeline."""
    return scene.render.frame_map_old / scene.render.frame_map_new


def current_frame(scene) -> tuple[int, float]:
    """Return the last whole frame of the animation that a scene has reached, and the part of the next one, 0 to 1."""
    time = (scene.frame_current + scene.frame_subframe) * frames_per_timeline_frame(scene)
    number = math.floor(time + WHOLE_FRAME_TOLERANCE)
    part = time - number
    return number, part if part > WHOLE_FRAME_TOLERANCE else 0.0


@contextmanager
def without_time_stretching(scene) -> Iterator[None]:
    """Make frames of the timeline equal to frames of the animation while the context is open."""
    render = scene.render
    before = render.frame_map_old, render.frame_map_new
    try:
        if before[0] != before[1]:
            render.frame_map_old = render.frame_map_new = 100
        yield
    finally:
        with suppress(ReferenceError):  # the scene was deleted meanwhile
            if before[0] != before[1]:
                render.frame_map_old, render.frame_map_new = before
