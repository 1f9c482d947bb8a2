# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects whose shape may change from frame to frame: which they are, and what they look like at the present frame.

Shape keys, armatures, lattices, cloth, Geometry Nodes, animated scale: whatever moves the vertices of the evaluated mesh
counts, as long as their number stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...core.errors import SceneError
from ...core.geometry.mesh import TriangleMesh
from ...core.geometry.texels import DeformedTexels
from ...core.model.deformation import Deformation
from ...core.model.scenario import Scenario
from ...core.model.sensor import Sensor
from ...core.model.target import Target
from ..session import fcurves, identity
from . import meshes
from .display_names import HEAT_MAP_MODIFIER
from .mesh_snapshot import Surface

SCALES = {"scale", "delta_scale"}


def may_deform(obj) -> bool:
    """Whether anything could change the shape of an object over time."""
    if any(modifier.show_viewport and modifier.name != HEAT_MAP_MODIFIER for modifier in obj.modifiers) or obj.parent_type in {
        "ARMATURE",
        "LATTICE",
    }:
        return True
    data = obj.data
    if getattr(data, "shape_keys", None) is not None or data.animation_data is not None:
        return True
    return has_animated_scale(obj)


def has_animated_scale(obj) -> bool:
    """Whether keyframes or drivers change the scale of an object or of one of its parents."""
    while obj is not None:
        if fcurves.animated_paths(obj) & SCALES:
            return True
        obj = obj.parent
    return False


@dataclass
class Skin:
    """The surface of a target or sensor that may deform.

    Attributes
    ----------
    key, name : str
    body, index : int
        Whose surface it is, and which target or sensor.
    count : int
        Vertices of the evaluated mesh.
    linear, offset : (3, 3) and (3,) float
        From the object's vertices to the body's frame in metres, at the first frame.
    scaled : bool
        Whether those change.
    follower : DeformedTexels or None
        How texels go with the mesh; None for a target.
    """

    key: str
    name: str
    body: int
    index: int
    count: int
    linear: np.ndarray
    offset: np.ndarray
    scaled: bool
    follower: DeformedTexels | None
    _last: tuple | None = None
    """What :meth:`at` was asked last, and what it said: most surfaces stay as they are."""

    def at(self, surface: Surface, frame: int, linear: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """Return the shape at a frame: vertices of a target, frames of a sensor's texels, in the body's frame, metres.

        Parameters
        ----------
        surface : Surface
            Of the object at that frame.
        frame : int
            For messages.
        linear, offset : (3, 3) and (3,) float
            From the object's vertices to the body's frame.

        Raises
        ------
        SceneError
            The surface is no longer what it was: other vertices, turned inside out, or not a number.
        """
        if self._last is not None:
            before, values = self._last
            if before[0] is surface and np.array_equal(before[1], linear) and np.array_equal(before[2], offset):
                return values
        values = self._worked_out(surface, frame, linear, offset)
        self._last = (surface, linear, offset), values
        return values

    def _worked_out(self, surface: Surface, frame: int, linear: np.ndarray, offset: np.ndarray) -> np.ndarray:
        found = surface.vertices
        if len(found) != self.count:
            raise SceneError(
                f"'{self.name}' has {len(found)} vertices at frame {frame} and had {self.count} at the first: "
                "use modifiers that keep their number while it deforms."
            )
        if not np.isfinite(found).all():
            raise SceneError(
                f"A vertex of '{self.name}' is NaN or infinite at frame {frame}: check the modifier that moves it."
            )
        if np.linalg.det(linear) * np.linalg.det(self.linear) < 0:
            raise SceneError(f"The scale of '{self.name}' turns it inside out at frame {frame}: keep the signs of its scale.")
        values = found @ linear.T + offset
        return values if self.follower is None else self.follower.frames(values, self.name)


def skin_of(
    obj, depsgraph, part: Target | Sensor, index: int, mesh: TriangleMesh, linear: np.ndarray, offset: np.ndarray
) -> Skin | None:
    """Return the skin of a target or sensor that may deform, else None.

    Parameters
    ----------
    mesh : TriangleMesh
        The object's, in its body's frame, at the first frame.
    linear, offset : (3, 3) and (3,) float
        From the object's vertices to those.
    """
    if not may_deform(obj):
        return None
    follower = None
    if isinstance(part, Sensor):
        with meshes.evaluated(obj, depsgraph) as final:
            if len(final.vertices) != len(mesh.vertices):
                return None  # texels stand on the mesh without modifiers
        follower = DeformedTexels(part.texels, mesh)
    scaled = has_animated_scale(obj)
    return Skin(identity.key(obj), obj.name, part.body, index, len(mesh.vertices), linear, offset, scaled, follower)


def declared(scenario: Scenario, skins) -> tuple[tuple[Sensor, ...], tuple[Target, ...]]:
    """Return sensors and targets that are known to deform, with their shape at the first frame."""
    sensors, targets = list(scenario.sensors), list(scenario.targets)
    for skin in skins:
        group = targets if skin.follower is None else sensors
        part = group[skin.index]
        first = part.mesh.vertices if skin.follower is None else skin.follower.frames(skin.follower.start, skin.name)
        group[skin.index] = replace(part, deformation=Deformation(np.zeros(1), first[None]))
    return tuple(sensors), tuple(targets)


class Shapes:
    """Shapes of what may deform, frame after frame; those that never change take the room of one."""

    def __init__(self, scenario: Scenario):
        groups = (("target", scenario.targets), ("sensor", scenario.sensors))
        self._known = {
            (kind, index): [part.deformation.values[0]]
            for kind, group in groups
            for index, part in enumerate(group)
            if part.deformation is not None
        }
        self._seen: dict[tuple[str, int], np.ndarray] = {}

    def append(self, shapes: dict[tuple[str, int], np.ndarray]) -> None:
        """Add what one more sample says."""
        for place, found in shapes.items():
            known, seen = self._known[place], self._seen.get(place)
            same = found is seen or np.array_equal(found, known[-1])
            known.append(known[-1] if same else found)
            self._seen[place] = found

    def finished(self, scenario: Scenario, times: np.ndarray) -> tuple[tuple[Sensor, ...], tuple[Target, ...]]:
        """Return sensors and targets with their deformations; without where nothing has changed."""
        groups = {"sensor": list(scenario.sensors), "target": list(scenario.targets)}
        for (kind, index), samples in self._known.items():
            still = all(found is samples[0] for found in samples)
            deformation = None if still else Deformation(times, np.array(samples))
            groups[kind][index] = replace(groups[kind][index], deformation=deformation)
        return tuple(groups["sensor"]), tuple(groups["target"])
