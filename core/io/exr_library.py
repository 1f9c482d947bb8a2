# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images written and read by the OpenEXR library (the package OpenEXR from PyPI).

The library's interface of files and parts (``OpenEXR.File``) adds an attribute ``type`` to every header. ``OutputFile`` does
not, so that the headers equal those of :mod:`.exr_codec` byte by byte. The library is imported on use, see :mod:`.exr_backend`.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Mapping, Sequence

import numpy as np

from .exr_codec import FormatError, read_header
from .regular_file import open_regular

_MOST_PACKED = 1100
"""Bytes of pixels per byte of a file. ZIP cannot compress better, so a header that promises more is damaged."""
_ERRORS = {os.strerror(number).lower(): number for number in (errno.ENOSPC, errno.ENOENT, errno.EACCES, errno.EROFS, errno.EIO)}
"""Words of the operating system, with which the library ends its messages, and their numbers."""


def write_all(
    paths: Sequence[str | os.PathLike],
    names: tuple[str, ...],
    table: np.ndarray,
    attributes: Sequence[Mapping[str, str]],
) -> None:
    """Write images of one size with the same channels, as :func:`.exr_codec.write_all` does.

    Raises
    ------
    OSError
        A file cannot be written; with the operating system's error number where the library tells it.
    UnicodeEncodeError
        The name of an attribute is no text. The library would end the process.
    """
    import Imath
    import OpenEXR

    for name in {name for own in attributes for name in own}:
        name.encode()
    _, height, _, width = table.shape
    beginning = OpenEXR.Header(width, height)
    beginning["channels"] = {name: Imath.Channel(Imath.PixelType(Imath.PixelType.FLOAT)) for name in names}
    for path, own, picture in zip(paths, attributes, table, strict=True):
        header = beginning | {name: value.encode("utf-8", "surrogatepass") for name, value in own.items()}
        pixels = {name: picture[:, i].tobytes() for i, name in enumerate(names)}
        try:
            file = OpenEXR.OutputFile(os.fspath(path), header)
            try:
                file.writePixels(pixels, height)
            finally:
                file.close()
        except (OSError, RuntimeError) as error:
            raise _with_number(error) from error


def _with_number(error: Exception) -> OSError:
    """Return the operating system's error that a message of the library ends with."""
    words = str(error).lower().rstrip(". ")
    number = next((number for text, number in _ERRORS.items() if words.endswith(text)), errno.EIO)
    return OSError(number, os.strerror(number))


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
