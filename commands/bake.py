# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate bake``: bakes the sensors of a .blend to tactile images, and on request saves a .blend that shows them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import FileError, SceneError
from ..core.io.file_writing import writable_folder
from ..core.response import net_shear
from . import blender, console

if TYPE_CHECKING:
    from ..addon.bake.bake import BakeResult
    from ..addon.bake.bake_files import BlendToSave

LAST_FRAME = 1048574
"""The last frame that a scene of Blender can have."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE.blend", help="file with sensors and targets")
    parser.add_argument("--out", metavar="DIR", help="bake folder (default: the one that the file names)")
    parser.add_argument(
        "--sensor",
        metavar="NAME",
        action="append",
        help="read out only this sensor, and let the others act as pads; may be given again. Cannot be saved.",
    )
    parser.add_argument(
        "--frames",
        metavar=("FIRST", "LAST"),
        nargs=2,
        type=int,
        help="frames to compute (default: those of the scene); the bodies start at FIRST. A scene that is saved keeps them.",
    )
    parser.add_argument(
        "--model",
        metavar="[NAME=]SENSOR.toml",
        action="append",
        default=[],
        help="parameters and effects for the only sensor, or for the one of this name; may be given again. A scene that is "
        "saved keeps them.",
    )
    parser.add_argument(
        "--no-images",
        action="store_true",
        help="write the recordings alone, without an image per frame and sensor. Cannot be saved.",
    )
    parser.add_argument(
        "--scenario",
        metavar="FILE.npz",
        help="bake nothing, and write what the solver would compute into a file, for palpate sweep where there is no Blender",
    )
    parser.add_argument(
        "--overrides",
        metavar="FILE.toml",
        help="set properties of the file by their paths before it is baked; a scene that is saved keeps them",
    )
    parser.add_argument(
        "--study",
        metavar="STUDY.toml",
        help="with --scenario: also write what the properties are that a study varies by their paths, and a copy of the .blend "
        "whose files are found from any folder",
    )
    blender.add_script_arguments(parser)
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--save", action="store_true", help="save motion, heat maps and arrows into SCENE.blend itself")
    where.add_argument("--save-as", metavar="FILE", help="save them into another .blend")


def run(arguments: argparse.Namespace) -> int:
    if arguments.sensor and (arguments.save or arguments.save_as):
        print("palpate bake: --sensor bakes a part of the scene, which cannot be saved: leave one of them out", file=sys.stderr)
        return 2
    if arguments.no_images and saved_path(arguments):
        print("palpate bake: --no-images leaves out what a saved scene shows: leave one of them out", file=sys.stderr)
        return 2
    if arguments.scenario is not None and saved_path(arguments):
        print("palpate bake: --scenario bakes nothing that could be saved: leave one of them out", file=sys.stderr)
        return 2
    if arguments.study is not None and arguments.scenario is None:
        print("palpate bake: --study says what --scenario also writes: add --scenario FILE.npz", file=sys.stderr)
        return 2
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.scene, arguments.scripts)
        own_start = scene.frame_start
        saved = saved_path(arguments)
        blend = None if saved is None else blender.blend_to_save(saved)
        _prepare(scene, arguments)
        if arguments.scenario is not None:
            return _write_scenario(scene, arguments.scenario, arguments.study)
        if saved is not None:
            _warn_of_keyframes(scene)
        baked = bake_with_progress(scene, into_scene=saved is not None, images=not arguments.no_images, blend=blend)
    print(report(baked))
    if scene.frame_start != own_start:
        print(f"note: bodies and bristles started at frame {scene.frame_start}, not at the scene's {own_start}")
    print()
    for name, folder in baked.folders.items():
        print(f"{name}: {folder}")
    if saved:
        print(f"saved: {saved}")
    return 0


def _warn_of_keyframes(scene: Any) -> None:
    """Say on stderr that a scene would get very many keyframes."""
    from ..addon.bake.scene_writer import keyframe_warning

    if warning := keyframe_warning(scene):
        print(f"warning: {warning}", file=sys.stderr, flush=True)


def _write_scenario(scene: Any, path: str, study: str | None) -> int:
    """Read a scene and write its scenario, and a file with what a study needs to read the scene again."""
    from ..addon.scene import scene_reader
    from ..core.io.file_writing import writable_file
    from ..core.io.scenario_npz import save_scenario

    target = writable_file(path)
    if study is not None:
        _write_properties(Path(study), target)
    reading = console.run_with_progress_bar("read", scene_reader.read_scene(scene))
    save_scenario(target, reading.scenario)
    for warning in reading.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return 0


def _write_properties(study: Path, target: Path) -> None:
    """Write what the properties are that a study names, and a copy of the .blend; neither where the study names none."""
    import bpy

    from ..addon.study import scene_overrides
    from ..core.study.scene_property import is_scene_property, write_properties
    from ..core.study.study_file import read_study

    paths = [name for name in read_study(study).vary if is_scene_property(name)]
    if not paths:
        return
    properties = [scene_overrides.describe(path) for path in paths]
    bpy.ops.file.make_paths_absolute()  # the copy lies in another folder
    blender.blend_to_save(target.with_suffix(".blend")).write(target.with_suffix(".blend"))
    write_properties(target.with_suffix(".json"), properties)


def _prepare(scene: Any, arguments: argparse.Namespace) -> None:
    """Change the open scene as the options ask."""
    if arguments.overrides is not None:
        _override(arguments.overrides)
    for option in arguments.model:
        _put_model(scene, option)
    if arguments.frames:
        scene.frame_start, scene.frame_end = _frame_range(*arguments.frames)
    if arguments.out is not None:
        blender.require_utf8(arguments.out)
        scene.palpate.folder = str(writable_folder(arguments.out, create=True))
    if not arguments.save:
        _check_saved_bake(scene, arguments.scene)
    if arguments.sensor:
        _read_out_only(scene, arguments.sensor)


def bake_with_progress(
    scene: Any, into_scene: bool = True, images: bool = True, blend: BlendToSave | None = None
) -> BakeResult:
    """Bake a scene with a progress bar on stderr, and save a .blend with it; Ctrl-C leaves an earlier bake as it was."""
    from ..addon.bake import bake

    return console.run_with_progress_bar("bake", bake.bake(scene, into_scene, images, blend))


def report(baked: BakeResult) -> str:
    """Return a summary of a bake for the terminal."""
    recording = baked.recording
    first, last = recording.frames[0], recording.frames[-1]
    span = f"{first} to {last} ({recording.times[-1]:.2f} s), substep {recording.dt * 1e3:.3g} ms"
    lines = [f"frames {span}"]
    texels = {sensor.name: sensor.texels for sensor in baked.scenario.sensors}
    rows: list[tuple[str, ...]] = [("sensor", "texels", "peak texel", "peak normal", "peak shear", "normal at end")]
    peaks, at_end = {name: np.zeros(3) for name in baked.folders}, dict.fromkeys(baked.folders, 0.0)
    for part in recording.blocks():
        for name, readings in part.sensors.items():
            normal = readings.normal_force.sum(axis=1)
            shear = np.linalg.norm(net_shear(readings, texels[name]), axis=1)
            own = (readings.normal_force.max(initial=0.0), normal.max(), shear.max())
            peaks[name], at_end[name] = np.maximum(peaks[name], own), float(normal[-1])
    for name in baked.folders:
        count = recording.sensors[name].normal_force.shape[1]
        rows.append((name, str(count), *(_newtons(value) for value in (*peaks[name], at_end[name]))))
    lines += ["", console.text_table(rows, "<>>>>>")]
    lines += [f"warning: {warning}" for warning in recording.warnings]
    return "\n".join(lines)


def _newtons(value: float) -> str:
    """Return a force as text; rounding errors appear as zero."""
    return f"{value if value > 1e-9 else 0.0:.4f} N"


def saved_path(arguments: argparse.Namespace) -> Path | None:
    """Return the file that --save or --save-as names; None if the scene is not saved."""
    if not arguments.save and arguments.save_as is None:
        return None
    path = Path(arguments.scene if arguments.save_as is None else arguments.save_as)
    if path.name in ("", ".."):
        raise FileError(f"'{path}' is a folder: give the name of a .blend file in it.")
    return path if path.suffix == ".blend" else path.with_name(f"{path.name}.blend")


def _check_saved_bake(scene: Any, blend: str) -> None:
    """Raise SceneError if the bake would replace the one that the saved file shows."""
    import bpy

    from ..addon.bake import bake_files

    target = bake_files.bake_folder(scene).resolve()
    for obj in scene.objects:
        shown = obj.palpate.bake_folder
        if shown and Path(bpy.path.abspath(shown)).resolve().parent == target:
            raise SceneError(
                f"'{blend}' plays the bake in '{target}', which would no longer fit it: "
                "add --save to renew both, or --out DIR to bake elsewhere."
            )


def _override(file: str) -> None:
    """Apply the option ``--overrides FILE.toml``."""
    from ..addon.study import scene_overrides
    from ..core.study.scene_property import read_overrides

    scene_overrides.apply(read_overrides(file))


def _put_model(scene: Any, option: str) -> None:
    """Apply the option ``--model [NAME=]SENSOR.toml`` to a sensor."""
    from ..addon.measured import gap_results
    from ..core.io.sensor_toml import read_sensor

    name, _, file = ("", "", option) if Path(option).is_file() else option.partition("=")
    if not file:
        name, file = "", name
    model = read_sensor(file)
    gap_results.put(gap_results.sensor_called(scene, name or None, f"write --model NAME={file}"), model)


def _frame_range(first: int, last: int) -> tuple[int, int]:
    """Return the frame range of --frames; raise SceneError if it is not one."""
    if last < first:
        raise SceneError(f"--frames {first} {last} runs backwards: give the first frame first.")
    if first < 0:
        raise SceneError(f"--frames {first} {last} begins before frame 0: Blender's scenes begin there.")
    if last > LAST_FRAME:
        raise SceneError(f"--frames {first} {last} ends after frame {LAST_FRAME}, the last of Blender: bake fewer frames.")
    return first, last


def _read_out_only(scene: Any, wanted: list[str]) -> None:
    """Make all sensors but the wanted ones pads."""
    from ..addon.scene import participants

    participants.sensors_called(scene, wanted)
    for obj in scene.objects:
        if obj.palpate.role == "SENSOR" and obj.name not in wanted:
            obj.palpate.role = "PAD"
