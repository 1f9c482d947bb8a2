# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenRAVE's XML: parameters of sensors without texels, as ``palpate openrave`` writes them, too."""

from __future__ import annotations

import os
from pathlib import Path

from ...io.input_files import read_xml
from ..openrave_file import OpenRaveSensor, read_openrave, write_openrave
from ..sensor_format import FoundSensor, SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh


def is_openrave(path: str | os.PathLike) -> bool:
    """Return True if a file is XML with an <AttachedSensor>; raises FileError if it cannot be read."""
    suffix = Path(path).suffix.lower()
    return suffix == ".xml" and next(read_xml(path, "a sensor definition").iter("AttachedSensor"), None) is not None


def read_definitions(path: str | os.PathLike) -> list[FoundSensor]:
    """Return the parameters of each sensor of a file; the name is that of the link that carries it, where it has one."""
    found = []
    for item in read_openrave(path):
        notes = [f"'{item.name}': OpenRAVE's XML has no texels; its parameters go onto the object that its link names."]
        if item.missing:
            notes.append(f"'{item.name}' leaves out {', '.join(item.missing)}: the defaults are used.")
        found.append(FoundSensor(item.link or item.name, parameters=item.parameters, notes=notes))
    return found


def write_definition(item: SensorOnMesh, path: Path, _: str) -> Written:
    """Write the parameters of a sensor."""
    file = Path(f"{path}.openrave.xml")
    write_openrave(file, [OpenRaveSensor(item.name, item.name, item.sensor.parameters)])
    return Written([file], [f"'{item.name}': OpenRAVE's XML has parameters, and no texels or effects."])


FORMAT = SensorFormat(
    "openrave",
    "OpenRAVE (XML)",
    "Parameters of sensors, as in the paper's Table 2",
    write_definition,
    read_definitions,
    is_openrave,
)
