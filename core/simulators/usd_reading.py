# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors of USD files: points with normals, and what Palpate wrote beside them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from ..geometry.mesh import TriangleMesh
from ..geometry.point_surface import triangles_between
from ..io.input_files import require_regular
from ..io.sensor_toml import MOST_TEXELS, stated_parameters
from ..model.sensor_parameters import SENSOR_PARAMETERS, SensorParameters
from .optional_package import optional_package
from .sensor_format import FoundSensor

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
    FileError
        The package usd-core is missing, USD refuses the file, or it has no such points.
    """
    optional_package("pxr", f"'{path}' is a USD file", "usd-core")
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
    turn, stretch = _rotation_and_stretch(world[:3, :3].T)
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
        frame_quaternion=_quaternion(turn),
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


def _rotation_and_stretch(linear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation and the symmetric part of a linear map (3, 3): linear = rotation · stretch."""
    u, sizes, v = np.linalg.svd(linear)
    turn = u @ v
    if np.allclose(sizes, 1.0, rtol=0, atol=1e-12):
        return linear, np.eye(3)
    return turn, v.T @ np.diag(sizes) @ v


def _quaternion(matrix: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(matrix).as_quat(), 1)
