# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors that are exported in tests, and what a reader found of them."""

from __future__ import annotations

import numpy as np

from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.texel_arrays import pad_array
from palpate.core.geometry.texels import texels_from_region
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import Painted, SensorParameters
from palpate.core.simulators.sensor_on_mesh import SensorOnMesh

FLOAT32 = 1e-6
"""Simulators store meshes in single precision: 6e-8 of at most a few metres, and as much again for turning them."""


def triangles_of(faces) -> np.ndarray:
    return np.array([(face[0], face[i], face[i + 1]) for face in faces for i in range(1, len(face) - 1)])


def pad(rows=14, columns=6, radius=0.0, name="Pad", **parameters) -> SensorOnMesh:
    """Return a pad in rows and columns, flat or bent."""
    array = pad_array(rows, columns, (0.0034, 0.0034), radius)
    mesh = TriangleMesh(array.vertices, triangles_of(array.faces), np.array(array.faces))
    texels = texels_from_region(mesh, np.ones(len(mesh.vertices), bool))
    values = SensorParameters(**({"k": 1000.0, "cn": 10.0, "max_penetration": 0.006} | parameters))
    turn = np.array([0.8, 0.1, -0.5, 0.3])
    return SensorOnMesh(Sensor(name, 0, texels, values), mesh, None, np.array([0.1, -0.2, 0.3]), turn / np.linalg.norm(turn))


def ball(name="Ball", painted=True) -> SensorOnMesh:
    """Return a closed ball whose upper part feels; its texels form no grid, and one normal is that of the ball's pole."""
    import trimesh

    shape = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    mesh = TriangleMesh(np.array(shape.vertices), np.array(shape.faces))
    texels = texels_from_region(mesh, mesh.vertices[:, 2] > 0.004)
    factors = Painted(k=np.linspace(0.5, 1.5, len(texels))) if painted else Painted()
    return SensorOnMesh(Sensor(name, 0, texels, painted=factors), mesh)
