# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenRAVE's XML definition of a tactile sensor (paper, Table 2): ``<AttachedSensor>`` with a ``SimTactileSensor``.

Table 2 is printed with spaces inside its tags, which is not XML; this module reads and writes valid XML. The XML holds the
thickness of the foam, and the model holds the maximum penetration, which is twice the thickness (paper, section 3.3.3).
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any
from xml.etree import ElementTree

from ..errors import FileError, PalpateError
from ..io.file_writing import write_text
from ..io.input_files import read_xml, require_xml_text
from ..model.parameter import numbers_of
from ..model.sensor_parameters import DEPTH_PER_THICKNESS, SENSOR_PARAMETERS, SensorParameters

SENSOR_TYPE = "SimTactileSensor"
NUMBERS = tuple(
    parameter.name
    for parameter in sorted(numbers_of(SENSOR_PARAMETERS), key=lambda parameter: parameter.xml_place)
    if parameter.xml_place
)
"""Elements after the thickness, in the order of Table 2; :class:`.SensorParameters` has the same names."""
THICKNESS = "thickness"


@dataclass(frozen=True)
class OpenRaveSensor:
    """One definition.

    Attributes
    ----------
    name : str
    link : str
        Name of the link, which is the object that the sensor is attached to.
    parameters : SensorParameters
        Parameters that the XML does not hold (gain, unit, …) have their defaults.
    missing : tuple of str
        Elements that the definition leaves out; they have their defaults as well.
    """

    name: str
    link: str
    parameters: SensorParameters
    missing: tuple[str, ...] = ()


def read_openrave(path: str | os.PathLike) -> list[OpenRaveSensor]:
    """Read every tactile sensor of an OpenRAVE file; anything else in the file is ignored.

    Raises
    ------
    FileError
        There is no such file, it is not XML, it holds no tactile sensor, or a value is not a number or out of bounds.
    """
    root = read_xml(path, "a sensor definition")
    tactile = ((attached, _tactile(attached)) for attached in root.iter("AttachedSensor"))
    found = [_sensor(path, attached, element) for attached, element in tactile if element is not None]
    if not found:
        raise FileError(f"'{path}' has no <AttachedSensor> with a <sensor type=\"{SENSOR_TYPE}\">: give a file that has one.")
    return found


def _tactile(attached: ElementTree.Element) -> ElementTree.Element | None:
    """Return the tactile sensor of an <AttachedSensor>, None when it has another kind of sensor."""
    sensors = (child for child in attached if child.tag.lower() == "sensor")
    return next((s for s in sensors if s.get("type", "").lower() == SENSOR_TYPE.lower()), None)


def _sensor(path: str | os.PathLike, attached: ElementTree.Element, element: ElementTree.Element) -> OpenRaveSensor:
    """Return the definition in the tactile sensor of an <AttachedSensor>."""
    name = element.get("name") or attached.get("name") or "sensor"
    values: dict[str, Any] = {}
    for child in element:
        key = child.tag.lower()
        if key not in (THICKNESS, *NUMBERS):
            continue
        if key in values:
            raise FileError(f"Sensor '{name}' in '{path}' has two <{key}>: leave only one.")
        try:
            values[key] = float((child.text or "").strip())
        except ValueError as error:
            raise FileError(
                f"<{key}> of sensor '{name}' in '{path}' is '{child.text or '':.60}', which is not a number: correct it."
            ) from error
    missing = tuple(key for key in (THICKNESS, *NUMBERS) if key not in values)
    if THICKNESS in values:
        values["max_penetration"] = DEPTH_PER_THICKNESS * values.pop(THICKNESS)
    parameters = replace(SensorParameters(), **values)
    try:
        parameters.check(name)
    except PalpateError as error:
        raise FileError(f"In '{path}': {error}") from error
    return OpenRaveSensor(name, (attached.findtext("link") or "").strip(), parameters, missing)


def openrave_xml(sensors: Iterable[OpenRaveSensor], robot: str | None = None) -> str:
    """Return definitions as XML. Reading it gives exactly the same numbers.

    Parameters
    ----------
    sensors : iterable of OpenRaveSensor
    robot : str, optional
        Name of a ``<Robot>`` around the definitions. Without it they stand side by side, for pasting into a robot file.

    Raises
    ------
    FileError
        A name has a character that XML does not know.
    """
    from xml.sax.saxutils import escape, quoteattr

    sensors = list(sensors)
    for name in (robot or "", *(sensor.name for sensor in sensors), *(sensor.link for sensor in sensors)):
        require_xml_text(name)
    lines = [f"<Robot name={quoteattr(robot)}>"] if robot is not None else []
    indent = "  " if robot is not None else ""
    for sensor in sensors:
        values = [(THICKNESS, sensor.parameters.max_penetration / DEPTH_PER_THICKNESS)]
        values += [(key, getattr(sensor.parameters, key)) for key in NUMBERS]
        block = ["<AttachedSensor>", f"  <link>{escape(sensor.link)}</link>"]
        block += [f"  <sensor name={quoteattr(sensor.name)} type={quoteattr(SENSOR_TYPE)}>"]
        block += [f"    <{key}>{float(value)!r}</{key}>" for key, value in values]
        block += ["  </sensor>", "</AttachedSensor>"]
        lines += [indent + line for line in block]
    if robot is not None:
        lines.append("</Robot>")
    return "\n".join(lines) + "\n"


def write_openrave(path: str | os.PathLike, sensors: Iterable[OpenRaveSensor], robot: str | None = None) -> None:
    """Write :func:`openrave_xml` to a file, completely or not at all; raises FileError if that is impossible."""
    text = openrave_xml(sensors, robot)
    write_text(path, text)
