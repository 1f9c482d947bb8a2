# SPDX-License-Identifier: GPL-3.0-or-later
"""USD: the texels as points with primvars beside the surface as a collision mesh, written as text (.usda) without a library."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileError, imported
from ...geometry.mesh import TriangleMesh
from ...geometry.point_surface import triangles_between
from ...geometry.rotations import quaternion_of
from ...io.file_writing import write_text
from ...io.input_files import require_regular
from ...io.sensor_toml import MOST_TEXELS
from ...model.sensor_parameters import SENSOR_PARAMETERS, SensorParameters, stated_parameters
from ..sensor_format import FoundSensor, SensorFormat, Written, numbers
from ..sensor_on_mesh import SensorOnMesh, texel_arrays, unmodelled

OWN = "palpate:"
"""Beginning of the names of attributes that Palpate writes."""
PRECISE = ("position", "normal", "tangent", "area")
"""Arrays that are written in double precision as well: USD's own of points have single precision."""


def is_usd(path: str | os.PathLike) -> bool:
    """Return True if the name of a file ends as those of USD do."""
    return Path(path).suffix.lower() in (".usd", ".usda", ".usdc", ".usdz")


def read_usd(path: str | os.PathLike) -> list[FoundSensor]:
    """Return a sensor for each Points prim with three or more points and a normal for each.

    Raises
    ------
    PalpateError
        The package usd-core is missing, USD refuses the file, or it has no such points.
    """
    imported("pxr", f"'{path}', a USD file,", "run 'pip install usd-core'")
    from pxr import Tf, Usd, UsdGeom

    require_regular(path)
    try:
        stage = Usd.Stage.Open(os.fspath(path))
    except Tf.ErrorException as error:
        raise FileError(f"USD cannot open '{path}' ({' '.join(str(error).split()):.120}): export it again.") from error
    metres = float(UsdGeom.GetStageMetersPerUnit(stage))
    found, without = [], 0
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Points):
            points, normals = UsdGeom.Points(prim).GetPointsAttr().Get(), UsdGeom.Points(prim).GetNormalsAttr().Get()
            if points is not None and normals is not None and len(normals) == len(points) >= 3:
                found.append(_sensor(path, prim, np.asarray(points, float), np.asarray(normals, float), metres))
            else:
                without += 1
    if not found:
        had = f"{without} Points without three points and their normals" if without else "no Points"
        raise FileError(f"'{path}' has {had}: a sensor is a Points prim with a normal for each point.")
    return found


def _sensor(path: str | os.PathLike, prim: Any, position: np.ndarray, normal: np.ndarray, metres: float) -> FoundSensor:
    from pxr import UsdGeom
    from scipy.linalg import polar

    owner = prim.GetParent()
    has_owner = owner.GetAttribute(f"{OWN}k").IsValid()
    name = (owner if has_owner else prim).GetMetadata("displayName") or (owner if has_owner else prim).GetName()
    if len(position) > MOST_TEXELS:
        raise FileError(f"'{name}' of '{path}' has {len(position)} texels: at most {MOST_TEXELS} are read.")
    precise = {key: prim.GetAttribute(f"{OWN}{key}").Get() for key in PRECISE}
    own = {key: np.asarray(value, float) for key, value in precise.items() if value is not None and len(value) == len(position)}
    position, normal = own.get("position", position), own.get("normal", normal)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    if not (np.isfinite(position).all() and np.isfinite(length).all()) or length.min() == 0.0:
        raise FileError(f"A point of '{name}' in '{path}' has no finite place or normal: export it again.")
    world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0.0))  # of row vectors
    turn, stretch = polar(world[:3, :3].T)
    if np.allclose(stretch, np.eye(3), rtol=0, atol=1e-12):
        turn, stretch = world[:3, :3].T, np.eye(3)  # which leaves the texels to the bit
    normal = np.linalg.solve(stretch, (normal / length).T).T
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    position = metres * position @ stretch.T
    rows = [prim.GetAttribute(f"primvars:{key}").Get() for key in ("row", "column")]
    row, column = (None if one is None or len(one) != len(position) else np.asarray(one, int) for one in rows)
    surface = owner.GetChild("surface") if has_owner else None
    words = {key: owner.GetAttribute(f"{OWN}{key}").Get() for key in SENSOR_PARAMETERS} if has_owner else {}
    notes = [] if has_owner else [f"'{name}': parameters have their defaults."]
    return FoundSensor(
        name,
        position,
        normal,
        triangles_between(position, normal),
        row,
        column,
        tangent=own.get("tangent"),
        area=own.get("area"),
        surface=None if not surface else _mesh(surface, metres),
        parameters=SensorParameters(**stated_parameters({k: v for k, v in words.items() if v is not None}, name)),
        frame_position=metres * world[3, :3],
        frame_quaternion=quaternion_of(turn),
        notes=notes,
    )


def _mesh(prim: Any, metres: float) -> TriangleMesh | None:
    """Return a mesh whose faces are cut into triangles."""
    from pxr import UsdGeom

    mesh = UsdGeom.Mesh(prim)
    points, counts, corners = (
        attribute.Get() for attribute in (mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
    )
    if points is None or counts is None or corners is None:
        return None
    corners, starts = np.asarray(corners), np.cumsum([0, *counts])
    fans = [
        corners[[start, start + i, start + i + 1]] for start, n in zip(starts, counts, strict=False) for i in range(1, n - 1)
    ]
    return TriangleMesh(metres * np.asarray(points, float), np.array(fans))


DIGITS = 15
"""Of the arrays in double precision."""


def write_usd(item: SensorOnMesh, path: Path, prim: str) -> Written:
    """Write a file."""
    beyond, file = ", ".join(["forces of texels", *unmodelled(item)]), Path(f"{path}.usda")
    note = f"'{item.name}': USD carries texels and parameters as data; its physics cannot express {beyond}."
    write_text(file, "\n".join(_stage(item, prim, note)) + "\n")
    return Written([file], [note])


def _stage(item: SensorOnMesh, prim: str, note: str) -> list[str]:
    surface = item.surface or item.mesh
    position, turn = (", ".join(repr(float(value)) for value in values) for values in (item.position, item.quaternion))
    lines = ["#usda 1.0", "(", f"    defaultPrim = {_text(prim)}", "    metersPerUnit = 1", '    upAxis = "Z"', ")", ""]
    lines += [f'def Xform "{prim}" (', f"    displayName = {_text(item.name)}", ")", "{"]
    lines += [f"    double3 xformOp:translate = ({position})", f"    quatd xformOp:orient = ({turn})"]
    lines += ['    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]']
    lines += [f"    custom string {OWN}note = {_text(note)}"]
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
    return f"[{numbers(values, digits).replace(' ', ', ')}]"


def _tuples(values: np.ndarray, digits: int = 9) -> str:
    return "[" + ", ".join(f"({numbers(row, digits).replace(' ', ', ')})" for row in values) + "]"


FORMAT = SensorFormat(
    "usd", "USD", "Texels as points with primvars, and the surface as a collision mesh", write_usd, read_usd, is_usd
)
