# SPDX-License-Identifier: GPL-3.0-or-later
"""Space on a disk, asked for before work begins that would fill it up."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from pathlib import Path

from ..errors import FileError

BLOCK = 4096
"""Bytes that even the smallest file occupies on most file systems."""


def least_image_bytes(texels: Iterable[int], frames: int) -> int:
    """Return how many bytes the tactile images of sensors with so many texels occupy at least, as nothing touches."""
    return frames * sum(max(BLOCK, count) for count in texels)


def require_space(folder: str | os.PathLike, needed: float, what: str) -> None:
    """Check that a disk has the space that work needs at least.

    Parameters
    ----------
    folder : path
        It need not exist yet.
    needed : float, bytes
    what : str
        What will be written, for the message.

    Raises
    ------
    FileError
        There is less space.
    """
    place = Path(os.path.abspath(folder))
    while not place.exists():
        place = place.parent
    free = shutil.disk_usage(place).free
    if free < needed:
        raise FileError(
            f"{what} needs at least {needed / 1e6:.0f} MB and the disk of '{folder}' has {free / 1e6:.0f} MB left: "
            "free some space or choose another folder."
        )
