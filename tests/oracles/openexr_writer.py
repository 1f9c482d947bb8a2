# SPDX-License-Identifier: GPL-3.0-or-later
"""Images written by the OpenEXR library, against which Palpate's own codec is held.

The library's interface of files and parts (``OpenEXR.File``) adds an attribute ``type`` to every header. ``OutputFile`` does
not, so that the headers can be compared byte by byte.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import Imath
import numpy as np
import OpenEXR


def write_all(
    paths: Sequence[str | os.PathLike],
    names: tuple[str, ...],
    table: np.ndarray,
    attributes: Sequence[Mapping[str, str]],
) -> None:
    """Write images of one size with the same channels, as ``exr_codec.write_all`` does."""
    _, height, _, width = table.shape
    beginning = OpenEXR.Header(width, height)
    beginning["channels"] = {name: Imath.Channel(Imath.PixelType(Imath.PixelType.FLOAT)) for name in names}
    for path, own, picture in zip(paths, attributes, table, strict=True):
        header = beginning | {name: value.encode("utf-8", "surrogatepass") for name, value in own.items()}
        file = OpenEXR.OutputFile(os.fspath(path), header)
        file.writePixels({name: picture[:, i].tobytes() for i, name in enumerate(names)}, height)
        file.close()
