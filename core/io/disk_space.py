# SPDX-License-Identifier: GPL-3.0-or-later
"""Space on a disk, asked for before work begins that would fill it up."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

from ..errors import FileError

BLOCK = 4096
"""Bytes that even the smallest file occupies on most file systems."""
IMAGE_HEADER_BYTES = 2500
IMAGE_PIXEL_BYTES = 28
"""Bytes of a tactile image: its header, and seven channels of four bytes for each pixel."""
LIST_LINE_BYTES = 100
CHANNEL_BYTES = 9
"""Bytes of a channel at a frame: its reading, and whether that is clipped."""
_TEXEL_BYTES, _SENSOR_BYTES, _BODY_BYTES, _FRAME_BYTES = 57, 80, 104, 16
"""Bytes of a frame of a recording: for each texel, sensor and body, and for the frame itself."""


def recording_bytes(frames: int, bodies: int, texels: Iterable[int]) -> float:
    """Return how many bytes a recording of sensors with so many texels occupies without compression."""
    sensors = sum(_TEXEL_BYTES * count + _SENSOR_BYTES for count in texels)
    return float(frames * (_FRAME_BYTES + _BODY_BYTES * bodies + sensors))


def bake_bytes(frames: int, bodies: int, texels: Sequence[int], pixels: Sequence[int], channels: Sequence[int] = ()) -> float:
    """Return an estimate from above of the bytes that a bake occupies while it is written.

    Parameters
    ----------
    frames, bodies : int
    texels : sequence of int
        Of each sensor.
    pixels : sequence of int
        Of the images of each sensor, more by a seventh for each further channel; empty for a bake without images.
    channels : sequence of int
        Of each sensor that has several, all places together.

    Returns
    -------
    float
        The frames as they grow, the recording of each sensor, and the images, all of them as if nothing could be compressed.
    """
    grown = recording_bytes(frames, bodies, texels)
    written = sum(recording_bytes(frames, bodies, [count]) for count in texels)
    vectors = 2 * CHANNEL_BYTES * frames * sum(channels)
    size = [IMAGE_HEADER_BYTES + IMAGE_PIXEL_BYTES * count for count in pixels]
    images = sum(BLOCK * -(-one // BLOCK) + LIST_LINE_BYTES for one in size)
    return grown + written + float(vectors + frames * images)


def require_space(folder: str | os.PathLike, needed: float, what: str) -> None:
    """Check that a disk has the space that work needs.

    Parameters
    ----------
    folder : path
        It need not exist yet.
    needed : float, bytes
        From above.
    what : str
        What will be written, for the message.

    Raises
    ------
    FileError
        There is less space.
    """
    place = Path(os.path.abspath(folder))
    while not os.path.exists(place):
        place = place.parent
    free = shutil.disk_usage(place).free
    if free < needed:
        raise FileError(
            f"{what} needs up to {needed / 1e6:.0f} MB and the disk of '{folder}' has {free / 1e6:.0f} MB left: "
            "free some space or choose another folder."
        )
