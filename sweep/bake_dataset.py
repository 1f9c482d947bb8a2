# SPDX-License-Identifier: GPL-3.0-or-later
"""One bake as a dataset in the layout of LeRobot: what a study with one run would become."""

from __future__ import annotations

from pathlib import Path

from ..core.errors import FileError, os_error_reason
from ..core.export.exporter import Exporter, sensor_progress
from ..core.figures.figure_style import FigureStyle
from ..core.io.bake_reader import Bake
from ..core.jobs import Job
from .features import frames_of
from .lerobot import LeRobotWriter
from .parts import require_pyarrow

FOLDER = "lerobot"


def write_lerobot(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write the dataset into the folder ``lerobot``; it is a job as every exporter's is."""
    require_pyarrow()
    first = next(iter(bake.texels))
    yield sensor_progress(bake, first)
    frames, scene = frames_of(bake.recording, bake.sensors), bake.manifests[first].scene_file
    try:
        writer = LeRobotWriter(folder / FOLDER, frames.layout, Path(scene).stem if scene else "bake")
        try:
            writer.add(0, bake.recording.digest, {}, frames.columns)
            writer.finish()
        finally:
            writer.close()
    except OSError as error:
        raise FileError(f"'{folder}' could not be written ({os_error_reason(error)}): free some space there.") from error
    return sorted(path for path in (folder / FOLDER).rglob("*") if path.is_file())


EXPORTER = Exporter("lerobot", write_lerobot)
"""Not among the formats that a .blend may choose."""
