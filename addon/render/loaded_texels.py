# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the loaded texels of a bake are at a frame: what a picture of the scene has to show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.io.bake_reader import Bake, frame_index
from ..display import indentation
from ..scene import stored_names
from ..session import transforms

LOADED_SHARE = 0.05
"""A texel is loaded from this share of the largest normal force of any texel at the frame: what one sees in a colour map."""


@dataclass(frozen=True)
class LoadedTexels:
    """Texels that carry force at one frame.

    Attributes
    ----------
    points, normals : (n, 3) float, Blender units and unit vectors, world
        On the indented surface.
    radii : (n,) float, Blender units
        Of discs as large as the texels.
    forces : (n,) float, N
        Normal forces.
    sensors : (n,) int
        Number of each texel's sensor, in the order of the bake.
    """

    points: np.ndarray
    normals: np.ndarray
    radii: np.ndarray
    forces: np.ndarray
    sensors: np.ndarray

    def __len__(self) -> int:
        return len(self.points)


def loaded_texels(scene, bake: Bake, frame: int) -> LoadedTexels:
    """Return the loaded texels of all sensors of a bake at a frame, which the bake must have."""
    recording, metres = bake.recording, transforms.metres_per_unit(scene)
    sensors, poses = recording.at(frame).sensors, recording.poses[frame_index(recording, frame)]
    largest = max((float(sensors[name].normal_force.max(initial=0.0)) for name in bake.texels), default=0.0)
    objects = stored_names.objects_of_bake(scene, bake.texels)
    parts = [(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=int))]
    for number, (name, texels) in enumerate(bake.texels.items()):
        body, readings = bake.manifests[name].body or name, sensors[name]
        if body not in recording.body_names or largest <= 0.0:
            continue
        chosen = readings.normal_force >= LOADED_SHARE * largest
        pose = poses[recording.body_names.index(body)]
        rotation = transforms.rotation(pose[3:])
        depth = indentation.factor_of(objects.get(name)) * readings.depth[chosen]
        local = texels.position[chosen] - depth[:, None] * texels.normal[chosen]
        points = (pose[:3] + local @ rotation.T) / metres
        radii = np.sqrt(texels.area[chosen] / np.pi) / metres
        normals = texels.normal[chosen] @ rotation.T
        parts.append((points, normals, radii, readings.normal_force[chosen], np.full(len(points), number)))
    return LoadedTexels(*(np.concatenate(column) for column in zip(*parts, strict=True)))
