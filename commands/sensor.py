# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate sensor``: sensors of a scene as files of other simulators."""

from __future__ import annotations

import argparse
import sys

from ..core.io.file_writing import writable_folder
from ..core.simulators.registry import export_sensors, written_formats
from . import blender, checks, console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    kinds = parser.add_subparsers(dest="kind", metavar="export", required=True)
    save = kinds.add_parser("export", help="write the sensors of a .blend for another simulator")
    save.add_argument("scene", metavar="SCENE.blend")
    formats = written_formats()
    save.add_argument("--to", metavar="FORMAT", choices=formats, required=True, help=", ".join(formats))
    save.add_argument("--out", metavar="DIR", default="palpate-sensors", help="folder to write to (default: %(default)s)")
    save.add_argument("--sensor", metavar="NAME", action="append", help="only this sensor; may be given again")
    blender.add_script_arguments(save)
    save.set_defaults(action=_export)


def run(arguments: argparse.Namespace) -> int:
    arguments.action(arguments)
    return 0


def _export(arguments: argparse.Namespace) -> None:
    checks.outputs_are_no_inputs((arguments.out,), (arguments.scene,))
    writable_folder(arguments.out, create=True)
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.scene, arguments.scripts)
        from ..addon.authoring import sensor_exchange

        sensors = sensor_exchange.sensors_on_meshes(scene, arguments.sensor or ())
    written = export_sensors(sensors, arguments.to, arguments.out)
    for note in written.notes:
        print(f"note: {note}", file=sys.stderr)
    for path in written.files:
        print(path)
