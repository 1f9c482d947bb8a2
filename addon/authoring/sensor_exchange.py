# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors of a scene for other simulators."""

from __future__ import annotations

import numpy as np

from ...core.errors import SceneError
from ...core.geometry.mesh import TriangleMesh, checked_mesh
from ...core.simulators.sensor_on_mesh import SensorOnMesh
from ..scene import mesh_arrays, moved_bodies, participants, sensor_reader
from ..session import transforms


def sensors_on_meshes(scene, names=()) -> list[SensorOnMesh]:
    """Return sensors of a scene at its present frame, each in the frame of its own object.

    Parameters
    ----------
    names : sequence of str
        Of sensors or pads. Without names: all sensors of the simulation.

    Raises
    ------
    SceneError
        There is no sensor, or none of a name.
    PalpateError
        A sensor's mesh or region makes no sensor.
    """
    objects = participants.sensors_called(scene, dict.fromkeys(names), "PAD")
    if not names:
        objects = [obj for obj in participants.find_participants(scene)[0] if obj.palpate.role == "SENSOR"]
    if not objects:
        raise SceneError(f"'{scene.name}' has no sensor: make one with Physics › Palpate › Make Sensor.")
    return [_sensor_on_mesh(scene, obj) for obj in objects]


def _sensor_on_mesh(scene, obj) -> SensorOnMesh:
    depsgraph = participants.depsgraph_of(scene)
    sensor, mesh = sensor_reader.sensor_in_own_frame(scene, obj, depsgraph)
    pose = moved_bodies.body_pose(scene, obj, depsgraph)
    surface = carrying_surface(scene, obj, depsgraph) if obj.palpate.body == "PARENT" else None
    surface = surface and checked_mesh(surface.vertices, surface.triangles, obj.parent.name)[0]
    return SensorOnMesh(sensor, mesh, surface, pose[:3], pose[3:])


def carrying_surface(scene, obj, depsgraph) -> TriangleMesh | None:
    """Return the surface of a sensor's parent in the frame of the sensor's object, metres; None where it has none."""
    carrier = obj.parent
    if carrier is None or carrier.type not in participants.OBJECT_TYPES:
        return None
    arrays = mesh_arrays.target_arrays(carrier, depsgraph)
    location, quaternion, _ = moved_bodies.decompose(obj, moved_bodies.world_matrix(obj, depsgraph))
    matrix = np.linalg.inv(transforms.pose_matrix(location, quaternion)) @ moved_bodies.world_matrix(carrier, depsgraph)
    vertices = (arrays.vertices @ matrix[:3, :3].T + matrix[:3, 3]) * transforms.metres_per_unit(scene)
    triangles = arrays.triangles[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else arrays.triangles
    return TriangleMesh(vertices, triangles)
