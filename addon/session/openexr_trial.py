# SPDX-License-Identifier: GPL-3.0-or-later
"""Run by its path, in a child process: use the OpenEXR library and Blender's own copy of it in turn.

    blender --background --python openexr_trial.py -- SYS_PATH_AS_JSON FOLDER_FOR_IMAGES

It prints :data:`PASSED` when each copy has read what the other wrote. It may end in a segmentation fault instead.
"""

import json
import os
import sys
from pathlib import Path

PASSED = "palpate: the OpenEXR library works here"
SHAPES = ((5, 7), (40, 33))
"""Heights and widths of the images: one block of scan lines, and several."""


def by_blender(path: Path) -> None:
    """Let Blender write an image with its own copy."""
    import bpy

    image = bpy.data.images.new("trial", 8, 8, float_buffer=True)
    image.file_format, image.filepath_raw = "OPEN_EXR", str(path)
    image.save()


def turn(folder: Path, number: int) -> None:
    """Write and read by the library, read by Blender, write by Blender, read by the library."""
    import bpy
    import Imath
    import numpy as np
    import OpenEXR

    channel = Imath.Channel(Imath.PixelType(Imath.PixelType.FLOAT))
    for height, width in SHAPES:
        path = folder / f"library_{number}_{height}.exr"
        values = np.random.default_rng(number).random((height, width)).astype(np.float32)
        header = OpenEXR.Header(width, height)
        header |= {"channels": dict.fromkeys("RGB", channel), "palpate.trial": b"text"}
        file = OpenEXR.OutputFile(str(path), header)
        file.writePixels(dict.fromkeys("RGB", values.tobytes()), height)
        file.close()
        file = OpenEXR.InputFile(str(path))
        same = np.frombuffer(file.channels(["R"])[0], np.float32).reshape(height, width)
        assert (same == values).all() and file.header()["palpate.trial"] == b"text"
        file.close()
        image = bpy.data.images.load(str(path))
        image.colorspace_settings.name = "Non-Color"
        seen = np.array(image.pixels[:], np.float32).reshape(height, width, 4)
        assert (seen[::-1, :, 0] == values).all()
        bpy.data.images.remove(image)
    path = folder / f"blender_{number}.exr"
    by_blender(path)
    file = OpenEXR.InputFile(str(path))
    assert "R" in file.header()["channels"] and len(file.channels(["R"])) == 1
    file.close()


def main(paths: str, folder: str) -> None:
    """Try both copies, Blender's first, as it is in a session."""
    sys.path += [path for path in json.loads(paths) if path not in sys.path]
    import bpy  # noqa: F401 loaded before the library, as in a session

    by_blender(Path(folder) / "first.exr")
    for number in range(2):
        turn(Path(folder), number)
    print(PASSED, flush=True)
    os._exit(0)  # Blender as a Python module may hang at exit


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
