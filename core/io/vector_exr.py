# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of readings with three signed channels in the OpenEXR format: one layer with the channels X, Y and Z.

Image programs, Blender's among them, show the channels of a layer as one vector. All are 32-bit floats in the unit of the
readings. Row 0 of the places is the bottom of the picture, as in tactile images.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import ParameterError
from .exr_codec import in_order, write_all
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
    names = in_order(f"{LAYER}.{axis}" for axis in AXES)
    order = [AXES.index(name[-1]) for name in names]
    images = values.reshape(-1, rows, columns, 3)[:, ::-1, :, order]
    table = np.ascontiguousarray(np.moveaxis(images, 3, 2), dtype="<f4")
    about = [{"palpate.unit": unit, "palpate.frame": str(frame)} for frame in range(len(table))]
    files = FileList(writable_folder(folder, create=True))
    with files.new_files(LAYER) as new, write_file(new / LAYER, atomic=False):
        paths = [new / f"{LAYER}_{frame:0{DIGITS}d}.exr" for frame in range(len(table))]
        write_all(paths, names, table, about)
        return files.replace(new, {LAYER: paths})
