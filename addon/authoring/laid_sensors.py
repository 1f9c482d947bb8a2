# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors with a mesh of their own on another object: wrapped arrays and evenly spaced texels.

A skin is a mesh object whose vertices are the texels. It is a child of the object it lies on and part of its body
(:mod:`.attached_objects`), so that one object can carry several, each with its own parameters. It remembers how it was
made and can be made anew when the surface has changed.
"""

from __future__ import annotations

import hashlib
import math

import bpy
import numpy as np

from ...core.errors import SensorError
from ...core.geometry.mesh import TriangleMesh, checked_mesh, vertex_normals
from ...core.geometry.sampling.poisson_disk import scatter
from ...core.geometry.sampling.texel_arrays import (
    TexelMesh,
    filled_region,
    pad_array,
    region_middle,
    shifted_pose,
    wrapped_array,
)
from ..scene import meshes, scene_reader
from ..session import identity, transforms, units
from . import sensor_presets, sensors, surface_binding

RECIPE = ("method", "rows", "columns", "pitch_x", "pitch_y", "shift_x", "shift_y", "angle", "spacing", "seed", "lift")
"""Settings of :class:`.properties.PALPATE_PG_skin` that a skin is made from."""


def new_pad(context, rows: int, columns: int, pitch: tuple[float, float], radius: float):
    """Return the mesh of a tactile pad; lengths in metres."""
    return _mesh_of(pad_array(rows, columns, pitch, radius), "Tactile Pad", 1.0 / units.metres_per_unit(context.scene))


def lay(context, carrier, source: str, recipe: dict):
    """Make a sensor on the surface of an object.

    Parameters
    ----------
    source : str
        As for :func:`.sensors.make_sensor`; OWN is the region that the object has as a sensor.
    recipe : dict
        The settings in :data:`RECIPE`; lengths in metres, the angle in radians.

    Returns
    -------
    Object
        The skin: a child of `carrier`, with the role Sensor.

    Raises
    ------
    SensorError
        The region is empty, or the texels do not fit on it. Nothing was changed then.
    """
    where = sensors.describe_region(carrier, source)
    try:
        skin = _compute(context, carrier, _chosen(carrier, where), recipe)
    except SensorError:
        if source == "SELECTION":
            carrier.vertex_groups.remove(carrier.vertex_groups[where["vertex_group"]])
        raise
    name = f"{carrier.name} Skin"
    obj = bpy.data.objects.new(name, _mesh_of(skin, name))
    for place in carrier.users_collection[:1] or [context.scene.collection]:
        place.objects.link(obj)
    obj.parent = carrier
    _remember(obj, carrier, where, recipe)
    if carrier.palpate.role in {"SENSOR", "PAD"}:
        sensor_presets.copy_parameters(carrier, obj)
    context.view_layer.update()
    surface_binding.cling(context, obj, carrier)
    obj.palpate.body = "PARENT"
    obj.palpate.role = "SENSOR"
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj
    return obj


def lay_anew(context, obj) -> int:
    """Make a skin again from the surface as it is now; returns the number of texels. What was painted on it is carried over.

    Raises
    ------
    SensorError
        The object is no skin, what it lay on is gone, or the texels do not fit any more.
    """
    carrier = carrier_of(obj)
    own = obj.palpate.skin
    where = {"region": own.region, "vertex_group": own.region_name, "material": own.region_name, "face_set": own.region_number}
    recipe = recipe_of(obj)
    skin = _compute(context, carrier, _chosen(carrier, where), recipe)
    old, painted = obj.data, surface_binding.painted(obj)
    obj.data = _mesh_of(skin, old.name)
    surface_binding.carry_over(obj, painted)
    for material in old.materials:
        obj.data.materials.append(material)
    if old.users == 0:
        bpy.data.meshes.remove(old)
    surface_binding.cling(context, obj, carrier)
    _remember(obj, carrier, where, recipe)
    return len(skin.vertices)


def recipe_of(obj) -> dict:
    """Return how a skin was made."""
    own = obj.palpate.skin
    return {key: units.as_typed(v) if isinstance(v := getattr(own, key), float) else v for key in RECIPE}


def is_skin(obj) -> bool:
    """Whether an object was made by :func:`lay`."""
    return obj.type == "MESH" and obj.palpate.skin.method != "NONE"


def skins_of(obj) -> list:
    """Return the sensors that lie on an object."""
    return [child for child in obj.children if is_skin(child) and child.palpate.role in {"SENSOR", "PAD"}]


def carrier_of(obj):
    """Return what a skin lies on.

    Raises
    ------
    SensorError
        It has no parent any more.
    """
    if not is_skin(obj):
        raise SensorError(f"'{obj.name}' was not laid onto a surface: use Lay Texels on the object that carries the sensor.")
    if obj.parent is None or obj.parent.type != "MESH":
        raise SensorError(f"'{obj.name}' has lost the mesh it lay on: make that its parent again (Object › Parent).")
    return obj.parent


def is_outdated(obj) -> bool:
    """Whether the surface under a skin has changed since it was made."""
    own = obj.palpate.skin
    return is_skin(obj) and obj.parent is not None and obj.parent.type == "MESH" and own.made_from != _state_of(obj.parent, own)


def _remember(obj, carrier, where: dict, recipe: dict) -> None:
    own = obj.palpate.skin
    for key, value in recipe.items():
        setattr(own, key, value)
    own.region, own.region_number = where["region"], where.get("face_set", 0)
    own.region_name = where.get({"GROUP": "vertex_group", "MATERIAL": "material"}.get(own.region, ""), "")
    own.made_from = _state_of(carrier, own)
    obj.palpate.made_vertices = len(obj.data.vertices)
    identity.ensure(obj)


def _state_of(carrier, own) -> str:
    """Return a short text that changes with the carrier's mesh, its scale and the region on it."""
    digest = hashlib.blake2b(digest_size=8)
    digest.update(meshes.vertices(carrier.data).tobytes())
    digest.update(np.round(np.array(carrier.scale), 6).tobytes())
    where = {"region": own.region, "vertex_group": own.region_name, "material": own.region_name, "face_set": own.region_number}
    try:
        digest.update(np.packbits(_chosen(carrier, where)).tobytes())
    except SensorError:
        digest.update(b"gone")
    return digest.hexdigest()


