# SPDX-License-Identifier: GPL-3.0-or-later
"""One layer of an OpenEXR image from readings of several channels, which image programs show as one vector."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.layout.grid_layout import GridLayout
from .exr_codec import in_order


def vector_images(
    values: np.ndarray, layout: GridLayout, layer: str, channels: Sequence[str]
) -> tuple[tuple[str, ...], np.ndarray]:
    """Return images as :func:`.exr_codec.write_all` takes them: names of their channels, and (F, rows, c, columns) float32.

    Parameters
    ----------
    values : (F, k, c) float
    layout : GridLayout
        Of the k places.
    layer : str
        Name of the layer.
    channels : (c,) sequence of str
        Names of its channels.
    """
    own = [f"{layer}.{name}" for name in channels]
    names = in_order(own)
    frames, count, _ = values.shape
    image = layout.image(np.moveaxis(values[..., [own.index(name) for name in names]], 1, 0).reshape(count, -1))
    image = image.reshape(*layout.shape, frames, len(names))
    return names, np.ascontiguousarray(np.moveaxis(image[::-1], (2, 3), (0, 2)), dtype="<f4")
