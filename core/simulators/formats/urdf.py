# SPDX-License-Identifier: GPL-3.0-or-later
"""URDF: a link with the sensor's mesh and a fixed frame for each texel, or, as a xacro macro, one frame and the probe list.

A texel's frame has the texel's normal as z and its tangent as x.
"""

from __future__ import annotations

import io
import os
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ...errors import FileError, PalpateError, imported
from ...geometry.mesh import TriangleMesh
from ...geometry.point_surface import triangles_between
from ...io.file_writing import atomic_write
from ...io.input_files import load_mesh, read_xml
from ...io.sensor_toml import MOST_TEXELS
from ..probe_list import write_probe_list
from ..sensor_format import FoundSensor, SensorFormat, Written, add, comment, numbers, write_xml
from ..sensor_on_mesh import SensorOnMesh, unmodelled

TEXEL_NAME = re.compile(
    r"(?:texel|taxel|tactel|tactile|sensor|probe)(?:[_\-/ ]?[a-z]+)*[_\-/ ]*(\d+(?:[_\-]\d+)*)(?:[_\-]?(?:link|frame|joint))?$",
    re.IGNORECASE,
)
"""End of the name of a link that is a texel: a word for it, and one or more numbers."""


def is_urdf(path: str | os.PathLike) -> bool:
    """Return True if a file is XML with <robot>; raises FileError if it cannot be read, or has to go through xacro."""
    if Path(path).suffix.lower() not in (".urdf", ".xml", ".xacro"):
        return False
    root = _read(path)
    if any("xacro" in element.tag for element in root.iter()):
        raise FileError(f"'{path}' has macros: run xacro on it, and give the resulting URDF.")
    return root.find("robot/link") is not None


def read_urdf(path: str | os.PathLike) -> list[FoundSensor]:
    """Return for each link with at least three texels, and for each tactile sensor, a sensor.

    A texel's normal is the <axis> of its joint where all texels of the link have one, as GenTact writes, else the z axis of its
    frame.

    Raises
    ------
    PalpateError
        The package yourdfpy is missing, the file is damaged, or nothing in it has three texels.
    """
    yourdfpy = imported("yourdfpy", f"'{path}', a URDF file,")
    root = _read(path).find("robot")
    assert root is not None
    tactile = [item for item in root.iterfind("sensor") if item.find("tactile") is not None]
    axes = {joint.get("name"): joint.find("axis") is not None for joint in root.iterfind("joint")}
    for item in root.findall("sensor"):  # unknown to the library
        root.remove(item)
    try:
        robot = yourdfpy.URDF.load(
            io.BytesIO(ElementTree.tostring(root)), load_meshes=False, load_collision_meshes=False, build_scene_graph=False
        ).robot
    except Exception as error:  # a reader meets anything in a damaged file
        words = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"'{path}' could not be read as a URDF ({words:.120}): correct it.") from error
    groups: dict[str, list[tuple[tuple[int, ...], Any]]] = {}
    for joint in robot.joints:
        number = TEXEL_NAME.search(joint.child or "")
        if number is not None and joint.type == "fixed":
            order = tuple(int(word) for word in re.split(r"[_\-]", number.group(1)))
            groups.setdefault(joint.parent, []).append((order, joint))
    found = [_linked_texels(path, robot, link, joints, axes) for link, joints in groups.items() if len(joints) >= 3]
    found += [_tactile(path, item) for item in tactile]
    if not found:
        raise FileError(
            f"'{path}' has no <sensor> with <tactile> and no link with three or more texels: name the links that are fixed "
            "to it NAME_texel_0, and so on."
        )
    return found


def _read(path: str | os.PathLike) -> ElementTree.Element:
    """Read the file, without the name spaces of tags."""
    root = read_xml(path, "a robot")
    for element in root.iter():
        if "xacro" not in element.tag:
            element.tag = element.tag.rpartition("}")[2]
    return root


