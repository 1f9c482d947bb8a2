# SPDX-License-Identifier: GPL-3.0-or-later
"""MJCF: a MuJoCo body with a collision mesh and the sensor ``tactile``, whose mesh has the texels for vertices.

MuJoCo 3.3.5 and later know the sensor. It gives three numbers for each texel: the depth (m) to which the texel is inside what
touches the body, and two sliding speeds (m/s). For the linear law the texel's normal force without damping is `k` times the
depth. What carries the body is MuJoCo's own contact, between convex shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ...geometry.mesh import TriangleMesh
from ...io.bake_folder import folder_names
from ..contact_translation import MujocoContact, mujoco_contact
from ..mjcf_reading import is_mjcf, read_mjcf
from ..mujoco_load import REFERENCE_MASS
from ..sensor_format import SensorFormat, Written
from ..sensor_on_mesh import SensorOnMesh, unmodelled
from ..xml_writing import add, comment, numbers, write_xml

IMPEDANCE = 0.9
"""Constant impedance d of the contact (`solimp`), the upper end of MuJoCo's default."""
EXACT = 1e-6
"""Error of the contact, RMS as share of the largest force, below which it is not told."""
MOST_HULL_GAP = 1e-4
"""Metres. Where a texel lies deeper under the convex hull, contact is found by a signed distance field instead of the hull: it
costs 35 times as much, and finds 40 contacts under a ball, whose stiffness is no longer ours."""


def write_mjcf(sensors: Sequence[SensorOnMesh], folder: Path) -> Written:
    """Write one file per sensor."""
    files, notes = [], []
    stems = folder_names(item.name for item in sensors)
    for item in sensors:
        contact = mujoco_contact(item, impedance=IMPEDANCE)
        own = _notes(item, contact)
        path = folder / f"{stems[item.name]}.xml"
        write_xml(path, _model(item, contact, own))
        files.append(path)
        notes += own
    return Written(files, notes)


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
    """Return what MuJoCo cannot express, one sentence each."""
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
