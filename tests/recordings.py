# SPDX-License-Identifier: GPL-3.0-or-later
"""Small sensors and made-up recordings for the tests of figures and files."""

from __future__ import annotations

import numpy as np

from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.texels import texels_from_region
from palpate.core.model.recording import Recording, SensorRecording

ROWS, COLUMNS, PITCH = 5, 3, 0.004


def grid_texels():
    """A flat pad of 5 × 3 texels in z = 0."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS]
    vertices = np.stack([x.ravel() * PITCH, y.ravel() * PITCH, np.zeros(ROWS * COLUMNS)], axis=1)
    quads = np.array(
        [
            [j * COLUMNS + i, j * COLUMNS + i + 1, (j + 1) * COLUMNS + i + 1, (j + 1) * COLUMNS + i]
            for j in range(ROWS - 1)
            for i in range(COLUMNS - 1)
        ]
    )
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return texels_from_region(TriangleMesh(vertices, triangles, quads), np.ones(len(vertices), bool), "pad")


def round_texels():
    """A cap of a sphere, whose texels form no grid."""
    angle = np.arange(12) * np.pi / 6
    rim = np.stack([0.01 * np.cos(angle), 0.01 * np.sin(angle), np.zeros(12)], axis=1)
    vertices = np.concatenate([[[0, 0, 0.004]], rim])
    triangles = np.array([[0, 1 + i, 1 + (i + 1) % 12] for i in range(12)])
    return texels_from_region(TriangleMesh(vertices, triangles), np.ones(13, bool), "cap")


def recording_of(texels, frames=10):
    """Forces that rise, slide along the rows, and vanish; nothing happens in the last three frames."""
    n = len(texels)
    load = np.clip(np.arange(frames) - 1, 0, None) * (np.arange(frames) < frames - 3)
    normal = load[:, None] * np.linspace(0.01, 0.02, n)
    shear = np.zeros((frames, n, 2))
    shear[:, :, 1] = 0.2 * normal
    zeros, vector = np.zeros((frames, n)), np.zeros((frames, 3))
    sensor = SensorRecording(
        normal, shear, np.linalg.norm(shear, axis=2), zeros, zeros, normal > 0, normal, vector, vector, vector
    )
    return Recording(
        frames=np.arange(1, frames + 1),
        times=np.arange(frames) / 24,
        sensors={"pad": sensor},
        body_names=("pad",),
        poses=np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (frames, 1, 1)),
        velocities=np.zeros((frames, 1, 6)),
        dt=1e-4,
    )
