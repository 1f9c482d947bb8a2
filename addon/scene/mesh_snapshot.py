# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated meshes as they were read last.

Most meshes are the same at the next frame. Comparing two meshes takes less time than to compute a fingerprint and positions in
the body's frame again.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from . import mesh_arrays, mesh_fingerprint


@dataclass
class MeshSnapshot:
    """An evaluated mesh as it was read.

    Attributes
    ----------
    positions : (3 · nv,) float32, Blender units, in the object's frame
    corners : (nc,) int32
        Vertex of each corner of the faces.
    """

    positions: np.ndarray
    corners: np.ndarray

    @cached_property
    def vertices(self) -> np.ndarray:
        """Positions of the vertices, (nv, 3) float."""
        return self.positions.astype(float).reshape(-1, 3)


class MeshSnapshots:
    """Snapshots of the objects of a run. Each mesh is read once per frame."""

    def __init__(self):
        self._snapshots: dict[int, MeshSnapshot] = {}
        self._fingerprints: dict[int, tuple[MeshSnapshot, str]] = {}
        self._regions: dict[int, bytes] = {}
        self._read: set[int] = set()

    def begin_frame(self) -> None:
        """Note that the scene stands at another frame, so that every mesh has to be read again."""
        self._read.clear()

    def snapshot(self, obj, depsgraph) -> MeshSnapshot:
        """Return the snapshot of an object; the identical one while positions and number of corners stay the same."""
        key = obj.session_uid
        if key not in self._read:
            with mesh_arrays.evaluated_mesh(obj, depsgraph) as mesh:
                positions, before = mesh_arrays.positions(mesh), self._snapshots.get(key)
                if before is None or len(mesh.loops) != len(before.corners) or not _same_bits(positions, before.positions):
                    self._snapshots[key] = MeshSnapshot(positions, mesh_arrays.corner_vertices(mesh))
            self._read.add(key)
        return self._snapshots[key]

    def fingerprint(self, obj, depsgraph) -> str:
        """Return an object's :func:`.mesh_fingerprint.evaluated_fingerprint`, with its region as at the first call."""
        key, snapshot = obj.session_uid, self.snapshot(obj, depsgraph)
        if key not in self._regions:
            self._regions[key] = mesh_fingerprint.region_bytes(obj)
        if key not in self._fingerprints or self._fingerprints[key][0] is not snapshot:
            self._fingerprints[key] = (
                snapshot,
                mesh_fingerprint.arrays_fingerprint(snapshot.positions, snapshot.corners, self._regions[key]),
            )
        return self._fingerprints[key][1]


def _same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    """Return True when two arrays of 32-bit values have the same bits."""
    return len(one) == len(other) and np.array_equal(one.view(np.int32), other.view(np.int32))
