# SPDX-License-Identifier: GPL-3.0-or-later
"""What evaluated meshes looked like when they were read last: most look the same at the next frame, and comparing costs less
than a fingerprint and a place in the body's frame for each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from . import meshes


@dataclass
class Surface:
    """An evaluated mesh as it was read.

    Attributes
    ----------
    places : (3 · nv,) float32, Blender units, in the object's frame
    corners : (nc,) int32
        Vertex of each corner of the faces.
    """

    places: np.ndarray
    corners: np.ndarray

    @cached_property
    def vertices(self) -> np.ndarray:
        """(nv, 3) float."""
        return self.places.astype(float).reshape(-1, 3)


class Seen:
    """The surfaces of the objects of a run, read once at each moment."""

    def __init__(self):
        self._surfaces: dict[int, Surface] = {}
        self._looks: dict[int, tuple[Surface, str]] = {}
        self._regions: dict[int, bytes] = {}
        self._read: set[int] = set()

    def begin(self) -> None:
        """The scene stands at another moment: read everything anew."""
        self._read.clear()

    def of(self, obj, depsgraph) -> Surface:
        """Return an object's surface: the same one, not only an equal one, as long as vertices and number of corners stay."""
        key = obj.session_uid
        if key not in self._read:
            with meshes.evaluated(obj, depsgraph) as mesh:
                places, before = meshes.places(mesh), self._surfaces.get(key)
                if before is None or len(mesh.loops) != len(before.corners) or not _same(places, before.places):
                    self._surfaces[key] = Surface(places, meshes.corners(mesh))
            self._read.add(key)
        return self._surfaces[key]

    def look(self, obj, depsgraph) -> str:
        """Return the fingerprint (:func:`.meshes.fingerprint`) of an object, with its region as it was when first asked for."""
        key, surface = obj.session_uid, self.of(obj, depsgraph)
        if key not in self._regions:
            self._regions[key] = meshes.region_bytes(obj)
        if key not in self._looks or self._looks[key][0] is not surface:
            self._looks[key] = surface, meshes.fingerprint_of(surface.places, surface.corners, self._regions[key])
        return self._looks[key][1]


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two arrays of 32-bit values have the same bits."""
    return len(one) == len(other) and np.array_equal(one.view(np.int32), other.view(np.int32))
