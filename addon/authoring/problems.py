# SPDX-License-Identifier: GPL-3.0-or-later
"""Problems of a sensor, texel by texel, and a fix for each kind of problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import bmesh
import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...core.errors import ImageError, PaintedError, PalpateError, RegionError, SensorError
from ...core.geometry.mesh import TriangleMesh, edge_defects, is_closed
from ...core.geometry.texels import Texels
from ..scene import participants, sensor_regions
from . import laid_sensors, surface_binding

OVERLAP_DISTANCE = 0.1
"""Texels that are nearer to each other than this part of the usual distance overlap."""
TEST_DISTANCE = 0.02
"""Distance of a test point from its texel, as a part of the usual distance from texel to texel."""
THICKNESS_PART = 0.9
"""A maximum penetration that is too large is set to this part of the thickness."""


@dataclass(frozen=True)
class Problem:
    """One kind of problem of a sensor.

    Attributes
    ----------
    kind : str
        A key of :data:`FIXES`, if there is a button for it.
    text : str
        One sentence for the user: what is wrong, and where.
    texels : (k,) int
        Indices of the texels concerned; empty when it is the whole sensor.
    """

    kind: str
    text: str
    texels: np.ndarray = field(default_factory=lambda: np.zeros(0, int))


def texel_problems(obj, mesh: TriangleMesh, texels: Texels, reach: float, around: TriangleMesh | None = None) -> list[Problem]:
    """Return the problems of a sensor's texels.

    Parameters
    ----------
    mesh : TriangleMesh
        The sensor's mesh in the frame of the texels.
    reach : float, metres
        Maximum penetration.
    around : TriangleMesh, optional
        Surface of a laid sensor's carrier, in the same frame.
    """
    found = []
    mixed = edge_defects(mesh.triangles)[2]
    if mixed:
        found.append(Problem("NORMALS", f"{mixed} edges of '{obj.name}' join faces that point to opposite sides."))
    spacing = _spacing(texels)
    body = around if around is not None and is_closed(around.triangles) else mesh
    # A laid sensor stands on or above the surface; texels of the object's own mesh are its vertices.
    inside = np.zeros(len(texels), bool)
    if is_closed(body.triangles) and not mixed:
        inside = _inside(body, texels, TEST_DISTANCE * spacing)
    if inside.sum() > 0.5 * len(texels):
        text = f"The texels of '{obj.name}' face inwards: its normals are flipped, so contact from outside is not measured."
        found.append(Problem("FLIPPED", text, np.flatnonzero(inside)))
    elif inside.any():
        text = f"{inside.sum()} texels of '{obj.name}' lie inside the object and cannot be in contact."
        found.append(Problem("INSIDE", text, np.flatnonzero(inside)))
    near = _overlapping(texels, spacing)
    if len(near):
        text = f"{len(near)} texels of '{obj.name}' coincide with another and measure the same force twice."
        found.append(Problem("OVERLAP", text, near))
    if not inside.any() and not mixed:
        thickness = _thickness(body, texels, TEST_DISTANCE * spacing)
        thin = np.flatnonzero(thickness < reach)
        if len(thin):
            text = (
                f"{len(thin)} texels of '{obj.name}' reach through it: the maximum penetration ({reach * 1e3:.3g} mm) is more "
                f"than its thickness there ({thickness.min() * 1e3:.3g} mm), so contact at its back would be measured in front."
            )
            found.append(Problem("THROUGH", text, thin))
    return found


def object_problems(obj, notes: list[str]) -> list[Problem]:
    """Return the problems of a sensor's object; `notes` are the warnings of :func:`.mesh_arrays.sensor_arrays`."""
    found = [Problem("MODIFIER", note) for note in notes]
    if laid_sensors.is_laid(obj):
        if obj.parent is None:
            if obj.palpate.body == "PARENT":
                found.append(Problem("ORPHAN", f"'{obj.name}' has lost its parent: it no longer moves with an object."))
        elif laid_sensors.is_outdated(obj):
            text = f"The surface of '{obj.parent.name}' has changed since '{obj.name}' was laid on it."
            found.append(Problem("OUTDATED", text))
        elif surface_binding.is_needed(obj.parent) and not surface_binding.is_bound(obj):
            found.append(Problem("STILL", f"'{obj.parent.name}' may change its shape, and the texels of '{obj.name}' stay."))
    made = obj.palpate.made_vertices
    if obj.palpate.region == "MESH" and made and made != len(obj.data.vertices):
        text = (
            f"'{obj.name}' had {made} vertices when its whole mesh became a sensor and has {len(obj.data.vertices)} now: "
            "all of them are texels."
        )
        found.append(Problem("GROWN", text))
    return found


