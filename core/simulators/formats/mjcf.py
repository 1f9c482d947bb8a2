# SPDX-License-Identifier: GPL-3.0-or-later
"""MJCF: a MuJoCo body with a collision mesh and the sensor ``tactile``, whose mesh has the texels for vertices.

MuJoCo compiles what is read, and so resolves defaults, classes, includes and frames. A tactile's texels are the vertices of its
mesh; the touch sites of a body are the texels of one sensor; a touch_grid has directions, which become texels on a sphere.

MuJoCo 3.3.5 and later know the sensor. It gives three numbers for each texel: the depth (m) to which the texel is inside what
touches the body, and two sliding speeds (m/s). For the linear law the texel's normal force without damping is `k` times the
depth. What carries the body is MuJoCo's own contact, between convex shapes.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ...errors import FileError, imported
from ...geometry.mesh import TriangleMesh, checked_mesh, vertex_normals
from ...geometry.point_surface import triangles_between
from ...geometry.rotations import quaternion_of, rotation_matrices
from ...io.input_files import read_xml
from ...io.sensor_toml import MOST_TEXELS
from ..contact_translation import REFERENCE_MASS, MujocoContact, mujoco_contact
from ..sensor_format import FoundSensor, SensorFormat, Written, add, comment, numbers, write_xml
from ..sensor_on_mesh import SensorOnMesh, unmodelled

PLUGIN = "mujoco.sensor.touch_grid"
SETTINGS = ("nchannel", "size", "fov", "gamma")
"""Of the plugin, in the order in which it declares them and compiled models keep them."""
DEEPEST = 250
"""Elements inside each other; MuJoCo reads them by recursion."""
SINGLE = 2e-7
"""Relative precision of MuJoCo's vertices; the file's own numbers are taken where they are the same in this precision."""
PROBE = 1e-5
"""Radius (m) of the ball at a touch site by which MuJoCo finds the nearest surface of the site's body."""


def is_mjcf(path: str | os.PathLike) -> bool:
    """Return True if a file is XML with <mujoco> or a part of one; raises FileError if it cannot be read."""
    if Path(path).suffix.lower() not in (".xml", ".mjcf"):
        return False
    root = read_xml(path, "a model")
    return root.find("mujoco") is not None or root.find("mujocoinclude") is not None


def read_mjcf(path: str | os.PathLike) -> list[FoundSensor]:
    """Return the tactile sensors of a file.

    Raises
    ------
    PalpateError
        The package mujoco is missing, MuJoCo refuses the file, or it has no tactile sensor.
    """
    mujoco = imported("mujoco", f"'{path}', an MJCF file,")
    root = read_xml(path, "a model")
    if root.find("mujoco") is None:
        raise FileError(f"'{path}' is a part of a model (<mujocoinclude>): give the file that includes it.")
    if _depth(root) > DEEPEST:
        raise FileError(f"'{path}' nests more than {DEEPEST} elements: a robot has fewer.")
    mujoco.set_mju_user_warning(lambda message: None)  # else it writes a log into the current folder
    try:
        spec = mujoco.MjSpec.from_file(os.fspath(path))
        model = spec.compile()
    except Exception as error:  # MuJoCo raises ValueError, and others for meshes and plugins
        words = " ".join(str(error).split())
        is_part = any(said in words for said in ("unrecognized name", "Error opening file"))
        advice = "if it is a part of a model, give the file that includes it, with its meshes" if is_part else "correct it"
        raise FileError(f"MuJoCo cannot compile '{path}' ({words:.160}): {advice}.") from error
    finally:
        mujoco.set_mju_user_warning(None)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    kinds, found, touch = mujoco.mjtSensor, [], []
    instances = {plugin.name: plugin.plugin_name for plugin in spec.plugins}
    for number, item in enumerate(spec.sensors):
        kind = int(model.sensor_type[number])
        if kind == kinds.mjSENS_TACTILE:
            found.append(_tactile(path, root, model, data, number, item.name or f"tactile {number + 1}"))
        elif kind == kinds.mjSENS_PLUGIN and (item.plugin.plugin_name or instances.get(item.plugin.name)) == PLUGIN:
            found.append(_touch_grid(path, model, data, number, item.name or f"touch grid {number + 1}"))
        elif kind == kinds.mjSENS_TOUCH:
            touch.append(int(model.sensor_objid[number]))
    notes = ["MuJoCo's geoms, contact and joints were not imported; parameters have their defaults."]
    found += _touch_sensors(mujoco, spec, model, data, touch, notes)
    if not found:
        few = f"<touch> on {len(touch)} sites and never on three of one body, which make a sensor" if touch else "no <touch>"
        raise FileError(f"'{path}' has no <tactile>, {few}, and no {PLUGIN} in its <sensor>: give a file that has one.")
    for one in found:
        one.notes.extend(notes)
    return found


