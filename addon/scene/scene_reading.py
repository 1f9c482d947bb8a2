# SPDX-License-Identifier: GPL-3.0-or-later
"""Result of reading a scene: the :class:`.Scenario`, the objects behind it, and the way to read its later frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...core.errors import SceneError
from ...core.model.scenario import Scenario
from ..session import identity, transforms
from . import moved_bodies
from .deforming_objects import DeformingSurface, has_animated_scale
from .mesh_arrays import MeshSnapshots

SAME_STRETCH = 1e-4
"""Largest relative change of an object's scale over time that is put down to rounding."""

Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,) in metres and quaternion (4,) of a body's frame in the world."""


@dataclass(frozen=True)
class FrameSample:
    """The state of a scene at one time, as animation gives it.

    Attributes
    ----------
    poses : dict of int to Pose
        By body index: of keyframed bodies, and of driven bodies as they would be without their drives.
    parent_matrices : dict of int to (4, 4) float
        By index of a free or driven body: the share of its parents in its world matrix.
    drive_targets : dict of int to float
        By index of a driven body.
    shapes : dict of (str, int) to (n, 3) or (n, 9) float
        By ("target" or "sensor", index): shapes of those that may deform (:class:`.Deformation`).
    """

    poses: dict[int, Pose]
    parent_matrices: dict[int, np.ndarray]
    drive_targets: dict[int, float]
    shapes: dict[tuple[str, int], np.ndarray]


