# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate sensor``: sensors of a scene as files of other simulators, and sensors from them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..core.errors import FileError
from ..core.io.file_writing import writable_folder
from ..core.io.input_files import require_regular
from ..core.simulators.sensor_format import written_formats
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from . import blender, checks, console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    kinds = parser.add_subparsers(dest="kind", metavar="export | import", required=True)
    save = kinds.add_parser("export", help="write the sensors of a .blend for another simulator")
    save.add_argument("scene", metavar="FILE", help="a .blend with the sensors, a sensor.toml or a probe list; it is only read")
    formats = written_formats()
    save.add_argument("--to", metavar="FORMAT", choices=formats, required=True, help=", ".join(formats))
    save.add_argument("--out", metavar="DIR", default="palpate-sensors", help="folder to write to (default: %(default)s)")
    save.add_argument("--sensor", metavar="NAME", action="append", help="only this sensor; may be given again")
    blender.add_script_arguments(save)
    save.set_defaults(action=_export)
    load = kinds.add_parser("import", help="put the sensors of a file of another program into a .blend")
    load.add_argument(
        "file", metavar="FILE", help="MJCF, URDF, USD, probe list (.json), OpenRAVE's XML, or a .blend of GenTact"
    )
    load.add_argument("scene", metavar="SCENE.blend", help="existing file that gets the sensors")
    load.add_argument("--sensor", metavar="NAME", action="append", help="only this sensor of the file; may be given again")
    load.add_argument("--save-as", metavar="OUT.blend", help="save into another .blend (default: SCENE.blend itself)")
    blender.add_script_arguments(load)
    load.set_defaults(action=_import)


def run(arguments: argparse.Namespace) -> int:
    arguments.action(arguments)
    return 0


def _export(arguments: argparse.Namespace) -> None:
    checks.outputs_are_no_inputs((arguments.out,), (arguments.scene,))
    writable_folder(arguments.out, create=True)
    from ..api.sensors import export_sensor

    sensors = _sensors_of(arguments)
    written = export_sensor(sensors, arguments.to, arguments.out)
    for note in written.notes:
        print(f"note: {note}", file=sys.stderr)
    for path in written.files:
        print(path)


def _sensors_of(arguments: argparse.Namespace) -> list[SensorOnMesh]:
    """Return the sensors of a .blend, or the one of a file of its own."""
    if Path(arguments.scene).suffix.lower() in (".toml", ".json"):
        from ..api.sensors import read_sensor

        found = read_sensor(arguments.scene)
        for name in arguments.sensor or ():
            if name != found.name:
                raise FileError(f"There is no sensor '{name}' in '{arguments.scene}': it has '{found.name}'.")
        return [found]
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.scene, arguments.scripts)
        from ..addon.authoring import sensor_exchange

        return sensor_exchange.sensors_on_meshes(scene, arguments.sensor or ())


def _import(arguments: argparse.Namespace) -> None:
    path = Path(arguments.scene if arguments.save_as is None else arguments.save_as)
    checks.outputs_are_no_inputs((path,), (arguments.file,))
    blender.check_writable(path)
    require_regular(arguments.file)
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.scene, arguments.scripts)
        import bpy

        from ..addon.authoring import sensor_import

        with bpy.context.temp_override(scene=scene):
            objects, notes = sensor_import.import_file(bpy.context, arguments.file, arguments.sensor or ())
        lines = [f"'{obj.name}': {len(obj.data.vertices)} vertices" for obj in objects]
        blender.save_blend(path)
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    print(*lines, f"saved: {path}", sep="\n")