def _spacing(texels: Texels) -> float:
    """Return the median distance of neighbouring texels, metres."""
    a, b, c = (texels.position[texels.layout.triangles[:, i]] for i in range(3))
    return float(np.median(np.linalg.norm(np.concatenate([b - a, c - b, a - c]), axis=1)))


def _tree(mesh: TriangleMesh) -> BVHTree:
    """Return a search tree of a mesh's triangles."""
    return BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.triangles.tolist(), all_triangles=True)


def _inside(mesh: TriangleMesh, texels: Texels, ahead: float) -> np.ndarray:
    """Return which texels face the inside of a closed mesh, (n,) bool.

    A point at the distance `ahead` in front of a texel is inside if at least two of three rays from it cross the mesh an odd
    number of times.
    """
    tree, size = _tree(mesh), float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    votes = np.zeros(len(texels), int)
    for tilt in ((0.0, 0.0), (0.11, 0.07), (-0.05, 0.13)):
        rays = texels.normal + tilt[0] * texels.tangent + tilt[1] * texels.bitangent
        starts = texels.position + ahead * texels.normal
        votes += [_crossings(tree, start, ray, 1e-6 * size) % 2 for start, ray in zip(starts, rays, strict=True)]
    return votes >= 2


def _crossings(tree: BVHTree, start: np.ndarray, ray: np.ndarray, step: float) -> int:
    """Return how often a ray crosses a mesh; `step` is the distance behind a crossing where the search continues."""
    here, direction, count = Vector(start), Vector(ray).normalized(), 0
    while count < 64:
        place, *_ = tree.ray_cast(here, direction)
        if place is None:
            break
        count += 1
        here = place + step * direction
    return count


def _thickness(mesh: TriangleMesh, texels: Texels, behind: float) -> np.ndarray:
    """Return the thickness of a mesh behind each texel, (n,) float, metres; infinite where the mesh has no back.

    The rays start at the distance `behind` behind the texels.
    """
    tree = _tree(mesh)
    result = np.full(len(texels), np.inf)
    for i, (point, normal) in enumerate(zip(texels.position, texels.normal, strict=True)):
        start = Vector(point - behind * normal)
        place, out, _, distance = tree.ray_cast(start, Vector(-normal))
        if place is not None and out.dot(Vector(normal)) < 0:
            result[i] = distance + behind
    return result


def _overlapping(texels: Texels, spacing: float) -> np.ndarray:
    """Return the texels that overlap a texel with a smaller index, (k,) int."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(texels.position).query_pairs(OVERLAP_DISTANCE * spacing, output_type="ndarray")
    one, other = (texels.normal[pairs[:, end]] for end in (0, 1))
    alike = np.einsum("ij,ij->i", one, other) > 0.5  # not the two sides of a thin plate
    return np.unique(pairs[alike].max(axis=1, initial=0)) if alike.any() else np.zeros(0, int)


# Fixes


def _edit(obj, work: Callable) -> None:
    """Change an object's own mesh by `work`, which gets it as a BMesh."""
    mesh = bmesh.new()
    mesh.from_mesh(obj.data)
    work(mesh)
    mesh.to_mesh(obj.data)
    mesh.free()
    obj.data.update()


def _edit_faces(obj, change: Callable) -> None:
    """Change all faces of an object's own mesh by an operator of bmesh."""
    _edit(obj, lambda mesh: change(mesh, faces=mesh.faces))


def _merge(obj, _problem, report) -> None:
    distance = OVERLAP_DISTANCE * _spacing(report.texels) / report.metres
    _edit(obj, lambda mesh: bmesh.ops.remove_doubles(mesh, verts=mesh.verts, dist=distance))
    if obj.palpate.made_vertices:
        _accept(obj)