def _linked_texels(
    path: str | os.PathLike, robot: Any, link: str, joints: list[tuple[tuple[int, ...], Any]], axes: dict[str | None, bool]
) -> FoundSensor:
    ordered = [joint for _, joint in sorted(joints, key=lambda pair: pair[0])]
    frames = np.array([np.eye(4) if joint.origin is None else joint.origin for joint in ordered])
    has_axes = all(axes.get(joint.name) for joint in ordered)
    which = "the axes of the joints" if has_axes else "the z axes of the frames"
    notes = [f"'{link}': normals are {which}; mass, inertia and joints were not imported, and parameters have their defaults."]
    axis = np.array([np.asarray(joint.axis, float) for joint in ordered])
    normal, tangent = (axis, None) if has_axes else (frames[:, :3, 2], frames[:, :3, 0])
    return _sensor(path, link, frames[:, :3, 3], normal, tangent, _surface(path, robot, link, notes), notes)


def _sensor(
    path: str | os.PathLike,
    name: str,
    position: np.ndarray,
    normal: np.ndarray,
    tangent: np.ndarray | None,
    surface: TriangleMesh | None,
    notes: list[str],
) -> FoundSensor:
    if len(position) > MOST_TEXELS:
        raise FileError(f"'{name}' of '{path}' has {len(position)} texels: at most {MOST_TEXELS} are read.")
    if not (np.isfinite(position).all() and np.isfinite(normal).all()):
        raise FileError(f"A texel of '{name}' in '{path}' has a number that is NaN or infinite: correct it.")
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    if length.min() == 0.0:
        raise FileError(f"The axis of texel {int(length.argmin())} of '{name}' in '{path}' is zero: give its normal.")
    normal = normal / length
    faces = triangles_between(position, normal)
    return FoundSensor(name, position, normal, faces, tangent=tangent, surface=surface, notes=notes)


def _tactile(path: str | os.PathLike, item: ElementTree.Element) -> FoundSensor:
    """Return the sensor of a <tactile>: taxels with poses, or an array, whose rows run along x of its frame."""
    tactile, array = item.find("tactile"), item.find("tactile/array")
    assert tactile is not None
    taxels = sorted(tactile.iterfind("taxel"), key=lambda one: int(_numbers(path, one, "idx", "0")[0]))
    name, link = item.get("name") or "tactile", item.find("parent")
    frame = _pose(path, item.find("origin"))
    if taxels:
        frames = np.array([frame @ _pose(path, taxel) for taxel in taxels])
    elif array is not None:
        rows, columns = (int(_numbers(path, array, key)[0]) for key in ("rows", "cols"))
        if not (rows >= 1 and columns >= 1 and rows * columns <= MOST_TEXELS):
            raise FileError(f"'{name}' in '{path}' has {rows} × {columns} texels: at most {MOST_TEXELS} are read.")
        size = array.get("size") or "0 0"
        spacing, offset = _numbers(path, array, "spacing", size), _numbers(path, array, "offset", "0 0")
        by_columns = array.get("order") == "column-major"
        row, column = (index.ravel("F" if by_columns else "C") for index in np.indices((rows, columns)))
        place = np.stack([row * spacing[0] - offset[0], column * spacing[1] - offset[1], 0.0 * row, 1.0 + 0.0 * row], axis=1)
        frames = np.repeat(frame[None], len(row), axis=0)
        frames[:, :, 3] = place @ frame.T
    else:
        raise FileError(f"The <tactile> of '{name}' in '{path}' has neither <taxel> nor <array>: add one of them.")
    if len(frames) < 3:
        raise FileError(f"The <tactile> of '{name}' in '{path}' has {len(frames)} texels: a sensor has at least three.")
    notes = [
        f"'{name}': places are in the frame of the link '{'' if link is None else link.get('link', '')}'; "
        "parameters have their defaults."
    ]
    return _sensor(path, name, frames[:, :3, 3], frames[:, :3, 2], frames[:, :3, 0], None, notes)


