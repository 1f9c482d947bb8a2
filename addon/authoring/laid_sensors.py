# SPDX-License-Identifier: GPL-3.0-or-later
"""Laid sensors: sensors whose texels are laid onto the surface of another object, the carrier.

A laid sensor is a mesh object whose vertices are the texels. It is a child of its carrier and part of the carrier's body
(:mod:`..scene.moved_bodies`), so that one object can carry several sensors, each with its own parameters. It stores the
pattern of its texels, so that they can be laid again when the surface has changed.
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import SensorError
from ...core.geometry.mesh import TriangleMesh, checked_mesh, vertex_normals
from ...core.geometry.scattered_points import scatter
from ...core.geometry.texel_arrays import (
    TexelMesh,
    filled_region,
    mesh_of_faces,
    pad_array,
    region_middle,
    shifted_pose,
    wrapped_array,
)
from ...core.model.sensor_parameters import SENSOR_PARAMETERS
from ..properties import effect_stack
from ..properties.object_properties import PatternProperties
from ..scene import mesh_arrays, participants, sensor_regions
from ..session import identity, transforms
from . import sensors, surface_binding

FOLDER = Path(__file__).parents[1] / "presets"
"""Folder of the presets that come with Palpate."""
COPIED = (*SENSOR_PARAMETERS, "k_factor", "friction_factor", "gain_factor")
"""Names of the properties that presets hold and that are copied: all that do not depend on the mesh of one sensor."""


def copy_parameters(source, target) -> None:
    """Give a sensor the parameters and effects of another one.

    Its region and its name stay. Effects that are switched off are not copied.
    """
    for name in COPIED:
        setattr(target.palpate, name, getattr(source.palpate, name))
    effect_stack.put_stack(target, effect_stack.stack(source))


PATTERN_PROPERTIES = ("method", "spacing", *PatternProperties.__annotations__)
"""Properties of :class:`.properties.PALPATE_PG_skin` that make up the pattern of the texels."""


def pad_mesh(context, rows: int, columns: int, pitch: tuple[float, float], radius: float):
    """Return the mesh of a tactile pad.

    Parameters
    ----------
    context : Context
    rows, columns : int
    pitch : (float, float)
        From column to column and from row to row, metres.
    radius : float, metres
        The pad is bent to it; 0: flat, below 0: inwards.
    """
    texels = pad_array(rows, columns, pitch, radius)
    scale = 1.0 / transforms.metres_per_unit(context.scene)
    return mesh_arrays.new_mesh("Tactile Pad", texels.vertices * scale, texels.faces)


def lay_texels(context, carrier, source: str, pattern: dict):
    """Make a laid sensor on an object.

    Parameters
    ----------
    source : str
        As for :func:`.sensors.make_sensor`; OWN is the region that the object has as a sensor.
    pattern : dict
        Values of :data:`PATTERN_PROPERTIES`; lengths in metres, the angle in radians.

    Returns
    -------
    Object
        The laid sensor: a child of `carrier`, with the role Sensor.

    Raises
    ------
    SensorError
        The region is empty, or the texels do not fit on it. Nothing was changed then.
    """
    region = sensors.describe_region(carrier, source)
    try:
        texels = _texels_on(context, carrier, sensor_regions.vertices_of_region(carrier, **region), pattern)
    except SensorError:
        if source == "SELECTION":
            carrier.vertex_groups.remove(carrier.vertex_groups[region["vertex_group"]])
        raise
    name = f"{carrier.name} Skin"
    obj = bpy.data.objects.new(name, mesh_arrays.new_mesh(name, texels.vertices, texels.faces))
    for collection in carrier.users_collection[:1] or [context.scene.collection]:
        collection.objects.link(obj)
    obj.parent = carrier
    _store_pattern(obj, carrier, region, pattern)
    if carrier.palpate.role in {"SENSOR", "PAD"}:
        copy_parameters(carrier, obj)
    context.view_layer.update()
    surface_binding.bind(context, obj, carrier)
    obj.palpate.body = "PARENT"
    obj.palpate.role = "SENSOR"
    sensors.choose_alone(context, obj)
    return obj


def is_own_region(carrier, source: str) -> bool:
    """Return True when `source` is the region on which the object is a sensor or pad itself, under whatever name.

    Weight Paint, for example, proposes the active vertex group, which is the sensor's own one after *Paint Region*.
    """
    if carrier.palpate.role not in {"SENSOR", "PAD"} or source == "SELECTION":
        return False
    try:
        return sensors.describe_region(carrier, source).items() <= sensors.describe_region(carrier, "OWN").items()
    except SensorError:
        return False  # there is no such region, which lay_texels says


def update_texels(context, obj) -> int:
    """Lay the texels of a laid sensor again onto the surface as it is now, and return their number.

    Painted values are transferred to the new texels.

    Raises
    ------
    SensorError
        The object is no laid sensor, its carrier is gone, or the texels do not fit any more.
    """
    carrier = carrier_of(obj)
    own, region = obj.palpate.skin, _stored_region(obj.palpate.skin)
    stored = {key: getattr(own, key) for key in PATTERN_PROPERTIES}
    pattern = {key: transforms.as_typed(value) if isinstance(value, float) else value for key, value in stored.items()}
    texels = _texels_on(context, carrier, sensor_regions.vertices_of_region(carrier, **region), pattern)
    old, painted = obj.data, surface_binding.painted_values(obj)
    obj.data = mesh_arrays.new_mesh(old.name, texels.vertices, texels.faces)
    surface_binding.transfer_painted_values(obj, painted)
    for material in old.materials:
        obj.data.materials.append(material)
    if old.users == 0:
        bpy.data.meshes.remove(old)
    surface_binding.bind(context, obj, carrier)
    _store_pattern(obj, carrier, region, pattern)
    return len(texels.vertices)


def is_laid(obj) -> bool:
    """Return True when an object is a laid sensor, made by :func:`lay_texels`."""
    return obj.type == "MESH" and obj.palpate.skin.method != "NONE"


def laid_on(obj) -> list:
    """Return the laid sensors and pads of which an object is the carrier."""
    return [child for child in obj.children if is_laid(child) and child.palpate.role in {"SENSOR", "PAD"}]


def carrier_of(obj):
    """Return the carrier of a laid sensor.

    Raises
    ------
    SensorError
        The object is no laid sensor, or has lost its parent.
    """
    if not is_laid(obj):
        raise SensorError(f"'{obj.name}' was not laid onto a surface: use Lay Texels on the object that carries the sensor.")
    if obj.parent is None or obj.parent.type != "MESH":
        raise SensorError(f"'{obj.name}' has lost the mesh it lay on: make that its parent again (Object › Parent).")
    return obj.parent


def is_outdated(obj) -> bool:
    """Return True when the carrier's surface has changed since the texels were laid on it."""
    own = obj.palpate.skin
    return (
        is_laid(obj)
        and obj.parent is not None
        and obj.parent.type == "MESH"
        and own.made_from != _surface_fingerprint(obj.parent, own)
    )


