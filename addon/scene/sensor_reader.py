# SPDX-License-Identifier: GPL-3.0-or-later
"""Read one sensor or target out of Blender: its mesh in the frame of its body, its texels, parameters and painted values."""

from __future__ import annotations

import numpy as np

from ...core.geometry.mesh import TriangleMesh, checked_mesh, outward_faces
from ...core.geometry.texels import FRAME_NORMAL, Texels, texels_from_region
from ...core.model.sensor import Sensor
from ...core.model.sensor_parameters import Painted
from ..properties import effect_stack, painted_maps, parameter_properties
from ..session import units
from . import body_poses, mesh_arrays, sensor_regions, uv_layouts
from .display_names import STATED_NORMAL


def sensor_in_own_frame(scene, obj, depsgraph) -> tuple[Sensor, TriangleMesh]:
    """Return a sensor in the frame of its own object, and its mesh in this frame.

    Raises
    ------
    PalpateError
        Its mesh or region makes no sensor.
    """
    _, _, stretch = body_poses.decompose(obj, body_poses.world_matrix(obj, depsgraph))
    mesh, _ = mesh_in_body_frame(obj, depsgraph, stretch * units.metres_per_unit(scene))
    return read_sensor(obj, 0, mesh, stretch), mesh


def mesh_in_body_frame(obj, depsgraph, linear: np.ndarray, offset: np.ndarray | float = 0.0) -> tuple[TriangleMesh, list[str]]:
    """Return an object's mesh in the frame of its body, metres, and warnings.

    Parameters
    ----------
    obj : Object
    depsgraph : Depsgraph
    linear, offset : (3, 3) and (3,) float
        A vertex x of the object is at linear · x + offset in the body's frame.
    """
    if obj.palpate.role == "TARGET":
        arrays, warnings = mesh_arrays.target_arrays(obj, depsgraph), []
    else:
        arrays, warnings = mesh_arrays.sensor_arrays(obj, depsgraph)
    triangles, quads = arrays.triangles, arrays.quads
    if np.linalg.det(linear) < 0:
        triangles, quads = triangles[:, ::-1], quads[:, ::-1]
        warnings.append(f"The scale of '{obj.name}' mirrors it: its faces were turned so that they still point outwards.")
    mesh, more = checked_mesh(arrays.vertices @ linear.T + offset, triangles, obj.name, quads)
    if obj.palpate.role == "TARGET":
        mesh, turned = outward_faces(mesh, obj.name)
        more += turned
    return mesh, warnings + more


def read_sensor(obj, body: int, mesh: TriangleMesh, linear: np.ndarray) -> Sensor:
    """Return the sensor or pad that an object is.

    Parameters
    ----------
    obj : Object
    body : int
        Index of its body.
    mesh : TriangleMesh
        Of the object, in the body's frame.
    linear : (3, 3) float
        Of the map from the object to the body's frame.
    """
    parameters = parameter_properties.sensor_parameters(obj.palpate)
    parameters.check(obj.name)
    is_read_out = obj.palpate.role == "SENSOR"
    texels = texels_from_region(mesh, sensor_regions.region_vertices(obj, len(mesh.vertices)), obj.name)
    texels = _with_stated_normals(obj.data, texels, linear)
    if is_read_out:
        texels = uv_layouts.with_uv_layout(obj, texels)
    painted = _painted_at(obj, texels.vertex)
    return Sensor(obj.name, body, texels, parameters, readout=is_read_out, painted=painted, effects=effect_stack.stack(obj))


def _with_stated_normals(data, texels: Texels, linear: np.ndarray) -> Texels:
    """The texels with the normals that the file of an imported sensor states, if it states others than the surface has."""
    attribute = data.attributes.get(STATED_NORMAL)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type != "FLOAT_VECTOR":
        return texels
    stated = np.empty(3 * len(attribute.data), np.float32)
    attribute.data.foreach_get("vector", stated)
    normal = np.linalg.solve(linear.T, stated.astype(float).reshape(-1, 3)[texels.vertex].T).T
    has_one = np.linalg.norm(normal, axis=1) > 0.0  # vertices that were added later have none
    frames = texels.local_frames
    frames[has_one, FRAME_NORMAL] = normal[has_one]
    return texels.with_local_frames(frames)


def _painted_at(obj, vertex: np.ndarray) -> Painted:
    """Return the painted values at the vertices on which texels stand."""
    maps = {key: sensor_regions.painted_multipliers(obj, key) for key in painted_maps.PAINTED_PARAMETERS}
    return Painted(**{key: None if values is None else values[vertex] for key, values in maps.items()})
