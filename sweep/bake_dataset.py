# SPDX-License-Identifier: GPL-3.0-or-later
"""One bake as a dataset in the layout of LeRobot: what a study with one run would become."""

from __future__ import annotations

from pathlib import Path

from ..core.errors import FileError, os_error_reason
from ..core.export.exporter import Exporter, sensor_progress
from ..core.figures.figure_style import FigureStyle
from ..core.io.bake_reader import Bake
from ..core.jobs.progress import Job
from ..core.study.run_record import RunRecord
from .dataset import require_pyarrow
from .encoded_run import encode_run
from .features import bake_frames
from .lerobot_writer import LeRobotWriter

FOLDER = "lerobot"


def write_lerobot(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write the dataset into the folder ``lerobot``; it is a job as every exporter's is."""
    require_pyarrow()
    first = next(iter(bake.texels))
    yield sensor_progress(bake, first)
    frames = encode_run(bake_frames(bake))
    scene = bake.manifests[first].scene_file
    writer = LeRobotWriter(folder / FOLDER, frames.layout, Path(scene).stem if scene else "bake")
    try:
        writer.add(RunRecord(folder, bake.recording.digest, 0, sensors=tuple(bake.texels)), frames)
        writer.finish()
    except BaseException as error:
        writer.abandon()
        if isinstance(error, OSError):
            raise FileError(f"'{folder}' could not be written ({os_error_reason(error)}): free some space there.") from error
        raise
    return sorted(path for path in (folder / FOLDER).rglob("*") if path.is_file())


EXPORTER = Exporter("lerobot", "LeRobot", "A dataset of one episode; needs the package pyarrow", -1, write_lerobot)
"""Not in the registry: a .blend stores no choice of it."""
