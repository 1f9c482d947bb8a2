# SPDX-License-Identifier: GPL-3.0-or-later
"""Where in its animation a scene stands. Only there do frames count: for keyframes, for images, and for what is computed.

Blender's Time Stretching (Output › Frame Range) makes the timeline run slower or faster than the animation. It changes how long
a bake is watched and not what is in it, so everything is computed without, and shown by the animation's time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress

NEAR = 1e-4
"""Of a frame: this near a whole one, it is meant."""


def stretch(scene) -> float:
    """Frames of the animation for one of the timeline."""
    return scene.render.frame_map_old / scene.render.frame_map_new


def moment(scene) -> tuple[int, float]:
    """Return the frame of the animation at which, or after which, a scene stands, and how far it is to the next, 0 to 1."""
    time = (scene.frame_current + scene.frame_subframe) * stretch(scene)
    number = math.floor(time + NEAR)
    share = time - number
    return number, share if share > NEAR else 0.0


@contextmanager
def unstretched(scene) -> Iterator[None]:
    """Let the timeline's frames be those of the animation for a while."""
    render = scene.render
    before = render.frame_map_old, render.frame_map_new
    try:
        if before[0] != before[1]:
            render.frame_map_old = render.frame_map_new = 100
        yield
    finally:
        with suppress(ReferenceError):  # the scene went meanwhile
            if before[0] != before[1]:
                render.frame_map_old, render.frame_map_new = before