def _pose(path: str | os.PathLike, element: ElementTree.Element | None) -> np.ndarray:
    """Return the matrix of xyz and rpy."""
    from scipy.spatial.transform import Rotation

    matrix = np.eye(4)
    if element is not None:
        matrix[:3, 3] = _numbers(path, element, "xyz", "0 0 0", 3)
        matrix[:3, :3] = Rotation.from_euler("xyz", _numbers(path, element, "rpy", "0 0 0", 3)).as_matrix()
    return matrix


def _numbers(
    path: str | os.PathLike, element: ElementTree.Element, key: str, default: str | None = None, count: int | None = None
) -> np.ndarray:
    """Return the finite numbers of an attribute; raises FileError if there are none, or another number of them."""
    text = element.get(key, default)
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.zeros(0)
    if not len(values) or not np.isfinite(values).all() or count not in (None, len(values)):
        raise FileError(
            f"'{key}' of <{element.tag}> in '{path}' is '{(text or '')[:60]}': give {count or 'its'} finite numbers."
        )
    return values


def _surface(path: str | os.PathLike, robot: Any, link: str, notes: list[str]) -> TriangleMesh | None:
    """Return the mesh of a link, or note why there is none."""
    own = next((item for item in robot.links if item.name == link), None)
    shapes = [] if own is None else [*own.collisions, *own.visuals]
    shape = next((one for one in shapes if one.geometry is not None and one.geometry.mesh is not None), None)
    if shape is None:
        notes.append(f"'{link}' has no mesh of its own: its texels alone were taken over.")
        return None
    try:
        mesh = load_mesh(_file_of(path, shape.geometry.mesh.filename))
    except PalpateError as error:
        notes.append(f"The mesh of '{link}' was not imported: {error}")
        return None
    scale = 1.0 if shape.geometry.mesh.scale is None else np.asarray(shape.geometry.mesh.scale, float)
    frame = np.eye(4) if shape.origin is None else shape.origin
    return TriangleMesh(mesh.vertices * scale @ frame[:3, :3].T + frame[:3, 3], mesh.triangles)


def _file_of(path: str | os.PathLike, name: str) -> Path:
    """Return the file of a name relative to the URDF; one of a ROS package is looked for in the folders above."""
    plain = name.removeprefix("file://")
    folder = Path(path).resolve().parent
    if not plain.startswith("package://"):
        return folder / plain
    package, _, inside = plain.removeprefix("package://").partition("/")
    for above in (folder, *folder.parents):
        if (above / package / inside).is_file():
            return above / package / inside
    raise FileError(f"'{name}' is in none of the folders above '{path}': write the path of the mesh into it.")


XACRO = "http://www.ros.org/wiki/xacro"
DIGITS = 12
"""Digits of the frames; URDF readers hold them in double precision."""


def write_urdf(item: SensorOnMesh, path: Path, link: str) -> Written:
    """Write the mesh, a URDF with a frame per texel, and a macro with one frame beside the probe list."""
    import trimesh

    surface = item.surface or item.mesh
    files = [Path(f"{path}{ending}") for ending in (".stl", ".urdf", ".xacro", ".probes.json")]
    mesh, robot, macro, probes = files
    beyond = ", ".join(["forces of texels", "mass and inertia", *unmodelled(item)])
    note = f"'{item.name}': URDF holds where the texels are; it cannot express {beyond}."
    with atomic_write(mesh) as temporary:
        trimesh.Trimesh(surface.vertices, surface.triangles, process=False).export(temporary, file_type="stl")
    write_xml(robot, _robot(item, link, mesh.name, note))
    write_xml(macro, _macro(item, link, mesh.name, probes.name))
    write_probe_list(probes, item)
    return Written(files, [note])


def _robot(item: SensorOnMesh, link: str, mesh: str, note: str) -> ElementTree.Element:
    root = ElementTree.Element("robot", {"name": link})
    comment(root, f"Palpate sensor '{item.name}'. {note}")
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


FORMAT = SensorFormat(
    "urdf", "URDF", "A link with the mesh, and a fixed frame for each texel", write_urdf, read_urdf, is_urdf, "_"
)
