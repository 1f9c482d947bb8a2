# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR images of 32-bit floats with named channels and attributes, written by a library.

The library is OpenEXR, from PyPI. In a Blender that is linked against an OpenEXR of its own, the dynamic linker would mix the
symbols of the two, and the first file written would end the process (seen in Debian's Blender 4.3). There the images go through
OpenImageIO, which Blender brings along. Pixels, names and attributes are the same; equal images give equal bytes in each.
"""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from ..errors import FileError

_NO_DATE = "1980:01:01 00:00:00"
"""OpenImageIO would write the present time, and equal images would differ."""


@cache
def library() -> str:
    """Return the module that writes images in this process, OpenEXR or OpenImageIO."""
    return "OpenImageIO" if _process_is_linked_against_openexr() else "OpenEXR"


def _process_is_linked_against_openexr() -> bool:
    """Return True if symbols of an OpenEXR are where those of a module that is loaded later are looked up.

    Modules of Python, such as bpy, keep their libraries to themselves, and so do all on Windows and macOS.
    """
    return sys.platform == "linux" and hasattr(ctypes.CDLL(None), "exr_start_read")


def _openimageio() -> Any:
    try:
        import OpenImageIO
    except ImportError as error:
        raise FileError("This Blender's Python has no OpenImageIO: install it, on Debian as python3-openimageio.") from error
    return OpenImageIO


def write_image(path: str | os.PathLike, channels: Mapping[str, np.ndarray], attributes: Mapping[str, str]) -> None:
    """Write an image, ZIP-compressed; equal images give equal bytes.

    Parameters
    ----------
    path : path
    channels : mapping of str to (height, width) float32
        The first row is the top of the picture.
    attributes : mapping of str to str
        Added to the header.

    Raises
    ------
    OSError, FileError
        The file cannot be written.
    """
    texts = {name: value.encode("utf-8", "replace").decode() for name, value in attributes.items()}
    if library() == "OpenEXR":
        import OpenEXR

        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **texts}
        try:
            OpenEXR.File(header, {name: np.ascontiguousarray(one) for name, one in channels.items()}).write(os.fspath(path))
        except RuntimeError as error:
            raise _os_error(str(error)) from error
        return
    oiio = _openimageio()
    height, width = next(iter(channels.values())).shape
    spec = oiio.ImageSpec(width, height, len(channels), "float")
    spec.channelnames = tuple(channels)
    for name, value in {"compression": "zip", "DateTime": _NO_DATE, **texts}.items():
        spec.attribute(name, value)
    image = oiio.ImageOutput.create("image.exr")
    pixels = np.stack(list(channels.values()), axis=-1)
    if not (image.open(os.fspath(path), spec) and image.write_image(pixels) and image.close()):
        raise _os_error(image.geterror())


def _os_error(message: str) -> OSError:
    """Return the error of the system that a library's message names, as in "Failed to write. No space left on device."."""
    number = next((number for number in errno.errorcode if os.strerror(number) in message), None)
    return OSError(errno.EIO, " ".join(message.split())) if number is None else OSError(number, os.strerror(number))