def _depth(root: ElementTree.Element) -> int:
    """Return how many elements are inside each other."""
    depth, level = 0, [root]
    while level:
        depth, level = depth + 1, [child for element in level for child in element]
    return depth


def _tactile(path: str | os.PathLike, root: ElementTree.Element, model: Any, data: Any, number: int, name: str) -> FoundSensor:
    """Return the sensor of a <tactile>: MuJoCo keeps meshes in their inertial frame, and puts that into the geom's."""
    mesh, geom = int(model.sensor_objid[number]), int(model.sensor_refid[number])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    _require_count(path, name, count)
    turn, shift = rotation_matrices(model.mesh_quat[mesh]), model.mesh_pos[mesh]
    position = model.mesh_vert[first : first + count].astype(float) @ turn.T + shift
    position = _in_full_precision(root, model.mesh(mesh).name, model.mesh_scale[mesh], position)
    start, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    shape = checked_mesh(position, model.mesh_face[start : start + faces], name)[0]
    start, normals = int(model.mesh_normaladr[mesh]), int(model.mesh_normalnum[mesh])
    stated = model.mesh_normal[start : start + normals].astype(float) @ turn.T
    tangent = None
    if normals == 3 * count:  # the second and third of each vertex span the plane in which MuJoCo measures sliding
        frames = _in_full_precision(root, model.mesh(mesh).name, np.ones(3), stated, "normal").reshape(count, 3, 3)
        frames = frames / np.linalg.norm(frames, axis=2, keepdims=True)
        normal, tangent = frames[:, 0], frames[:, 1]
    else:
        normal = stated if normals == count else vertex_normals(shape)
    world = rotation_matrices(quaternion_of(data.geom_xmat[geom])) @ turn.T
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    place, turn = data.geom_xpos[geom] - world @ shift, quaternion_of(world)
    return FoundSensor(name, position, normal, shape.triangles, tangent=tangent, frame_position=place, frame_quaternion=turn)


def _in_full_precision(
    root: ElementTree.Element, mesh: str, scale: np.ndarray, single: np.ndarray, key: str = "vertex"
) -> np.ndarray:
    """Return a mesh with the file's numbers where MuJoCo has the same in single precision, else with MuJoCo's."""
    for element in root.iterfind("mujoco/asset/mesh"):
        words = (element.get(key) or "").split()
        if element.get("name") == mesh and len(words) == single.size:
            written = np.array(words, float).reshape(-1, 3) * scale
            if np.abs(written - single).max() <= SINGLE * max(float(np.abs(single).max()), 1e-3):
                return written
    return single


def _touch_sensors(mujoco: Any, spec: Any, model: Any, data: Any, sites: list[int], notes: list[str]) -> list[FoundSensor]:
    """Return for each body with three touch sites a sensor whose texels these are.

    A touch site states no direction: its normal is that of the nearest surface of its own body, which MuJoCo computes.
    """
    groups: dict[int, list[int]] = {}
    for site in sites:
        groups.setdefault(int(model.site_bodyid[site]), []).append(site)
    chosen = {body: own for body, own in groups.items() if len(own) >= 3}
    alone = len(sites) - sum(map(len, chosen.values()))
    if chosen and alone:
        notes.append(f"{alone} <touch> on bodies with fewer than three of them were not imported.")
    found = []
    for body, own in chosen.items():
        place, quaternion, name = data.xpos[body].copy(), data.xquat[body].copy(), model.body(body).name or "touch"
        turn = rotation_matrices(quaternion)
        position, normal = (data.site_xpos[own] - place) @ turn, _site_normals(mujoco, spec, model, data, own) @ turn
        note = f"'{name}': its {len(own)} texels are <touch> sites, with the normals of the nearest surface of their body."
        faces, frame = triangles_between(position, normal), {"frame_position": place, "frame_quaternion": quaternion}
        found.append(FoundSensor(name, position, normal, faces, **frame, notes=[note]))
    return found