def _store_pattern(obj, carrier, region: dict, pattern: dict) -> None:
    """Store in a laid sensor's properties how its texels were made."""
    own = obj.palpate.skin
    for key, value in pattern.items():
        setattr(own, key, value)
    own.region, own.region_number = region["region"], region.get("face_set", 0)
    own.region_name = region.get({"GROUP": "vertex_group", "MATERIAL": "material"}.get(own.region, ""), "")
    own.region_threshold = region.get("threshold", 0.0)
    own.made_from = _surface_fingerprint(carrier, own)
    obj.palpate.made_vertices = len(obj.data.vertices)
    identity.ensure_uid(obj)


def _stored_region(own) -> dict:
    """Return the region on the carrier that a laid sensor's properties hold, for :func:`.sensor_regions.vertices_of_region`."""
    names = {"vertex_group": own.region_name, "material": own.region_name, "face_set": own.region_number}
    return {"region": own.region, "threshold": transforms.as_typed(own.region_threshold), **names}


def _surface_fingerprint(carrier, own) -> str:
    """Return a short text that changes with the carrier's mesh, its scale and the region on it."""
    digest = hashlib.blake2b(digest_size=8)
    digest.update(mesh_arrays.vertices(carrier.data).tobytes())
    digest.update(np.round(np.array(carrier.scale), 6).tobytes())
    try:
        digest.update(np.packbits(sensor_regions.vertices_of_region(carrier, **_stored_region(own))).tobytes())
    except SensorError:
        digest.update(b"gone")
    return digest.hexdigest()


