# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of readings with three signed channels in the OpenEXR format: one layer with the channels X, Y and Z.

Image programs, Blender's among them, show the channels of a layer as one vector. All are 32-bit floats in the unit of the
readings. Row 0 of the places is the bottom of the picture, as in tactile images.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import ParameterError
from .exr_file import write_image
from .file_list import FileList
from .file_writing import writable_folder, write_file

LAYER, AXES = "field", "XYZ"
"""Name of the layer, and of its channels."""
DIGITS = 4
"""Of the number of a frame in the name of a file."""


def write_vector_exrs(folder: Path, values: np.ndarray, shape: tuple[int, int], unit: str) -> list[Path]:
    """Write an image for each frame, ``field_0000.exr`` and so on, in the place of those of an earlier recording.

    Parameters
    ----------
    folder : path
        Is made if it is not there.
    values : (T, k, 3) float
        Of places row by row, the row with the least y first.
    shape : (int, int)
        Rows and columns, of which there are k places.
    unit : str
        Becomes the header attribute ``palpate.unit``.

    Raises
    ------
    ParameterError
        There are not as many places as rows times columns, or not three channels of each.
    FileError
        A file cannot be written.
    """
    rows, columns = shape
    if values.ndim != 3 or values.shape[1:] != (rows * columns, 3):
        channels = int(np.prod(values.shape[1:]))
        raise ParameterError(
            f"An image of {rows} × {columns} places has {3 * rows * columns} channels and these readings have {channels}: "
            "give the rows and columns of the magnetometers."
        )
    images = values.reshape(-1, rows, columns, 3)[:, ::-1].astype(np.float32)
    files = FileList(writable_folder(folder, create=True))
    with files.new_files(LAYER) as new, write_file(new / LAYER, atomic=False):
        paths = [new / f"{LAYER}_{frame:0{DIGITS}d}.exr" for frame in range(len(images))]
        for frame, (path, image) in enumerate(zip(paths, images)):
            pictures = {f"{LAYER}.{axis}": image[:, :, i] for i, axis in enumerate(AXES)}
            write_image(path, pictures, {"palpate.unit": unit, "palpate.frame": str(frame)})
        return files.replace(new, {LAYER: paths})