def _site_normals(mujoco: Any, spec: Any, model: Any, data: Any, sites: list[int]) -> np.ndarray:
    """Return directions out of the nearest surface of the body of each site, (n, 3) in the world."""
    probed = spec.copy()
    bodies = {body.id: body for body in probed.bodies}
    for site in sites:
        bodies[int(model.site_bodyid[site])].add_geom(
            name=f"palpate probe {site}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[PROBE, 0, 0],
            mass=0,
            pos=model.site_pos[site],
        )
    with_probes = probed.compile()
    there = mujoco.MjData(with_probes)
    mujoco.mj_kinematics(with_probes, there)
    found = np.zeros((len(sites), 3))
    for row, site in zip(found, sites, strict=True):
        probe = with_probes.geom(f"palpate probe {site}").id
        best, span = np.inf, np.zeros(6)
        for geom in np.flatnonzero(with_probes.geom_bodyid == model.site_bodyid[site]):
            if not with_probes.geom(geom).name.startswith("palpate probe"):
                distance = mujoco.mj_geomDistance(with_probes, there, int(geom), probe, 1.0, span)
                if distance < best:
                    best, row[:] = distance, (span[3:] - span[:3]) * np.sign(distance)
        if not row.any():  # a body without geoms: the site's own z axis
            row[:] = data.site_xmat[site].reshape(3, 3)[:, 2]
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def _touch_grid(path: str | os.PathLike, model: Any, data: Any, number: int, name: str) -> FoundSensor:
    """Return the sensor of a touch_grid: its bins of directions, on a sphere around the site."""
    site, first = int(model.sensor_objid[number]), int(model.plugin_attradr[model.sensor_plugin[number]])
    words = model.plugin_attr[first:].tobytes().decode("utf-8").split("\0")
    settings = dict(zip(SETTINGS, words, strict=False))
    columns, rows = (int(float(word)) for word in settings["size"].split())
    if min(columns, rows) < 2:
        raise FileError(f"Sensor '{name}' in '{path}' has {columns} × {rows} bins: two each way are the fewest that are read.")
    _require_count(path, name, columns * rows)
    fov = [float(word) for word in settings["fov"].split()]
    gamma = float(settings["gamma"] or 0.0)
    azimuth, elevation = (_bin_middles(n, limit, gamma) for n, limit in zip((columns, rows), fov))
    y, x = np.meshgrid(elevation, azimuth, indexing="ij")
    direction = np.stack([np.cos(y) * np.sin(x), np.sin(y), -np.cos(y) * np.cos(x)], axis=-1).reshape(-1, 3)
    radius = float(model.site_size[site][0])
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    note = f"'{name}': a touch_grid has directions and no surface; its texels are on a sphere of the site's size, {radius:g} m."
    grid = np.arange(len(row)).reshape(rows, columns)
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    place, turn = data.site_xpos[site].copy(), quaternion_of(data.site_xmat[site])
    return FoundSensor(
        name, radius * direction, direction, faces, row, column, frame_position=place, frame_quaternion=turn, notes=[note]
    )


def _bin_middles(count: int, limit: float, gamma: float) -> np.ndarray:
    """Return the middles of a touch_grid's bins, radians; `limit` is half its field of view, degrees (touch_grid.cc)."""
    edges = np.linspace(-1.0, 1.0, count + 1)
    share = min(max(gamma, 0.0), 1.0)
    edges = np.radians(limit) * (share * edges**5 + (1.0 - share) * edges)
    return np.asarray((edges[1:] + edges[:-1]) / 2.0)


def _require_count(path: str | os.PathLike, name: str, count: int) -> None:
    if not 3 <= count <= MOST_TEXELS:
        raise FileError(f"Sensor '{name}' in '{path}' has {count} texels: from 3 to {MOST_TEXELS} are read.")


IMPEDANCE = 0.9
"""Constant impedance d of the contact (`solimp`), the upper end of MuJoCo's default."""
EXACT = 1e-6
"""Error of the contact, RMS as share of the largest force, below which it is not told."""
MOST_HULL_GAP = 1e-4
"""Metres. Where a texel lies deeper under the convex hull, contact is found by a signed distance field instead of the hull: it
costs 35 times as much, and finds 40 contacts under a ball, whose stiffness is no longer ours."""


