# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects whose shape may change from frame to frame, and their shapes.

Everything that moves the vertices of the evaluated mesh counts, as long as their number stays: shape keys, armatures, lattices,
cloth, Geometry Nodes, animated scale.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...core.errors import SceneError
from ...core.geometry.mesh import TriangleMesh
from ...core.geometry.texels import DeformedTexels
from ...core.io.row_tables import RowTable, motion_table
from ...core.model.scenario import Scenario, Target
from ...core.model.sensor import Deformation, Sensor
from ..session import fcurves, identity
from . import mesh_arrays, stored_names
from .mesh_arrays import MeshSnapshot

SCALE_PROPERTIES = {"scale", "delta_scale"}


def may_deform(obj) -> bool:
    """Return True when anything could change the shape of an object over time."""
    if any(modifier.show_viewport and modifier.name not in stored_names.MODIFIERS for modifier in obj.modifiers):
        return True
    if obj.parent_type in {"ARMATURE", "LATTICE"}:
        return True
    data = obj.data
    if getattr(data, "shape_keys", None) is not None or data.animation_data is not None:
        return True
    return has_animated_scale(obj)


def has_animated_scale(obj) -> bool:
    """Return True when keyframes, drivers or NLA strips change the scale of an object or of one of its parents."""
    while obj is not None:
        if fcurves.animated_paths(obj) & SCALE_PROPERTIES:
            return True
        obj = obj.parent
    return False


@dataclass
class DeformingSurface:
    """The surface of a target or sensor that may deform.

    Attributes
    ----------
    key, name : str
        Key (:func:`.identity.key`) and name of the object.
    body, index : int
        Index of the body, and of the target or sensor.
    vertex_count : int
        Number of vertices of the evaluated mesh.
    linear, offset : (3, 3) and (3,) float
        A vertex x of the object is at linear · x + offset in the body's frame, metres, at the first frame.
    is_scaled : bool
        True when `linear` and `offset` change over time.
    follower : DeformedTexels or None
        Moves the texels with the mesh; None for a target.
    """

    key: str
    name: str
    body: int
    index: int
    vertex_count: int
    linear: np.ndarray
    offset: np.ndarray
    is_scaled: bool
    follower: DeformedTexels | None
    _last: tuple | None = None
    """Arguments and result of the last call of :meth:`shape_at`: most surfaces rest most of the time."""

    def shape_at(self, snapshot: MeshSnapshot, frame: int, linear: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """Return the shape in the body's frame, metres: vertices of a target, or frames of a sensor's texels.

        Parameters
        ----------
        snapshot : MeshSnapshot
            The object's mesh at that time.
        frame : int
            Named in messages.
        linear, offset : (3, 3) and (3,) float
            A vertex x of the object is at linear · x + offset in the body's frame, metres.

        Raises
        ------
        SceneError
            The number of vertices changed, a vertex is not finite, or the scale turns the surface inside out.
        """
        if self._last is not None:
            before, values = self._last
            if before[0] is snapshot and np.array_equal(before[1], linear) and np.array_equal(before[2], offset):
                return values
        vertices = snapshot.vertices
        if len(vertices) != self.vertex_count:
            raise SceneError(
                f"'{self.name}' has {len(vertices)} vertices at frame {frame} and had {self.vertex_count} at the first: "
                "use modifiers that keep their number while it deforms."
            )
        if not np.isfinite(vertices).all():
            raise SceneError(
                f"A vertex of '{self.name}' is NaN or infinite at frame {frame}: check the modifier that moves it."
            )
        if np.linalg.det(linear) * np.linalg.det(self.linear) < 0:
            raise SceneError(f"The scale of '{self.name}' turns it inside out at frame {frame}: keep the signs of its scale.")
        values = vertices @ linear.T + offset
        values = values if self.follower is None else self.follower.local_frames(values, self.name)
        self._last = (snapshot, linear, offset), values
        return values


def deforming_surface_of(
    obj, depsgraph, part: Target | Sensor, index: int, mesh: TriangleMesh, linear: np.ndarray, offset: np.ndarray
) -> DeformingSurface | None:
    """Return the surface of a target or sensor that may deform, else None.

    Parameters
    ----------
    obj : Object
    depsgraph : Depsgraph
    part : Target or Sensor
    index : int
        Index of the target or sensor.
    mesh : TriangleMesh
        Mesh of the object in its body's frame, at the first frame.
    linear, offset : (3, 3) and (3,) float
        A vertex x of the object is at linear · x + offset in the body's frame, metres.
    """
    if not may_deform(obj):
        return None
    follower = None
    if isinstance(part, Sensor):
        with mesh_arrays.evaluated_mesh(obj, depsgraph) as final:
            if len(final.vertices) != len(mesh.vertices):
                return None  # texels stand on the mesh without modifiers
        follower = DeformedTexels(part.texels, mesh)
    is_scaled = has_animated_scale(obj)
    return DeformingSurface(
        identity.key(obj), obj.name, part.body, index, len(mesh.vertices), linear, offset, is_scaled, follower
    )


def with_first_shapes(scenario: Scenario, surfaces) -> tuple[tuple[Sensor, ...], tuple[Target, ...]]:
    """Return sensors and targets; those that may deform get their shape at the first frame."""
    sensors, targets = list(scenario.sensors), list(scenario.targets)
    for surface in surfaces:
        group = targets if surface.follower is None else sensors
        part = group[surface.index]
        first = (
            part.mesh.vertices
            if surface.follower is None
            else surface.follower.local_frames(surface.follower.rest_vertices, surface.name)
        )
        group[surface.index] = replace(part, deformation=Deformation(np.zeros(1), first[None]))
    return tuple(sensors), tuple(targets)


class ShapeHistory:
    """Shapes of what may deform, sample after sample. A shape that has not changed yet is stored once."""

    def __init__(self, scenario: Scenario):
        groups = (("target", scenario.targets), ("sensor", scenario.sensors))
        self._first = {
            (kind, index): part.deformation.values[0]
            for kind, group in groups
            for index, part in enumerate(group)
            if part.deformation is not None
        }
        self._tables: dict[tuple[str, int], RowTable] = {}
        self._count = 1

    def append(self, shapes: dict[tuple[str, int], np.ndarray]) -> None:
        """Add the shapes of one more sample, by ("target" or "sensor", index)."""
        for place, found in shapes.items():
            first = self._first[place]
            if place not in self._tables and found is not first and not np.array_equal(found, first):
                self._tables[place] = motion_table(first)
                for _ in range(self._count - 1):
                    self._tables[place].append(first)
            if place in self._tables:
                self._tables[place].append(found)
        self._count += 1

    def applied_to(self, scenario: Scenario, times: np.ndarray) -> tuple[tuple[Sensor, ...], tuple[Target, ...]]:
        """Return sensors and targets with their deformations; those that kept their shape get none."""
        groups = {"sensor": list(scenario.sensors), "target": list(scenario.targets)}
        for kind, index in self._first:
            table = self._tables.get((kind, index))
            deformation = None if table is None else Deformation(times, table.rows())
            groups[kind][index] = replace(groups[kind][index], deformation=deformation)
        return tuple(groups["sensor"]), tuple(groups["target"])
