# SPDX-License-Identifier: GPL-3.0-or-later
"""A smooth surface of penetration through the texels of a grid, the one by which a baked sensor is indented.

It is the surface of Catmull and Clark's subdivision (1978), which on rows and columns is the bicubic B-spline, of values that
were corrected beforehand for what the subdivision takes from them. The indentation in Blender corrects them in the same way.
"""

from __future__ import annotations

import numpy as np

SHARPENINGS = 4
"""How often the values at the texels are corrected for what the smoothing takes from them. After four corrections the lowest
point of the surface is at the depth of a wide contact within 3 %, and of a contact of a single texel within a quarter."""
NEIGHBOUR_WEIGHT = 0.25
"""Weight of a neighbour beside the texel's own in the correction: on a grid of quads the texel then counts a half, which is
near the 4/9 of the limit surface of Catmull and Clark."""


def smooth_depth(depth: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the smooth penetration where rows cross columns; it is nowhere negative.

    Parameters
    ----------
    depth : (r, c) float, metres
        At the texels, row 0 first. Negative values count as none.
    rows, columns : (h,) and (w,) float
        Places, in texels from the first row and the first column.

    Returns
    -------
    (h, w) float, metres
    """
    from scipy import ndimage

    depth = np.maximum(depth, 0.0)
    beside = np.array([[0.0, NEIGHBOUR_WEIGHT, 0.0], [NEIGHBOUR_WEIGHT, 1.0, NEIGHBOUR_WEIGHT], [0.0, NEIGHBOUR_WEIGHT, 0.0]])
    total = ndimage.convolve(np.ones_like(depth), beside, mode="constant")
    control = depth
    for _ in range(SHARPENINGS):
        control = control + (depth - ndimage.convolve(control, beside, mode="constant") / total)
    # beyond its borders the surface goes on in a straight line
    control = np.pad(control, 1, mode="reflect", reflect_type="odd")
    places = np.meshgrid(np.asarray(rows) + 1.0, np.asarray(columns) + 1.0, indexing="ij")
    return np.maximum(ndimage.map_coordinates(control, places, order=3, mode="nearest", prefilter=False), 0.0)
