# SPDX-License-Identifier: GPL-3.0-or-later
"""URDF: a link with the sensor's mesh and a fixed frame for each texel, or, as a xacro macro, one frame and the probe list.

A texel's frame has the texel's normal as z and its tangent as x.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ...geometry.mesh import TriangleMesh, face_normals
from ...io.bake_folder import folder_names
from ...io.file_writing import write_file
from ..probe_list import write_probe_list
from ..sensor_format import SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh, identifiers, unmodelled
from ..urdf_reading import is_urdf, read_urdf
from ..xml_writing import add, comment, numbers, write_xml

XACRO = "http://www.ros.org/wiki/xacro"
DIGITS = 12
"""Digits of the frames; URDF readers hold them in double precision."""


def write_urdf(sensors: Sequence[SensorOnMesh], folder: Path) -> Written:
    """Write for each sensor its mesh, a URDF with a frame per texel, and a macro with one frame beside the probe list."""
    files: list[Path] = []
    stems, links = folder_names(item.name for item in sensors), identifiers(item.name for item in sensors)
    for item in sensors:
        stem = stems[item.name].replace(" ", "_")
        names = [folder / f"{stem}{ending}" for ending in (".stl", ".urdf", ".xacro", ".probes.json")]
        mesh, robot, macro, probes = names
        write_stl(mesh, item.surface or item.mesh)
        write_xml(robot, _robot(item, links[item.name], mesh.name))
        write_xml(macro, _macro(item, links[item.name], mesh.name, probes.name))
        write_probe_list(probes, item)
        files += names
    return Written(files, [_note(item) for item in sensors])


def _note(item: SensorOnMesh) -> str:
    beyond = ", ".join(["forces of texels", "mass and inertia", *unmodelled(item)])
    return f"'{item.name}': URDF holds where the texels are; it cannot express {beyond}."


def _robot(item: SensorOnMesh, link: str, mesh: str) -> ElementTree.Element:
    root = ElementTree.Element("robot", {"name": link})
    comment(root, f"Palpate sensor '{item.name}'. {_note(item)}")
    _add_link(root, link, mesh)
    width = len(str(len(item.sensor.texels) - 1))
    angles = roll_pitch_yaw(item.frames)
    for number, (position, turn) in enumerate(zip(item.sensor.texels.position, angles, strict=True)):
        child = f"{link}_texel_{number:0{width}d}"
        add(root, "link", name=child)
        joint = add(root, "joint", name=f"{child}_joint", type="fixed")
        add(joint, "origin", xyz=numbers(position, DIGITS), rpy=numbers(turn, DIGITS))
        add(joint, "parent", link=link)
        add(joint, "child", link=child)
    return root


def _macro(item: SensorOnMesh, link: str, mesh: str, probes: str) -> ElementTree.Element:
    """Return a macro that fixes the sensor to a link of another robot; the texels stand in the probe list."""
    ElementTree.register_namespace("xacro", XACRO)
    root = ElementTree.Element("robot")
    comment(root, f"Palpate sensor '{item.name}': its texels are in {probes}, in the frame of the link that this macro makes.")
    macro = add(root, f"{{{XACRO}}}macro", name=link, params="prefix parent *origin")
    own = f"${{prefix}}{link}"
    _add_link(macro, own, mesh)
    joint = add(macro, "joint", name=f"{own}_joint", type="fixed")
    add(joint, f"{{{XACRO}}}insert_block", name="origin")
    add(joint, "parent", link="${parent}")
    add(joint, "child", link=own)
    return root


def _add_link(parent: ElementTree.Element, name: str, mesh: str) -> None:
    link = add(parent, "link", name=name)
    for part in ("visual", "collision"):
        add(add(add(link, part), "geometry"), "mesh", filename=mesh)


def roll_pitch_yaw(frames: np.ndarray) -> np.ndarray:
    """Return rotations as URDF writes them: about x, then y, then z of the parent, radians.

    Parameters
    ----------
    frames : (n, 3, 3) float
        Columns are the axes.

    Returns
    -------
    (n, 3) float
        Roll is computed from what yaw leaves, so that the three give the rotation back where pitch is 90° as well.
    """
    yaw = np.arctan2(frames[:, 1, 0], frames[:, 0, 0])
    pitch = np.arctan2(-frames[:, 2, 0], np.hypot(frames[:, 0, 0], frames[:, 1, 0]))
    sine, cosine = np.sin(yaw), np.cos(yaw)
    roll = np.arctan2(sine * frames[:, 0, 2] - cosine * frames[:, 1, 2], cosine * frames[:, 1, 1] - sine * frames[:, 0, 1])
    return np.stack([roll, pitch, yaw], axis=1)


def write_stl(path: Path, mesh: TriangleMesh) -> None:
    """Write a mesh as binary STL, in metres."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.zeros(len(mesh.triangles), record)
    facets["normal"], facets["corners"] = face_normals(mesh), mesh.vertices[mesh.triangles]
    with write_file(path, atomic=False) as place:
        place.write_bytes(b"Palpate".ljust(80) + np.array(len(facets), "<u4").tobytes() + facets.tobytes())


FORMAT = SensorFormat("urdf", "URDF", "A link with the mesh, and a fixed frame for each texel", write_urdf, read_urdf, is_urdf)
