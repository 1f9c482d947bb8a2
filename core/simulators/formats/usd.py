# SPDX-License-Identifier: GPL-3.0-or-later
"""USD: the texels as points with primvars beside the surface as a collision mesh, written as text (.usda) without a library."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...io.bake_folder import folder_names
from ...io.file_writing import write_file
from ...model.sensor_parameters import SENSOR_PARAMETERS
from ..sensor_format import SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh, identifiers, texel_arrays, unmodelled
from ..usd_reading import OWN, is_usd, read_usd

DIGITS = 15
"""Of the arrays in double precision."""


def write_usd(sensors: Sequence[SensorOnMesh], folder: Path) -> Written:
    """Write one file per sensor."""
    files = []
    stems, prims = folder_names(item.name for item in sensors), identifiers(item.name for item in sensors)
    for item in sensors:
        path = folder / f"{stems[item.name]}.usda"
        with write_file(path, atomic=False) as place:
            place.write_text("\n".join(_stage(item, prims[item.name])) + "\n", encoding="utf-8", newline="\n")
        files.append(path)
    return Written(files, [_note(item) for item in sensors])


def _note(item: SensorOnMesh) -> str:
    beyond = ", ".join(["forces of texels", *unmodelled(item)])
    return f"'{item.name}': USD carries texels and parameters as data; its physics cannot express {beyond}."


def _stage(item: SensorOnMesh, prim: str) -> list[str]:
    surface = item.surface or item.mesh
    lines = ["#usda 1.0", "(", f"    defaultPrim = {_text(prim)}", "    metersPerUnit = 1", '    upAxis = "Z"', ")", ""]
    lines += [f'def Xform "{prim}" (', f"    displayName = {_text(item.name)}", ")", "{"]
    lines += _pose(item)
    lines += [f"    custom string {OWN}note = {_text(_note(item))}"]
    for name in SENSOR_PARAMETERS:
        value = getattr(item.sensor.parameters, name)
        kind = "string" if isinstance(value, str) else "int" if isinstance(value, int) else "double"
        lines.append(f"    custom {kind} {OWN}{name} = {_text(value) if isinstance(value, str) else repr(value)}")
    lines += ["", '    def Mesh "surface" (', '        prepend apiSchemas = ["PhysicsCollisionAPI"]', "    )", "    {"]
    lines += [
        f"        point3f[] points = {_tuples(surface.vertices)}",
        f"        int[] faceVertexCounts = {_list(np.full(len(surface.triangles), 3))}",
        f"        int[] faceVertexIndices = {_list(surface.triangles.ravel())}",
        '        uniform token subdivisionScheme = "none"',
        "    }",
        "",
        '    def Points "texels"',
        "    {",
    ]
    return [*lines, *(f"        {line}" for line in _points(item)), "    }", "}"]


def _pose(item: SensorOnMesh) -> list[str]:
    position, turn = (", ".join(repr(float(value)) for value in values) for values in (item.position, item.quaternion))
    return [
        f"    double3 xformOp:translate = ({position})",
        f"    quatd xformOp:orient = ({turn})",
        '    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]',
    ]


def _points(item: SensorOnMesh) -> list[str]:
    """Return the attributes of the texels; each is as wide as a disc of its area."""
    arrays = texel_arrays(item)
    position, normal, tangent, area = (arrays.pop(name) for name in ("position", "normal", "tangent", "area"))
    per_texel = ' (interpolation = "vertex")'
    lines = [
        f"point3f[] points = {_tuples(position)}",
        f"float[] widths = {_list(2.0 * np.sqrt(area / np.pi))}{per_texel}",
        f"normal3f[] normals = {_tuples(normal)}{per_texel}",
        f"vector3f[] primvars:tangent = {_tuples(tangent)}{per_texel}",
        f"float[] primvars:area = {_list(area)}{per_texel}",
    ]
    for name, values in (("position", position), ("normal", normal), ("tangent", tangent)):
        lines.append(f"custom double3[] {OWN}{name} = {_tuples(values, DIGITS)}")
    lines.append(f"custom double[] {OWN}area = {_list(area, DIGITS)}")
    for name, values in arrays.items():
        kind = "int" if values.dtype.kind in "iu" else "float"
        lines.append(f"{kind}[] primvars:{name} = {_list(values)}{per_texel}")
    return lines


def _text(value: str) -> str:
    """Return a text in quotes; JSON's escapes of quotes and control characters are USD's too."""
    return json.dumps(value, ensure_ascii=False)


def _list(values: np.ndarray, digits: int = 9) -> str:
    return "[" + ", ".join(_number(value, digits) for value in values.tolist()) + "]"


def _tuples(values: np.ndarray, digits: int = 9) -> str:
    return "[" + ", ".join(f"({', '.join(_number(value, digits) for value in row)})" for row in values.tolist()) + "]"


def _number(value: float, digits: int) -> str:
    return str(value) if isinstance(value, int) else f"{value + 0.0:.{digits}g}"


FORMAT = SensorFormat(
    "usd", "USD", "Texels as points with primvars, and the surface as a collision mesh", write_usd, read_usd, is_usd
)
