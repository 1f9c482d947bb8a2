# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap``: what the model of a sensor misses against measurements, as a report and as an amended sensor.

With ``--plan``: what the recordings can tell at all, and the trajectory that tells what they cannot.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import SceneError
from ..core.io.file_writing import writable_folder
from . import blender, checks, console

if TYPE_CHECKING:
    from ..api.gap import Gap
    from ..core.gap.selection.findings import Diagnosis

OUTPUTS = ("gap.json", "sensor.toml", "report.html")
"""Files that are written beside the plots."""
WISHES = ("between", "depth", "speed", "duration", "area")
"""Options that say what the next recording is to be like."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG.toml", help="description of the measurements (docs/gap.md), with its CSV files")
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="folder for gap.json, sensor.toml, report.html and plots; optional with --plan",
    )
    parser.add_argument("--blend", metavar="SCENE.blend", help="also put the amended sensor into this file")
    parser.add_argument("--sensor", metavar="NAME", help="the sensor in it (default: the only one)")
    plan = parser.add_argument_group("before anything is fitted")
    plan.add_argument(
        "--plan", action="store_true", help="list the effects that the recordings distinguish, and plan the next recording"
    )
    plan.add_argument("--between", nargs=2, metavar="EFFECT", help="effects that the next recording has to separate")
    plan.add_argument("--depth", type=float, metavar="M", help="largest depth (m; N where the rig knows forces)")
    plan.add_argument(
        "--speed", type=float, metavar="M/S", help="largest speed of the probe (m/s; N/s where the rig knows forces)"
    )
    plan.add_argument("--duration", type=float, metavar="S", help="longest duration")
    plan.add_argument(
        "--area", type=float, nargs=4, metavar=("X0", "X1", "Y0", "Y1"), help="area of the presses, in the sensor's frame, m"
    )
    blender.add_script_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    from ..addon.session import dependencies

    dependencies.choose_numba_cache()
    from ..api.gap import find_gap, read_rig
    from ..core.gap.report.amended_sensor import amended_sensor

    _check(arguments)
    if arguments.plan:
        return _plan(arguments)
    if arguments.sensor and not arguments.blend:
        raise SceneError("--sensor names a sensor of a scene: give the scene with --blend.")
    with console.Interrupt.raised_at_once():
        rig = read_rig(arguments.rig)
        folder = writable_folder(arguments.out, create=True)
        checks.outputs_are_no_inputs((folder / name for name in OUTPUTS), (arguments.rig,))
    if arguments.blend:
        _sensor_in_scene(arguments)  # wrong names and read-only files are found before the work
    with console.Interrupt.raised_at_once(), console.shown_progress("gap") as show:
        gap = find_gap(rig, show)
        gap.report(folder, show)
    if arguments.blend:
        _put_into_scene(arguments, amended_sensor(gap.diagnosis))
    _print_report(arguments, gap, folder)
    return 0


def _check(arguments: argparse.Namespace) -> None:
    """Raise if options do not go with each other."""
    wishes = [name for name in WISHES if getattr(arguments, name) is not None]
    if arguments.plan and (arguments.blend or arguments.sensor):
        raise SceneError("--plan only reads the recordings: leave out --blend and --sensor.")
    if wishes and not arguments.plan:
        raise SceneError(f"--{wishes[0]} says what to plan: give --plan as well.")
    if not arguments.plan and not arguments.out:
        raise SceneError("Give the folder for the results with --out DIR.")


def _plan(arguments: argparse.Namespace) -> int:
    """Say which kinds of effects the recordings can tell apart, and write the next experiment."""
    from ..api.experiment import plan_experiment
    from ..api.gap import read_rig
    from ..core.gap.report import plan_files

    with console.Interrupt.raised_at_once():
        rig = read_rig(arguments.rig)
        folder = writable_folder(arguments.out, create=True) if arguments.out else None
        if folder is not None:
            names = (plan_files.PLAN, plan_files.TRAJECTORY)
            checks.outputs_are_no_inputs((folder / name for name in names), (arguments.rig,))
        limits = {name: getattr(arguments, name) for name in WISHES if name != "between"}
        with console.shown_progress("plan") as show:
            plan = plan_experiment(rig, limits, tuple(arguments.between or ()), show)
    print(console.text_table([("effect", "may be confused with"), *plan.rows], "<<"))
    print()
    print(plan.sentence)
    for text in rig.warnings:
        print(f"note: {text}")
    if folder is None and not plan.is_complete:
        print("note: --out DIR writes it.")
    for path in plan.report(folder) if folder is not None else ():
        print(f"wrote:  {path}")
    return 0


def _print_report(arguments: argparse.Namespace, gap: Gap, folder: Path) -> None:
    """Print what was found and where it was written."""
    from ..core.gap.report import sentences

    result = gap.diagnosis
    print(gap.headline)
    rows = [("", "parameter", "value (95 % interval)"), *_parameter_rows(result)]
    print()
    print(console.text_table(rows, "<<<"))
    print()
    for text in [*gap.rig.warnings, *sentences.warnings(result)]:
        print(f"note: {text}")
    print(f"report: {folder / 'report.html'}")
    print(f"sensor: {folder / 'sensor.toml'}")
    if arguments.blend:
        print(f"saved:  {arguments.blend}")


def _parameter_rows(result: Diagnosis) -> list[tuple[str, str, str]]:
    """Owner, name and value of each fitted number with its interval, then of numbers of effects that have none."""
    from ..core.gap.fitting import least_squares
    from ..core.gap.report import sentences

    owners = {least_squares.BASE: "base model", least_squares.RECORDING: "recordings"}
    owners |= {index: effect.name for index, effect in enumerate(result.best.model.effects)}
    rows = [(owners[one.effect], one.name, sentences.interval_text(one)) for one in result.intervals]
    known = {(one.effect, one.name) for one in result.intervals}
    for index, effect in enumerate(result.best.model.effects):
        found = {name: value for name, value in effect.values.items() if (index, name) not in known}
        rows += [(effect.name, name, f"{value:.4g} (no interval)") for name, value in found.items() if isinstance(value, float)]
    return rows


def _sensor_in_scene(arguments: argparse.Namespace) -> Any:
    """Open the scene of --blend and return the sensor that gets the result."""
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.blend, arguments.scripts)
        from ..addon.measured import gap_results

        blender.check_writable(Path(arguments.blend))
        return gap_results.sensor_called(scene, arguments.sensor)


def _put_into_scene(arguments: argparse.Namespace, sensor: Any) -> None:
    """Put the amended sensor on a sensor of a .blend and save it; opened again, because it may have been edited meanwhile."""
    with console.blender_output_hidden():
        target = _sensor_in_scene(arguments)
        from ..addon.measured import gap_results

        gap_results.put(target, sensor)
        blender.save_blend(Path(arguments.blend))