def _texels_on(context, carrier, chosen: np.ndarray, pattern: dict) -> TexelMesh:
    """Return texels on the vertices that `chosen` (nv,) bool selects, in the coordinates of the carrier."""
    depsgraph = participants.depsgraph_of(context.scene)
    arrays, _ = mesh_arrays.sensor_arrays(carrier, depsgraph)
    matrix = transforms.as_array(carrier.evaluated_get(depsgraph).matrix_world)
    if transforms.is_singular(matrix):
        raise SensorError(f"The scale of '{carrier.name}' is zero: give it a scale before texels are laid onto it.")
    stretch = transforms.decompose(matrix)[2] * transforms.metres_per_unit(context.scene)
    is_mirrored = np.linalg.det(stretch) < 0
    triangles = arrays.triangles[chosen[arrays.triangles].all(axis=1)]
    if not len(triangles):
        raise SensorError(f"The region on '{carrier.name}' spans no face: choose all corners of at least one face.")
    mesh, _ = checked_mesh(arrays.vertices @ stretch.T, triangles[:, ::-1] if is_mirrored else triangles, carrier.name)
    texels = make_texels(mesh, pattern)
    fans = [(face[0], face[i], face[i + 1]) for face in texels.faces for i in range(1, len(face) - 1)]
    lifted = texels.vertices + pattern["lift"] * vertex_normals(TriangleMesh(texels.vertices, np.array(fans)))
    faces = [face[::-1] for face in texels.faces] if is_mirrored else texels.faces
    return TexelMesh(lifted @ np.linalg.inv(stretch).T, faces)


def make_texels(mesh: TriangleMesh, pattern: dict) -> TexelMesh:
    """Return texels on a region in a pattern.

    Parameters
    ----------
    mesh : TriangleMesh
        The region, metres.
    pattern : dict
        Values of :data:`PATTERN_PROPERTIES`.
    """
    if pattern["method"] == "NOISE":
        return scatter(mesh, pattern["spacing"], pattern["seed"])
    if pattern["method"] == "GRID":
        return filled_region(mesh, pattern["spacing"], pattern["angle"])
    if pattern["method"] == "VERTICES":
        return mesh_of_faces(mesh.vertices, mesh.triangles)
    middle = shifted_pose(mesh, region_middle(mesh), (pattern["shift_x"], pattern["shift_y"]))
    pitch = pattern["pitch_x"], pattern["pitch_y"]
    return wrapped_array(mesh, pattern["rows"], pattern["columns"], pitch, middle, pattern["angle"])


def usual_spacing(obj, scene) -> float:
    """Return a first guess for the spacing of texels on an object, metres: the usual distance of its neighbouring vertices."""
    if obj is None or obj.type != "MESH" or not obj.data.edges:
        return 0.002
    points = mesh_arrays.vertices(obj.data) @ np.diag(np.abs(obj.matrix_world.to_scale()))
    ends = transforms.values_of(obj.data.edges, "vertices", np.int32, 2)
    lengths = np.linalg.norm(np.diff(points[ends.reshape(-1, 2)], axis=1)[:, 0], axis=1)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    usual = min(float(np.median(lengths)), size / 20) * transforms.metres_per_unit(scene)
    digits = 1 - math.floor(math.log10(usual)) if usual > 0 else 4
    return round(usual, digits) if usual > 0 else 0.002
