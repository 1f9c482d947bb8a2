# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate sweep``: a scene computed thousands of times with varied numbers, on all cores or many machines, resumable."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import PalpateError, counted
from . import blender, console

if TYPE_CHECKING:
    from ..sweep.study_folder import OpenStudy

MOST_FAILURES_NAMED = 5
FORMATS = ("hdf5", "zarr")
"""Formats to which a finished dataset is exported; the names of sweep.exports, which is not read before a study runs."""
MOST_NAMED = 3
"""Most properties that a sentence names."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(stopped="stopped; the same command continues.")
    parser.epilog = (
        "Limits of the command concern its own process. In the study's file run_limit (seconds) and run_memory (MB) are those "
        "of each run: one that takes more is ended and counts as failed, and the others go on. --allow-scripts also runs the "
        "Python of a study that has a job instead of a scene."
    )
    parser.add_argument(
        "study",
        metavar="STUDY.toml|DIR",
        help="file of a study, or the folder of one to continue; with --list also a scene, .blend or .npz",
    )
    parser.add_argument("--out", metavar="DIR", help="output folder (default: next to the study, with its name)")
    parser.add_argument("--workers", metavar="N", type=_count, help="processes on this machine (default: one per core)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--slurm", metavar="JOBS", type=_count, help="compute in so many jobs of SLURM, by dask-jobqueue")
    parser.add_argument(
        "--slurm-option",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="of each job: queue, account, cores, memory, walltime and others; --dry-run prints the job's script",
    )
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="use a running Dask scheduler, as tcp://HOST:8786; all machines need the folder under the same path",
    )
    parser.add_argument(
        "--format",
        choices=FORMATS,
        action="append",
        default=[],
        help="also write the finished dataset as dataset.h5 or dataset.zarr; may be given again",
    )
    parser.add_argument("--retry-failed", action="store_true", help="compute failed runs again")
    parser.add_argument(
        "--part",
        metavar="I/N",
        type=_part,
        help="compute the I-th of N parts of the runs only, for farms without a scheduler; give the command without --part at "
        "the end, which makes the dataset",
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--begin", action="store_true", help="read the scenes and freeze the study, and compute no run yet")
    what.add_argument(
        "--dry-run", action="store_true", help="estimate time and size of all runs from some of them, and keep nothing"
    )
    what.add_argument(
        "--status", action="store_true", help="show the progress of the study in the folder, which may be running"
    )
    what.add_argument(
        "--list", action="store_true", help="list the parameters that can vary in the scenes of the study, or in one scene"
    )
    blender.add_script_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    from ..api.study import require_studies

    require_studies()
    from ..sweep import studies

    place = Path(arguments.study)
    folder = studies.output_folder(place, arguments.out)
    if arguments.status:
        print(studies.status_of(folder))
        return 0
    from ..sweep import driver, exports

    driver.require_dask()
    exports.require_packages(arguments.format)
    if arguments.part is not None:
        if not place.is_dir() or arguments.begin or arguments.dry_run or arguments.list:
            raise PalpateError("--part computes runs of a study that has begun: give its folder, and --begin before that.")
        return _compute(_opened(place, folder, arguments), arguments)
    if arguments.list:
        _print_names(place, arguments)
        return 0
    if arguments.dry_run:
        return _estimate(place, folder, arguments)
    with studies.locked_folder(place, folder):
        opened = _opened(place, folder, arguments)
        if arguments.begin:
            print(f"{counted(len(opened.runs), 'run')} begun: {opened.folder}")
            return 0
        return _compute(opened, arguments)


def _count(text: str) -> int:
    count = int(text)
    if count < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a whole number above zero")
    return count


def _part(text: str) -> tuple[int, int]:
    """Return number and count of "I/N"."""
    number, _, count = text.partition("/")
    if not (number.isdigit() and count.isdigit() and 1 <= int(number) <= int(count)):
        raise argparse.ArgumentTypeError(f"{text} is not a part: write it as 2/8, the second of eight")
    return int(number), int(count)


def _opened(place: Path, folder: Path, arguments: argparse.Namespace) -> OpenStudy:
    from ..sweep import study_folder

    with console.Interrupt.raised_at_once(limits=True):  # what a beginning has written is removed again
        return study_folder.open_study(place, folder, arguments.scripts)


def _print_names(place: Path, arguments: argparse.Namespace) -> None:
    """Print what may vary in the scenes of a study, or in one scene; nothing is begun, and names of the study may be wrong."""
    from ..core.study.scene_property import PREFIX
    from ..core.study.variation import owners_text
    from ..sweep import study_folder

    with console.Interrupt.raised_at_once(limits=True):
        scenarios = study_folder.scenarios_of(place, arguments.scripts)
    for name, scenario in scenarios.items():
        print(f"{name}:")
        if scenario is None:
            print("  any name that the job knows, for a number, a text, or true and false")
            continue
        print("  " + owners_text(scenario).replace("\n", "\n  "))
        print(f"  {PREFIX}…: a property of a .blend by its path, which Copy Full Data Path gives; each run needs Blender then")


def _slurm(arguments: argparse.Namespace) -> Callable[[], Any] | None:
    """Return the request for workers to SLURM; None without --slurm."""
    from ..sweep import slurm

    options = slurm.options_of(arguments.slurm_option)
    return None if arguments.slurm is None else lambda: slurm.slurm_cluster(options, arguments.slurm)


def _estimate(place: Path, folder: Path, arguments: argparse.Namespace) -> int:
    """Print what a study takes."""
    from ..core.compiled.thread_team import count_of_cores
    from ..sweep import studies

    workers = arguments.workers or count_of_cores()
    with console.Interrupt.raised_at_once(limits=True):
        opened, found = studies.try_study(place, arguments.scripts)
    console.Interrupt.check()  # a limit that a run has taken for its own error
    print(_kind_of_runs(opened))
    if arguments.slurm:
        from ..sweep import slurm

        print(slurm.job_script(slurm.options_of(arguments.slurm_option)))
    seconds = found.seconds_of(len(opened.runs), workers)
    print(f"{counted(len(opened.runs), 'run')}, {found.seconds:.3g} s and {_size(found.size)} each")
    size = _size(found.size * len(opened.runs))
    print(f"about {_duration(seconds)} with {counted(workers, 'worker')}, {size} in '{folder}'")
    for sentence in found.failures:
        print(f"one of the {found.tried} runs that were tried failed: {sentence}")
    return 0


def _size(count: float) -> str:
    """Return a number of bytes with the unit that suits it."""
    for name, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if count >= size:
            return f"{count / size:.3g} {name}"
    return f"{count / 1e3:.3g} kB"


def _kind_of_runs(opened: OpenStudy) -> str:
    """Say whether runs need Blender, and why."""
    if opened.study.is_job:
        return f"runs by the Python of '{opened.study.scenes[0]}'"
    properties = list(dict.fromkeys(path for plan in opened.plans.values() for path in plan.scene_properties))
    if not properties:
        return "runs without Blender: all varied parameters are handled by the solver directly"
    more = f" and {len(properties) - MOST_NAMED} others" if len(properties) > MOST_NAMED else ""
    return f"each run reads the scene in a Blender of its own, because it sets {', '.join(properties[:MOST_NAMED])}{more}"


def _duration(seconds: float) -> str:
    for name, size in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {name}"
    return f"{seconds:.0f} seconds"


def _compute(opened: OpenStudy, arguments: argparse.Namespace) -> int:
    from ..sweep import studies

    with console.shown_progress("sweep", "run") as show:
        failures = studies.compute_runs(
            opened,
            show,
            workers=arguments.workers,
            retry_failed=arguments.retry_failed,
            part=arguments.part or (1, 1),
            scheduler=arguments.scheduler,
            make_cluster=_slurm(arguments),
        )
    for index, sentence in failures[:MOST_FAILURES_NAMED]:
        print(f"run {index} failed: {sentence}")
    if arguments.part is None:
        with console.Interrupt.raised_at_once():  # all of these files are written whole or not at all
            found, written = studies.write_results(opened, arguments.format)
    else:
        found, written = studies.status_of(opened.folder), []
    print(found)
    print(f"results: {opened.folder}")
    for path in written:
        print(f"export: {path}")
    if found.failed:
        print(f"why runs failed: {opened.folder / 'runs.parquet'}, column message; --retry-failed computes them again")
    return 0
