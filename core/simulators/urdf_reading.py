# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors of URDF files: links that are fixed to one link and are named as texels, as in ``skin_sensor_12``."""

from __future__ import annotations

import os
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import FileError, PalpateError
from ..geometry.mesh import TriangleMesh
from ..geometry.point_surface import triangles_between
from ..io.sensor_toml import MOST_TEXELS
from ..io.xml_file import read_xml
from .sensor_format import FoundSensor
from .xml_reading import mesh_beside, vector_in

TEXEL_NAME = re.compile(r"(texel|taxel|tactel|tactile|sensor|probe)[_\-/ ]*(\d+)$", re.IGNORECASE)
"""End of the name of a link that is a texel."""


def is_urdf(path: str | os.PathLike) -> bool:
    """Return True if a file is XML with <robot>; raises FileError if it cannot be read, or has to go through xacro."""
    if Path(path).suffix.lower() not in (".urdf", ".xml", ".xacro"):
        return False
    root = read_xml(path, "a robot")
    if any("xacro" in element.tag for element in root.iter()):
        raise FileError(f"'{path}' has macros: run xacro on it, and give the resulting URDF.")
    return root.find("robot/link") is not None


def read_urdf(path: str | os.PathLike) -> list[FoundSensor]:
    """Return for each link with at least three texels a sensor.

    A texel's normal is the <axis> of its joint where it has one, as GenTact writes, else the z axis of its frame.

    Raises
    ------
    FileError
        The file is damaged, or no link has texels.
    """
    root = read_xml(path, "a robot").find("robot")
    assert root is not None
    groups: dict[str, list[tuple[int, ElementTree.Element]]] = {}
    for joint in root.iterfind("joint"):
        child, parent = joint.find("child"), joint.find("parent")
        number = TEXEL_NAME.search(child.get("link", "")) if child is not None else None
        if parent is not None and number is not None and joint.get("type") == "fixed":
            groups.setdefault(parent.get("link", ""), []).append((int(number.group(2)), joint))
    found = [_sensor(path, root, link, joints) for link, joints in groups.items() if len(joints) >= 3]
    if not found:
        raise FileError(
            f"'{path}' has no link with three or more texels: name the links that are fixed to it NAME_texel_0, and so on."
        )
    return found


def _sensor(
    path: str | os.PathLike, root: ElementTree.Element, link: str, joints: list[tuple[int, ElementTree.Element]]
) -> FoundSensor:
    from scipy.spatial.transform import Rotation

    if len(joints) > MOST_TEXELS:
        raise FileError(f"Link '{link}' of '{path}' has {len(joints)} texels: at most {MOST_TEXELS} are read.")
    ordered = [joint for _, joint in sorted(joints, key=lambda pair: pair[0])]
    plain = ElementTree.Element("origin")
    origins = [plain if (origin := joint.find("origin")) is None else origin for joint in ordered]
    position = np.array([vector_in(path, origin, "xyz", "0 0 0") for origin in origins])
    angles = np.array([vector_in(path, origin, "rpy", "0 0 0") for origin in origins])
    normal = Rotation.from_euler("xyz", angles).as_matrix()[:, :, 2]
    axes = [joint.find("axis") for joint in ordered]
    has_axes = all(axis is not None for axis in axes)
    if has_axes:
        normal = np.array([vector_in(path, axis, "xyz", "1 0 0") for axis in axes if axis is not None])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        if length.min() == 0.0:
            raise FileError(f"The axis of texel {int(length.argmin())} of '{link}' in '{path}' is zero: give its normal.")
        normal = normal / length
    notes = [
        f"'{link}': normals are {'the axes of the joints' if has_axes else 'the z axes of the frames'}; "
        "mass, inertia and joints were not imported, and parameters have their defaults."
    ]
    surface = _surface(path, root, link, notes)
    return FoundSensor(link, position, normal, triangles_between(position, normal), surface=surface, notes=notes)


def _surface(path: str | os.PathLike, root: ElementTree.Element, link: str, notes: list[str]) -> TriangleMesh | None:
    """Return the mesh of a link, or note why there is none."""
    own = next((item for item in root.iterfind("link") if item.get("name") == link), None)
    meshes = [] if own is None else own.findall("collision/geometry/mesh") + own.findall("visual/geometry/mesh")
    if not meshes:
        notes.append(f"'{link}' has no mesh of its own: its texels alone were taken over.")
        return None
    try:
        mesh = mesh_beside(path, meshes[0].get("filename", ""))
    except PalpateError as error:
        notes.append(f"The mesh of '{link}' was not imported: {error}")
        return None
    return TriangleMesh(mesh.vertices * vector_in(path, meshes[0], "scale", "1 1 1"), mesh.triangles)
