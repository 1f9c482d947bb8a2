# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap``: what the model of a sensor misses against measurements, as a report and as an amended sensor."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import SceneError
from ..core.io.disk_space import require_space
from ..core.io.file_list import FileList
from ..core.io.file_writing import writable_folder
from ..core.jobs.job_runner import part_of_job
from ..core.jobs.progress import Job
from . import blender, checks, console

if TYPE_CHECKING:
    from ..core.gap.dataset.rig import Rig
    from ..core.gap.selection.findings import Diagnosis

OUTPUTS = ("gap.json", "sensor.toml", "report.html")
"""Files that are written beside the plots."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG.toml", help="what was measured (docs/gap.md); its CSV files lie beside it")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for gap.json, sensor.toml, report.html and plots")
    parser.add_argument("--blend", metavar="SCENE.blend", help="also put the amended sensor into this file")
    parser.add_argument("--sensor", metavar="NAME", help="the sensor in it (default: the only one)")
    blender.add_script_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    from ..addon.session import dependencies

    dependencies.choose_numba_cache()
    from ..core.gap.dataset.rig import read_rig
    from ..core.gap.report import summary
    from ..core.gap.report.amended_sensor import amended_sensor
    from ..core.solver import precompile

    if arguments.sensor and not arguments.blend:
        raise SceneError("--sensor names a sensor of a scene: give the scene with --blend.")
    with console.Interrupt.raised_at_once():
        rig = read_rig(arguments.rig)
        folder = writable_folder(arguments.out, create=True)
        checks.outputs_are_no_inputs((folder / name for name in OUTPUTS), (arguments.rig,))
        require_space(folder, summary.report_bytes(rig), "The report")
        FileList(folder)  # it completes what a killed run has left
    if arguments.blend:
        _sensor_in_scene(arguments)  # wrong names and read-only files are found before the work
    with console.Interrupt.raised_at_once():
        precompile.compile_solver_with_notice()
        result, errors = console.run_with_progress_bar("gap", _diagnose_and_report(rig, folder))
    if arguments.blend:
        _put_into_scene(arguments, amended_sensor(result))
    _print_report(arguments, rig, result, errors, folder)
    return 0


def _print_report(arguments: argparse.Namespace, rig: Rig, result: Diagnosis, errors: Any, folder: Path) -> None:
    """Print what was found and where it was written."""
    from ..core.gap.fitting import least_squares
    from ..core.gap.report import sentences

    print(sentences.headline(result, errors))
    rows = [("", "parameter", "value (95 % interval)")]
    for one in result.intervals:
        owners = {least_squares.BASE: "base model", least_squares.RECORDING: "recordings"}
        owner = owners.get(one.effect) or result.best.model.effects[one.effect].name
        rows.append((owner, one.name, sentences.interval_text(one)))
    print()
    print(console.text_table(rows, "<<<"))
    print()
    for text in [*rig.warnings, *sentences.warnings(result)]:
        print(f"note: {text}")
    print(f"report: {folder / 'report.html'}")
    print(f"sensor: {folder / 'sensor.toml'}")
    if arguments.blend:
        print(f"saved:  {arguments.blend}")


def _diagnose_and_report(rig: Rig, folder: Path) -> Job[tuple[Diagnosis, Any]]:
    """Find the gap of a rig and write its report; return the diagnosis and its errors."""
    from ..core.gap.report import summary
    from ..core.gap.report.comparison import gap_errors
    from ..core.gap.selection.diagnosis import diagnose

    result = yield from part_of_job(diagnose(rig), lambda step: replace(step, done=int(950 * step.share), total=1000))
    errors = gap_errors(result)
    report = summary.write_report(result, folder, errors)
    yield from part_of_job(report, lambda step: replace(step, done=950 + int(50 * step.share), total=1000))
    return result, errors


def _sensor_in_scene(arguments: argparse.Namespace) -> Any:
    """Open the scene of --blend and return the sensor that gets the result."""
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.blend, arguments.scripts)
        from ..addon.measured import gap_results

        blender.check_writable(Path(arguments.blend))
        return gap_results.sensor_called(scene, arguments.sensor)


def _put_into_scene(arguments: argparse.Namespace, sensor: Any) -> None:
    """Put the amended sensor on a sensor of a .blend and save it; opened anew, because it may have been edited meanwhile."""
    with console.blender_output_hidden():
        target = _sensor_in_scene(arguments)
        from ..addon.measured import gap_results

        gap_results.put(target, sensor)
        blender.save_blend(Path(arguments.blend))
