# SPDX-License-Identifier: GPL-3.0-or-later
"""Open a study, compute the runs that are left, and write its dataset and report: what a command and a script call."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.compiled.thread_team import count_of_cores
from ..core.errors import PalpateError
from ..core.io.file_writing import writable_folder
from ..core.io.hidden_folder import PRIVATE_FOLDER, FolderLock, is_private_folder
from ..core.jobs.progress import Progress
from ..core.study.run_files import done_runs, failed_runs, make_folders
from ..core.study.study_file import Run
from . import driver, study_folder
from .program import require_allowed
from .scene_evaluation import REFUSE, read_blend
from .status import Status, status_of
from .study_folder import OpenStudy
from .worker import Limits


@dataclass(frozen=True)
class Computing:
    """How a study is computed.

    Attributes
    ----------
    workers : int or None
        Processes on this machine; None is one for each core.
    scheduler : str or None
        Address of a running Dask scheduler.
    make_cluster : callable or None
        Starts a cluster of Dask, as :func:`.slurm.slurm_cluster` does.
    scripts : str
        What is done about Python in scenes and jobs, one of :data:`.scene_evaluation.SCRIPTS`.
    part : (int, int)
        Number and count: which of so many parts of the runs is computed.
    retry_failed : bool
        Compute failed runs again.
    own_disks : bool
        Whether workers do not see the study's folder, and runs come back from them.
    """

    workers: int | None = None
    scheduler: str | None = None
    make_cluster: Callable[[], Any] | None = None
    scripts: str = REFUSE
    part: tuple[int, int] = (1, 1)
    retry_failed: bool = False
    own_disks: bool = False

    def runs_of(self, opened: OpenStudy) -> list[Run]:
        """Return the runs of the part."""
        number, count = self.part
        return [run for run in opened.runs if run.index % count == number - 1]


def output_folder(place: Path, out: Path | str | None) -> Path:
    """Return the absolute output folder of a study's file, or of the folder in which it goes on."""
    if place.is_dir():
        if out is not None:
            raise PalpateError(f"'{place}' is a folder, in which its study goes on: leave --out away, or give a study's file.")
        return place.absolute()
    return (Path(out) if out is not None else place.with_suffix("")).absolute()  # as every machine has to see it


@contextmanager
def locked_folder(place: Path, folder: Path) -> Iterator[None]:
    """Hold a study's folder, which is made where it is missing, and removed again if the study was refused."""
    is_new = not folder.exists()
    lock = FolderLock(writable_folder(folder, create=not place.is_dir()), "sweep")
    try:
        yield
    finally:
        lock.release()
        if is_new:
            _remove_unless_begun(folder)


def _remove_unless_begun(folder: Path) -> None:
    """Remove the folder that was made for a study which was then refused, if nothing but Palpate's own mark is in it."""
    if [path.name for path in folder.iterdir()] == [PRIVATE_FOLDER] and is_private_folder(folder / PRIVATE_FOLDER):
        shutil.rmtree(folder / PRIVATE_FOLDER, ignore_errors=True)
        with suppress(OSError):
            folder.rmdir()


def open_study(place: Path, folder: Path, scripts: str, check: Callable[[], object] = lambda: None) -> OpenStudy:
    """Open a study by its file or folder; a .blend is read in a Blender of its own, which is gone before the runs begin.

    `check` is called after each scene, and may raise to stop.
    """

    def read(blend: Path, target: Path) -> None:
        read_blend(blend, target, scripts, "--study", str(place))
        check()

    if place.is_dir():
        return study_folder.resume_study(folder)
    return study_folder.begin_study(place, folder, read, scripts)


def compute_runs(opened: OpenStudy, how: Computing, show: Callable[[Progress], object]) -> list[tuple[int, str]]:
    """Compute the runs that are left, and return the indices and sentences of those that failed now.

    Parameters
    ----------
    opened : OpenStudy
    how : Computing
    show : callable
        Called with the progress, and may raise to stop; what is done is kept.
    """
    make_folders(opened.folder)
    runs = how.runs_of(opened)
    over = done_runs(opened.folder) | (set() if how.retry_failed else failed_runs(opened.folder))
    left = [run for run in runs if run.digest not in over]
    if not left:
        return []
    require_allowed(opened.study, how.scripts)

    def show_tally(tally: driver.Tally) -> None:
        stage = f"sweep, failed={tally.failed}" if tally.failed else "sweep"
        show(Progress(stage, len(runs) - len(left) + tally.finished, len(runs)))

    show_tally(driver.Tally())
    workers = min(how.workers or count_of_cores(), len(left))
    with driver.dask_client(how.scheduler, workers, how.make_cluster) as client:
        limits = Limits.of(opened.study)
        way = None
        if how.own_disks:
            from .own_disks import way_to

            way = way_to(client, opened.folder, limits, how.scripts)
        tally = driver.run_study(client, opened.folder, left, limits, show_tally, how.scripts, way)
    return tally.failures


def write_results(opened: OpenStudy, formats: Sequence[str] = ()) -> tuple[Status, list[Path]]:
    """Write dataset, report and exports of a study if runs are done; return how far it is, and the exported files.

    Each file is written whole or not at all.
    """
    from .dataset import publish
    from .exports import EXPORTS
    from .report import write_report

    found, written = status_of(opened.folder), []
    if found.done:
        publish(opened.folder, opened.runs)
        written = [path for kind in dict.fromkeys(formats) for path in EXPORTS[kind](opened.folder)]
        write_report(opened.folder, opened.runs)
    return found, written