@dataclass
class SceneReading:
    """A scene as it was read, and what later frames of it are compared with.

    Attributes
    ----------
    scenario : Scenario
    object_keys, object_names : tuple of str
        By body index: keys of the objects (:func:`.identity.key`) and, for messages, their names.
    sensor_keys : tuple of str
        By sensor index: keys of the objects that are sensors and pads.
    metres_per_unit : float
    stretches : (b, 3, 3) float
        By body index: stretch of the object at the first frame (:mod:`.transforms`).
    start_matrices : dict of int to (4, 4) float
        World matrices at the first frame of the bodies that forces move, by body index.
    parent_matrices : dict of int to list of (4, 4) float
        By index of such a body: the share of its parents in its world matrix, frame by frame.
    warnings : tuple of str
    attachments : dict of str to (4, 4) float
        By key of an object that is part of another object's body: its matrix in that object's coordinates.
    surfaces : tuple of DeformingSurface
        Surfaces that may deform.
    mesh_fingerprints : dict of str to list of str
        By object name: fingerprints, frame by frame, of meshes that may differ from the object's own mesh.
    """

    scenario: Scenario
    object_keys: tuple[str, ...]
    object_names: tuple[str, ...]
    sensor_keys: tuple[str, ...]
    metres_per_unit: float
    stretches: np.ndarray
    start_matrices: dict[int, np.ndarray]
    parent_matrices: dict[int, list[np.ndarray]]
    warnings: tuple[str, ...]
    attachments: dict[str, np.ndarray]
    surfaces: tuple[DeformingSurface, ...]
    mesh_fingerprints: dict[str, list[str]] = field(default_factory=dict)
    _snapshots: MeshSnapshots = field(default_factory=MeshSnapshots)
    _last_poses: dict[int, tuple[bytes, Pose]] = field(default_factory=dict)
    """By body index: the last matrix that was read, and its pose. Most bodies rest most of the time."""

    def sensor_objects(self, scene) -> list:
        """Return the objects that are sensors and pads, by sensor index; None for a deleted object."""
        found = identity.find_objects(scene, self.sensor_keys)
        return [found.get(key) for key in self.sensor_keys]

    def objects(self, scene) -> list:
        """Return the objects by body index.

        Raises
        ------
        SceneError
            One of them was deleted or unlinked from the scene.
        """
        found = identity.find_objects(scene, self.object_keys)
        for key, name in zip(self.object_keys, self.object_names, strict=True):
            if key not in found:
                raise _deleted(name)
        return [found[key] for key in self.object_keys]

    def all_objects(self, scene) -> list:
        """Return the objects by body index, followed by the objects that are part of their bodies, if they still exist."""
        found = identity.find_objects(scene, self.attachments)
        return self.objects(scene) + [found[key] for key in self.attachments if key in found]

    def sample(self, scene, depsgraph) -> FrameSample:
        """Read the scene at its present frame.

        Raises
        ------
        SceneError
            An object was deleted, or changed in a way that no run can follow.
        """
        poses, parents, targets, matrices = {}, {}, {}, {}
        for index, obj in enumerate(self.objects(scene)):
            if index in self.start_matrices:
                matrices[index] = self.start_matrices[index]
                parents[index] = moved_bodies.parent_matrix(obj, depsgraph)
                if self.scenario.bodies[index].drive is None:
                    continue
                targets[index] = moved_bodies.drive_target(obj, depsgraph)
                # where its parents alone would have carried it
                matrix = parents[index] @ np.linalg.inv(self.parent_matrices[index][0]) @ matrices[index]
            else:
                matrix = matrices[index] = moved_bodies.world_matrix(obj, depsgraph)
            poses[index] = self._pose(scene, index, obj, matrix)
        if self.attachments:
            moved_bodies.check_attachments(scene, depsgraph, self.attachments)
        return FrameSample(poses, parents, targets, self._shapes(scene, depsgraph, matrices))

    def record_fingerprints(self, objects, depsgraph) -> None:
        """Append the fingerprints of some evaluated meshes at the present frame, which has been sampled before."""
        for obj in objects:
            self.mesh_fingerprints.setdefault(obj.name, []).append(self._snapshots.fingerprint(obj, depsgraph))

    def _pose(self, scene, index: int, obj, matrix: np.ndarray) -> Pose:
        """Return the pose of a body; its stretch must be that of the first frame, unless its shape may follow the scale."""
        before = self._last_poses.get(index)
        if before is not None and before[0] == matrix.tobytes():
            return before[1]
        position, quaternion, stretch = moved_bodies.decompose(obj, matrix)
        expected = self.stretches[index]
        may_deform = any(surface.body == index for surface in self.surfaces)
        if not (may_deform and has_animated_scale(obj)) and (
            np.abs(stretch - expected).max() > SAME_STRETCH * np.abs(expected).max()
        ):
            raise SceneError(
                f"The scale of '{obj.name}' changes (frame {scene.frame_current}) without keyframes or drivers of its own or a "
                "parent: give it some, or keep the scale constant."
            )
        pose = position * self.metres_per_unit, quaternion
        self._last_poses[index] = matrix.tobytes(), pose
        return pose

    def _shapes(self, scene, depsgraph, matrices: dict[int, np.ndarray]) -> dict:
        """Return the shapes of the surfaces that may deform: vertices of targets, and frames of sensors' texels."""
        found = {}
        self._snapshots.begin_frame()
        objects = identity.find_objects(scene, {surface.key for surface in self.surfaces})
        for surface in self.surfaces:
            if surface.key not in objects:
                raise _deleted(surface.name)
            linear, offset = self._to_body(surface, matrices[surface.body])
            snapshot = self._snapshots.snapshot(objects[surface.key], depsgraph)
            place = "target" if surface.follower is None else "sensor", surface.index
            found[place] = surface.shape_at(snapshot, scene.frame_current, linear, offset)
        return found

    def _to_body(self, surface: DeformingSurface, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (3, 3) and (3,): what takes a surface's vertices to the frame of its body, whose object has a world matrix."""
        if not surface.is_scaled:
            return surface.linear, surface.offset
        attachment = self.attachments.get(surface.key)
        if attachment is None:
            linear, offset = transforms.decompose(matrix)[2], np.zeros(3)
        else:
            linear, offset = moved_bodies.to_body_frame(matrix, attachment)
        return linear * self.metres_per_unit, offset * self.metres_per_unit


def _deleted(name: str) -> SceneError:
    return SceneError(f"'{name}' was deleted while its forces were computed: undo that, or start again without it.")