def _chosen(carrier, where: dict) -> np.ndarray:
    return meshes.region_by(carrier, len(carrier.data.vertices), **where)


def _compute(context, carrier, chosen: np.ndarray, recipe: dict) -> TexelMesh:
    """Return the texels in the coordinates of the carrier."""
    depsgraph = scene_reader.depsgraph_of(context.scene)
    arrays, _ = meshes.sensor_arrays(carrier, depsgraph)
    matrix = transforms.array(carrier.evaluated_get(depsgraph).matrix_world)
    if transforms.is_singular(matrix):
        raise SensorError(f"The scale of '{carrier.name}' is zero: give it a scale before texels are laid onto it.")
    stretch = transforms.split(matrix)[2] * units.metres_per_unit(context.scene)
    mirrored = np.linalg.det(stretch) < 0
    triangles = arrays.triangles[chosen[arrays.triangles].all(axis=1)]
    if not len(triangles):
        raise SensorError(f"The region on '{carrier.name}' spans no face: choose all corners of at least one face.")
    mesh, _ = checked_mesh(arrays.vertices @ stretch.T, triangles[:, ::-1] if mirrored else triangles, carrier.name)
    skin = make(mesh, recipe)
    lifted = skin.vertices + recipe["lift"] * vertex_normals(_triangulated(skin))
    faces = [face[::-1] for face in skin.faces] if mirrored else skin.faces
    return TexelMesh(lifted @ np.linalg.inv(stretch).T, faces)


def make(mesh: TriangleMesh, recipe: dict) -> TexelMesh:
    """Lay texels onto a region as the recipe says."""
    if recipe["method"] == "NOISE":
        return scatter(mesh, recipe["spacing"], recipe["seed"])
    if recipe["method"] == "GRID":
        return filled_region(mesh, recipe["spacing"], recipe["angle"])
    if recipe["method"] == "VERTICES":
        used, corners = np.unique(mesh.triangles, return_inverse=True)
        return TexelMesh(mesh.vertices[used], [tuple(face) for face in corners.reshape(-1, 3).tolist()])
    middle = shifted_pose(mesh, region_middle(mesh), (recipe["shift_x"], recipe["shift_y"]))
    pitch = recipe["pitch_x"], recipe["pitch_y"]
    return wrapped_array(mesh, recipe["rows"], recipe["columns"], pitch, middle, recipe["angle"])


def _triangulated(skin: TexelMesh) -> TriangleMesh:
    triangles = [(face[0], face[i], face[i + 1]) for face in skin.faces for i in range(1, len(face) - 1)]
    return TriangleMesh(skin.vertices, np.array(triangles))


def _mesh_of(skin: TexelMesh, name: str, scale: float = 1.0):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((skin.vertices * scale).tolist(), [], skin.faces)
    mesh.update()
    return mesh


def usual_spacing(obj, scene) -> float:
    """Metres between neighbouring vertices of an object, as a first guess for the spacing of texels."""
    if obj is None or obj.type != "MESH" or not obj.data.edges:
        return 0.002
    points = meshes.vertices(obj.data) @ np.diag(np.abs(obj.matrix_world.to_scale()))
    ends = np.empty(2 * len(obj.data.edges), dtype=np.int32)
    obj.data.edges.foreach_get("vertices", ends)
    lengths = np.linalg.norm(np.diff(points[ends.reshape(-1, 2)], axis=1)[:, 0], axis=1)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    usual = min(float(np.median(lengths)), size / 20) * units.metres_per_unit(scene)
    digits = 1 - math.floor(math.log10(usual)) if usual > 0 else 4
    return round(usual, digits) if usual > 0 else 0.002