def write_mjcf(item: SensorOnMesh, path: Path, _: str) -> Written:
    """Write a file."""
    contact, file = mujoco_contact(item, impedance=IMPEDANCE), Path(f"{path}.xml")
    notes = _notes(item, contact)
    write_xml(file, _model(item, contact, notes))
    return Written([file], notes)


def _model(item: SensorOnMesh, contact: MujocoContact, notes: list[str]) -> ElementTree.Element:
    name = item.name
    solid, _ = item.solid
    shape_kind = "sdf" if _depth_under_hull(solid, item.sensor.texels.position) > MOST_HULL_GAP else "mesh"
    texels, collision = f"{name} texels", f"{name} collision"
    root = ElementTree.Element("mujoco")
    root.set("model", name)
    comment(root, f"Palpate sensor '{name}'. The texels' normal force is k times the first third of the sensor's data.")
    for note in notes:
        comment(root, note)
    add(root, "option", cone="elliptic")
    asset = add(root, "asset")
    shape = {"vertex": numbers(solid.vertices), "face": numbers(solid.triangles)}
    add(asset, "mesh", name=collision, inertia="convex", **shape)
    # three normals for each vertex are its frame; the second and the third span the plane in which sliding is measured
    frames = {"vertex": numbers(item.sensor.texels.position), "normal": numbers(item.frames.transpose(0, 2, 1)[:, [2, 0, 1]])}
    add(asset, "mesh", name=texels, inertia="shell", **frames, face=numbers(item.faces))
    body = add(add(root, "worldbody"), "body", name=name, pos=numbers(item.position), quat=numbers(item.quaternion))
    law = {"solref": numbers(contact.solref), "solimp": numbers(contact.solimp), "friction": numbers(contact.friction)}
    add(body, "geom", name=collision, type=shape_kind, mesh=collision, priority="1", rgba="0.5 0.5 0.5 0.4", **law)
    unseen = {"contype": "0", "conaffinity": "0", "mass": "0", "group": "3"}
    add(body, "geom", name=texels, type="mesh", mesh=texels, **unseen)
    add(add(root, "sensor"), "tactile", name=name, geom=texels, mesh=texels)
    custom = add(root, "custom")
    add(custom, "numeric", name=f"{name} k", data=numbers(item.sensor.parameters.k))
    add(custom, "numeric", name=f"{name} area", data=numbers(item.sensor.texels.area))
    return root


def _notes(item: SensorOnMesh, contact: MujocoContact) -> list[str]:
    """Return the properties that MuJoCo cannot express, one sentence each."""
    name = item.name
    solid, layered = item.solid
    found = [
        f"'{name}': MuJoCo has depth and sliding of each texel; Palpate alone computes {', '.join(unmodelled(item))}.",
        f"'{name}': MuJoCo's stiffness is per mass: the penetration of a box of {REFERENCE_MASS:g} kg is that of Palpate, "
        "and a box of another mass has the same; scale solref by 1 / mass for a load of another mass.",
    ]
    if max(contact.error.rms, contact.damping_error.rms) > EXACT:
        found.append(f"'{name}' in MuJoCo: {contact.error}; damping: {contact.damping_error}.")
    if layered:
        found.append(f"'{name}' is an open sheet: it was made a layer as thick as its foam, half its maximum penetration.")
    gap = _depth_under_hull(solid, item.sensor.texels.position)
    if gap > MOST_HULL_GAP:
        found.append(
            f"'{name}' is not convex, its hull lies up to {1e3 * gap:.2g} mm above the texels: MuJoCo finds contact by "
            "a signed distance field, which is slower and less stiff than Palpate's contact."
        )
    return found


def _depth_under_hull(solid: TriangleMesh, points: np.ndarray) -> float:
    """Return how deep the deepest of some points lies under the convex hull of a body, metres."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(solid.vertices).equations
    return float(max(0.0, (-(points @ planes[:, :3].T + planes[:, 3]).max(axis=1)).max()))


FORMAT = SensorFormat(
    "mjcf", "MuJoCo (MJCF)", "A body with a collision mesh and a tactile sensor, for MuJoCo", write_mjcf, read_mjcf, is_mjcf
)