def _leave_out(obj, problem, report) -> None:
    """Make the region a vertex group that leaves out the texels concerned."""
    from .sensors import GROUP_NAME

    settings = obj.palpate
    keep = np.setdiff1d(report.texels.vertex, report.texels.vertex[problem.texels])
    group = obj.vertex_groups.get(settings.vertex_group) if settings.region == "GROUP" else None
    group = group or obj.vertex_groups.new(name=GROUP_NAME)
    group.remove(range(len(obj.data.vertices)))
    group.add(keep.tolist(), 1.0, "REPLACE")
    settings.region, settings.vertex_group = "GROUP", group.name


def _shorten(obj, _problem, report) -> None:
    thickness = _thickness(report.body, report.texels, TEST_DISTANCE * _spacing(report.texels))
    obj.palpate.max_penetration = THICKNESS_PART * float(thickness.min())


def _apply_modifiers(obj, _problem, _report) -> None:
    if obj.data.users > 1:
        obj.data = obj.data.copy()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(obj.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph)
    old, name = obj.data, obj.data.name
    obj.modifiers.clear()
    obj.data = mesh
    if old.users == 0:
        bpy.data.meshes.remove(old)
    mesh.name = name
    _accept(obj)


def _accept(obj, *_) -> None:
    obj.palpate.made_vertices = len(obj.data.vertices)


def _whole_mesh(obj, _problem, _report) -> None:
    obj.palpate.region = "MESH"
    _accept(obj)


def _active_group(obj, _problem, _report) -> None:
    obj.palpate.vertex_group = obj.vertex_groups.active.name


def _setting(name: str, value: str) -> Callable:
    """Return the fix that gives a setting of the object a value."""
    return lambda obj, *_: setattr(obj.palpate, name, value)


def _nothing_painted(obj, _problem, _report) -> None:
    """Clear the names of painted maps that cannot be read."""
    for key in ("k", "friction", "gain"):
        try:
            sensor_regions.painted_multipliers(obj, key)
        except PaintedError:
            setattr(obj.palpate, f"{key}_map", "")


FIXES: dict[str, tuple[str, Callable]] = {
    "HIDDEN": ("Show Hidden Objects", lambda *_: participants.show_hidden(bpy.context.scene)),
    "NORMALS": ("Turn Faces Alike", lambda obj, *_: _edit_faces(obj, bmesh.ops.recalc_face_normals)),
    "FLIPPED": ("Flip Normals", lambda obj, *_: _edit_faces(obj, bmesh.ops.reverse_faces)),
    "INSIDE": ("Leave Them Out", _leave_out),
    "OVERLAP": ("Merge Them", _merge),
    "THROUGH": ("Shorten Max Penetration", _shorten),
    "MODIFIER": ("Apply Modifiers", _apply_modifiers),
    "OUTDATED": ("Lay Again", lambda obj, *_: laid_sensors.update_texels(bpy.context, obj)),
    "STILL": ("Bind to Surface", lambda obj, *_: surface_binding.bind(bpy.context, obj, obj.parent)),
    "ORPHAN": ("Keyframed Body", _setting("body", "KEYFRAMED")),
    "GROWN": ("That Is Meant", _accept),
    "REGION": ("Use Whole Mesh", _whole_mesh),
    "GROUP": ("Use Active Group", _active_group),
    "IMAGE": ("Automatic Image", _setting("image_layout", "AUTO")),
    "PAINTED": ("Empty the Field", _nothing_painted),
}
"""By kind of problem: the label of the button, and the function that it calls with (object, problem, report)."""


def fix(obj, kind: str, report) -> None:
    """Fix one kind of problem.

    Raises
    ------
    SensorError
        The sensor no longer has this problem.
    """
    problem = next((found for found in report.problems if found.kind == kind), None)
    if problem is None:
        raise SensorError(f"'{obj.name}' no longer has this problem.")
    FIXES[kind][1](obj, problem, report)


def problem_of_error(obj, error: PalpateError) -> Problem:
    """Return the problem of a sensor that has no texels because of an error; the kind OTHER has no button."""
    own = obj.palpate
    if isinstance(error, RegionError):
        lost = own.region == "GROUP" and own.vertex_group not in obj.vertex_groups and len(obj.vertex_groups) > 0
        return Problem("GROUP" if lost else "REGION", str(error))
    if isinstance(error, ImageError):
        return Problem("IMAGE", str(error))
    return Problem("PAINTED" if isinstance(error, PaintedError) else "OTHER", str(error))
