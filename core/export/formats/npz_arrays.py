# SPDX-License-Identifier: GPL-3.0-or-later
"""NPZ: one archive of NumPy arrays per sensor, in double precision."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...figures.figure_style import FigureStyle
from ...io.bake_folder import folder_names
from ...io.bake_reader import Bake
from ...io.recording_npz import write_arrays
from ...jobs import Job
from ..exporter import Exporter, bake_arrays, sensor_progress


def write_npz(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write one archive per sensor."""
    written = []
    for name, stem in folder_names(bake.texels).items():
        yield sensor_progress(bake, name)
        path = folder / f"{stem}.npz"
        channels = bake.recording.sensors[name].channels
        arrays = {"frame": bake.recording.frames, "time": bake.recording.times, **bake_arrays(bake, name)}
        if channels is not None:
            arrays |= {"channels_names": np.array(channels.names), "channels_unit": np.array(channels.unit)}
        write_arrays(path, arrays)
        written.append(path)
    return written


EXPORTER = Exporter("npz", write_npz)
