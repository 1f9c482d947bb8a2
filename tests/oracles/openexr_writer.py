# SPDX-License-Identifier: GPL-3.0-or-later
"""Images written by the OpenEXR library, against which Palpate's own codec is held.

The library's interface of files and parts (``OpenEXR.File``) adds an attribute ``type`` to every header. ``OutputFile`` does
not, so that the headers can be compared byte by byte.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

import Imath
import numpy as np
import OpenEXR


def write(path: str | os.PathLike, channels: Mapping[str, np.ndarray], attributes: Mapping[str, str]) -> None:
    """Write one image of 32-bit floats; `channels` are (height, width) with the first row at the top."""
    height, width = next(iter(channels.values())).shape
    header = OpenEXR.Header(width, height)
    header["channels"] = {name: Imath.Channel(Imath.PixelType(Imath.PixelType.FLOAT)) for name in channels}
    header |= {name: value.encode("utf-8", "surrogatepass") for name, value in attributes.items()}
    file = OpenEXR.OutputFile(os.fspath(path), header)
    file.writePixels({name: picture.tobytes() for name, picture in channels.items()}, height)
    file.close()
