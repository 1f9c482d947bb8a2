# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate openrave``: reads sensor definitions in OpenRAVE's XML (paper, Table 2) into a scene, and writes them."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..core.errors import SceneError, counted
from ..core.io.file_writing import writable_file
from ..core.model.sensor_parameters import DEPTH_PER_THICKNESS
from ..core.simulators.openrave_file import NUMBERS, OpenRaveSensor, openrave_xml, read_openrave, write_openrave
from . import blender, checks, console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    kinds = parser.add_subparsers(dest="kind", metavar="show | import | export", required=True)
    show = kinds.add_parser("show", help="print the tactile sensors of an XML file")
    show.add_argument("file", metavar="ROBOT.xml", help="a robot or sensor of OpenRAVE")
    show.set_defaults(action=_show)
    load = kinds.add_parser("import", help="put the parameters of an XML file on the sensors of a .blend")
    load.add_argument("file", metavar="ROBOT.xml", help="a robot or sensor of OpenRAVE")
    load.add_argument("scene", metavar="SCENE.blend", help="file whose sensors get the parameters")
    load.add_argument("--from", dest="name", metavar="NAME", help="name of the sensor in the XML (default: the only one)")
    load.add_argument("--sensor", metavar="OBJECT", help="object that gets the parameters (default: the one that <link> names)")
    load.add_argument("--save-as", metavar="FILE", help="save into another .blend (default: SCENE.blend itself)")
    blender.add_script_arguments(load)
    load.set_defaults(action=_import)
    save = kinds.add_parser("export", help="write the sensors of a .blend as XML")
    save.add_argument("scene", metavar="SCENE.blend", help="file with the sensors; it is only read")
    save.add_argument("--sensor", metavar="OBJECT", action="append", help="only this sensor; may be given again")
    save.add_argument("--robot", metavar="NAME", help="enclose the sensors in a <Robot> of this name")
    save.add_argument("--out", metavar="FILE", help="file to write (default: print)")
    blender.add_script_arguments(save)
    save.set_defaults(action=_export)


def run(arguments: argparse.Namespace) -> int:
    arguments.action(arguments)
    return 0


def _show(arguments: argparse.Namespace) -> None:
    sensors = read_openrave(arguments.file)
    rows = [("sensor", "link", "thickness", *NUMBERS)]
    for sensor in sensors:
        values = [getattr(sensor.parameters, key) for key in NUMBERS]
        rows.append(
            (
                sensor.name,
                sensor.link,
                f"{sensor.parameters.max_penetration / DEPTH_PER_THICKNESS:g}",
                *(f"{v:g}" for v in values),
            )
        )
    print(console.text_table(rows, "<<" + ">" * (1 + len(NUMBERS))))
    for sensor in sensors:
        _note_missing(sensor)


def _note_missing(sensor: OpenRaveSensor) -> None:
    """Print which values the file leaves out."""
    if sensor.missing:
        print(f"note: '{sensor.name}' leaves out {', '.join(sensor.missing)}: the defaults are used")


def _import(arguments: argparse.Namespace) -> None:
    sensor = _choose_sensor(read_openrave(arguments.file), arguments.name, arguments.file)
    path = Path(arguments.scene if arguments.save_as is None else arguments.save_as)
    checks.outputs_are_no_inputs((path,), (arguments.file,))
    blender.check_writable(path)
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.scene, arguments.scripts)
        from ..addon.authoring import exchange

        name = arguments.sensor or sensor.link
        obj = {one.name: one for one in scene.objects}.get(name)  # Blender's own search knows no name that is not UTF-8
        if obj is None:
            raise SceneError(f"There is no object '{name}' in '{arguments.scene}': name the sensor's with --sensor.")
        exchange.put_parameters(obj, sensor.parameters)
        blender.save_blend(path)
    _note_missing(sensor)
    print(f"'{sensor.name}' of '{arguments.file}' is now on '{obj.name}'; saved: {path}")


def _choose_sensor(sensors: list[OpenRaveSensor], name: str | None, file: str) -> OpenRaveSensor:
    names = [sensor.name for sensor in sensors]
    if name is None and len(sensors) == 1:
        return sensors[0]
    if name not in names:
        known = ", ".join(f"'{known}'" for known in names)
        what = "several sensors" if name is None else f"no sensor '{name}'"
        raise SceneError(f"'{file}' has {what}: choose with --from one of {known}.")
    return sensors[names.index(name)]


def _export(arguments: argparse.Namespace) -> None:
    if arguments.out is not None:
        checks.outputs_are_no_inputs((arguments.out,), (arguments.scene,))
        writable_file(arguments.out)
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.scene, arguments.scripts)
        from ..addon.authoring import exchange
        from ..addon.scene import participants

        objects = participants.sensors_called(scene, arguments.sensor or (), "PAD")
        objects = objects or [obj for obj in scene.objects if obj.palpate.role == "SENSOR"]
        if not objects:
            raise SceneError(f"'{arguments.scene}' has no sensor: make one with Physics › Palpate › Make Sensor.")
        sensors = [OpenRaveSensor(obj.name, obj.name, exchange.parameters_of(obj)) for obj in objects]
    if arguments.out:
        write_openrave(arguments.out, sensors, arguments.robot)
        print(f"{counted(len(sensors), 'sensor')}: {Path(arguments.out).absolute()}")
    else:
        print(openrave_xml(sensors, arguments.robot), end="")
