# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images read by the OpenEXR library (the package OpenEXR from PyPI).

The library is imported on use, see :mod:`.exr_backend`.
"""

from __future__ import annotations

import math
import os

import numpy as np

from .exr_codec import FormatError, read_header
from .regular_file import open_regular

_MOST_PACKED = 1100
"""Bytes of pixels per byte of a file. ZIP cannot compress better, so a header that promises more is damaged."""


def read(path: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Read an image, as :func:`.exr_codec.read` does.

    The library decompresses the pixels. The header is read by :mod:`.exr_codec`, because the library ends the process when
    damage has made the name of an attribute something that is no text.

    Raises
    ------
    OSError
        The file cannot be read.
    FormatError
        The file is damaged.
    """
    import OpenEXR

    with open_regular(path) as plain:
        data = plain.read()
    header = read_header(data)
    shape = header.height, header.width
    if math.prod(shape) * sum(kind.itemsize for kind in header.channels.values()) > _MOST_PACKED * len(data):
        raise FormatError("it is too short for its size")
    try:
        file = OpenEXR.InputFile(os.fspath(path))
        try:
            pixels = file.channels(list(header.channels))
        finally:
            file.close()
        found = zip(header.channels.items(), pixels, strict=True)
        return {name: np.frombuffer(data, kind).reshape(shape) for (name, kind), data in found}, header.texts
    except Exception as error:
        raise FormatError(" ".join(str(error).split()) or type(error).__name__) from error
