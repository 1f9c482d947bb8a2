# SPDX-License-Identifier: GPL-3.0-or-later
"""How much disk space figures need, from above, asked for before hours of rendering begin."""

from __future__ import annotations

from ...core.io.bake_reader import Bake
from . import gel_figures
from .figure_request import FigureRequest

PICTURE_BYTES = 3.0
"""Bytes of a rendered pixel: three colours of a noise that cannot be compressed."""
VIDEO_BYTES = 1.0
"""Bytes of a pixel in a video; H.264 of such noise at Blender's high quality stays below."""
GEL_BYTES = 1.0
"""Bytes of a pixel in an image of a gel, whose colours are smooth."""
PAGE_BYTES = 1.0
"""Bytes of a pixel of a drawing that is as high as wide for each sensor; most of it is white."""
POINT_BYTES = 12.0
"""Bytes of a point of a line in SVG, the largest format: 11.3 for 10,000 points of white noise, 4.9 in PDF and 2.7 in PNG."""
LINES = 12
"""Lines of the curves of a sensor at most."""
TEXEL_BYTES = 2000.0
"""Bytes of a texel in SVG: its image in a strip of some columns, and its number with its cell."""
MAX_VIDEO_HEIGHT = 720
SIDE = 0.56
"""Width of what stands beside a render, as a share of the height (:mod:`....core.figures.side_by_side`)."""


def video_size(request: FigureRequest) -> tuple[int, int]:
    """Return width and height of the renders of a video, pixels; both are even."""
    height = 2 * (min(request.size[1], MAX_VIDEO_HEIGHT) // 2)
    return 2 * round(0.5 * height * request.size[0] / request.size[1]), height


def figures_bytes(bake: Bake, request: FigureRequest, pictures: int) -> float:
    """Return an estimate from above of the bytes that figures occupy while they are made.

    Parameters
    ----------
    bake : Bake
        Of the sensors that are shown.
    request : FigureRequest
        The data that it asks for as well are not counted.
    pictures : int
        Number of the frames that are shown one by one.
    """
    needed = 0.0
    if "scene" in request.kinds:
        width, height = request.size
        needed += pictures * PICTURE_BYTES * (2 * width * height + SIDE * height**2)
        needed += PICTURE_BYTES * width * height * request.see_through  # the second render of one picture at a time
    if "video" in request.kinds:
        width, height = video_size(request)
        pixels = len(bake.recording.frames) * (width * height + SIDE * height**2)
        needed += (PICTURE_BYTES + VIDEO_BYTES) * pixels + PICTURE_BYTES * width * height
    if "gel" in request.kinds:
        needed += GEL_BYTES * gel_figures.gel_pixels_in_all(bake, request)
    page = PAGE_BYTES * (request.style.width_inches * request.style.dpi) ** 2
    lines = POINT_BYTES * LINES * len(bake.recording.frames)
    texels = [TEXEL_BYTES * len(one) for one in bake.texels.values()]
    each = {
        "strip": sum(page + one for one in texels),
        "curves": len(texels) * (page + lines),
        "numbers": pictures * sum(page + one for one in texels),
    }
    return needed + len(request.formats) * sum(size for kind, size in each.items() if kind in request.kinds)
