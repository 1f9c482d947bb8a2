# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene becomes a :class:`.Scenario`: the only way by which meshes and poses leave Blender.

Each participant is a body, unless it is part of its parent's body (:mod:`.moved_bodies`). A body's frame has the
location and rotation of its object; scale and shear are applied to the vertices. Keyframed bodies, and surfaces that deform,
are sampled at every frame.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import bpy
import numpy as np

from ...core.effects.engine.registry import check_scenario
from ...core.errors import SceneError
from ...core.geometry.mesh import TriangleMesh, mass_properties
from ...core.io.row_tables import motion_table
from ...core.jobs import Progress
from ...core.model.body import Body, Motion, Signal
from ...core.model.recording import row_blocks
from ...core.model.scenario import Scenario, Target
from ...core.model.sensor import Sensor
from ..properties import object_properties
from ..session import fcurves, identity, session_state, transforms
from . import deforming_objects, moved_bodies, participants, scene_fingerprint, sensor_reader, stored_names, uv_layouts
from .moved_bodies import TARGET_PROPERTIES
from .scene_reading import FrameSample, SceneReading

FLOAT32_ROUNDING = 2.0**-24
"""Largest relative rounding of Blender's numbers."""
FLAT = 2.0**-23
"""Blender units. Where both keyframes of a Bézier curve and their handles differ by less, Blender takes the curve for constant
(FLT_EPSILON in its `fcurve_eval_keyframes_interpolate`) and jumps at the second keyframe."""
ROUNDING_SHARE = 0.001
"""Share of the thinnest skin's depth by which positions may be off without a warning. A ball that presses 2 mm deep into a skin
of 12 mm has this share 200 m from the origin; from 100 m to 1 km the largest error of its force grows from 0.6 % to 8 %."""
_LENGTHS = ("location", "delta_location", f"palpate.{TARGET_PROPERTIES['POSITION']}")
"""Properties in Blender units or metres."""


def distance_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Return a warning for the body that is so far from the origin that rounding changes forces."""
    skin = _thinnest_skin(scenario)
    distances = {}
    for body in scenario.bodies:
        blocks = (body.motion.positions[rows] for rows in row_blocks(body.motion.positions))
        distances[body.name] = max(float(np.linalg.norm(places, axis=1).max()) for places in blocks)
    for target in scenario.targets:
        name = scenario.bodies[target.body].name
        distances[name] += float(np.linalg.norm(target.mesh.vertices, axis=1).max())
    name = max(distances, key=lambda body: distances[body])
    rounding = distances[name] * FLOAT32_ROUNDING
    if rounding < ROUNDING_SHARE * skin:
        return ()
    return (
        f"'{name}' is {distances[name] * 1e-3:.3g} km from the origin, where Blender rounds positions to "
        f"{rounding * 1e3:.2g} mm and a skin is {skin * 1e3:.3g} mm deep: move the scene to the origin, "
        "or its forces are inexact.",
    )


def keyframe_warnings(objects, scenario: Scenario, metres_per_unit: float) -> tuple[str, ...]:
    """Return a warning for each object that Blender holds still between keyframes that are too near to each other.

    Parameters
    ----------
    objects : iterable of Object
        The participants; what they depend on is looked at too.
    scenario : Scenario
    metres_per_unit : float
    """
    least = ROUNDING_SHARE * _thinnest_skin(scenario)
    if FLAT * max(metres_per_unit, 1.0) < least:
        return ()
    found = []
    for block in scene_fingerprint.related_data_blocks(objects):
        if isinstance(block, bpy.types.Object) and block.animation_data is not None:
            for curve in fcurves.of_object(block) or ():
                metres = 1.0 if curve.data_path.startswith("palpate.") else metres_per_unit
                if curve.data_path in _LENGTHS and _largest_flat_difference(curve) * metres >= least:
                    found.append(block.name)
                    break
    return tuple(
        f"Blender holds '{name}' still between keyframes that differ by less than {FLAT:.2g} units, and then it jumps: "
        "set a smaller Unit Scale and enlarge the scene in units, or make these keyframes linear."
        for name in found
    )


def _largest_flat_difference(curve) -> float:
    """Return by how many units an F-curve jumps at most where Blender takes it for constant between two keyframes."""
    points, largest = curve.keyframe_points, 0.0
    for k in range(len(points) - 1):
        before, after = points[k], points[k + 1]
        values = before.co[1], before.handle_right[1], after.handle_left[1], after.co[1]
        if before.interpolation == "BEZIER" and max(values) - min(values) < FLAT:
            largest = max(largest, abs(after.co[1] - before.co[1]))
    return largest


def _thinnest_skin(scenario: Scenario) -> float:
    """Return the smallest maximum penetration of a scenario's sensors, metres."""
    return min(sensor.parameters.max_penetration for sensor in scenario.sensors)


def read_scene(scene) -> Generator[Progress, None, SceneReading]:
    """Read a scene over its whole frame range, frame by frame, and return it to the frame where it stood.

    The timeline does not simulate meanwhile, and what a bake shows in the scene is hidden.

    Raises
    ------
    PalpateError
        Something in the scene makes no run; the message names it.
    """
    with (
        session_state.suspended(),
        stored_names.hidden_display(scene),
        fcurves.frame_kept(scene),
        fcurves.without_time_stretching(scene),
    ):
        return (yield from _read_frames(scene))


def read_start(scene, depsgraph) -> SceneReading:
    """Read a scene at its first frame, where it has to stand.

    Returns
    -------
    SceneReading
        Keyframed bodies have one sample of their motion.

    Raises
    ------
    PalpateError
        Something in the scene makes no run; the message names it.
    """
    return _StartReader(scene, depsgraph).read()


class _StartReader:
    """Reads a scene at its first frame: first the bodies, then sensors and targets, then the drives."""

    def __init__(self, scene, depsgraph):
        self.scene, self.depsgraph = scene, depsgraph
        self.metres_per_unit = transforms.metres_per_unit(scene)
        self.objects, self.warnings = participants.find_participants(scene)
        for obj in self.objects:
            identity.ensure_uid(obj)
        self.body_objects = {obj: moved_bodies.body_object(obj, set(self.objects)) for obj in self.objects}
        moved_bodies.check_parents(self.objects, self.body_objects)
        self.owners = [obj for obj in self.objects if self.body_objects[obj] == obj]
        # By body index: body, mesh in the body's frame, world matrix and stretch of the object.
        self.bodies: list[Body] = []
        self.meshes: list[TriangleMesh] = []
        self.matrices: list[np.ndarray] = []
        self.stretches: list[np.ndarray] = []
        self.start_matrices: dict[int, np.ndarray] = {}
        self.sensors: list[Sensor] = []
        self.targets: list[Target] = []
        self.sensor_objects: list = []
        self.attachments: dict[str, np.ndarray] = {}
        self.surfaces: list[deforming_objects.DeformingSurface] = []

    def read(self) -> SceneReading:
        """Read everything."""
        for index, obj in enumerate(self.owners):
            self._read_body(index, obj)
        for obj in self.objects:
            self._read_surface(obj)
        for index in self.start_matrices:
            if self.owners[index].palpate.body == "DRIVEN":
                self._read_drive(index)
        return SceneReading(
            scenario=self._scenario(),
            object_keys=tuple(identity.key(obj) for obj in self.owners),
            object_names=tuple(obj.name for obj in self.owners),
            sensor_keys=tuple(identity.key(obj) for obj in self.sensor_objects),
            metres_per_unit=self.metres_per_unit,
            stretches=np.array(self.stretches),
            start_matrices=self.start_matrices,
            parent_matrices={
                index: [moved_bodies.parent_matrix(self.owners[index], self.depsgraph)] for index in self.start_matrices
            },
            warnings=tuple(self.warnings),
            attachments=self.attachments,
            surfaces=tuple(self.surfaces),
        )

    def _read_body(self, index: int, obj) -> None:
        """Read the pose and mesh of an object that is a body; mass and start of one that forces move."""
        is_moved = obj.palpate.body in object_properties.MOVED_BY_FORCES
        if is_moved:
            moved_bodies.check_movable(obj)
            matrix = self.start_matrices[index] = moved_bodies.start_matrix(obj, self.depsgraph)
        elif obj.palpate.has_start:
            raise SceneError(f"'{obj.name}' is Keyframed, but its keyframes are those of a bake: use Clear Bake first.")
        else:
            matrix = moved_bodies.world_matrix(obj, self.depsgraph)
        position, quaternion, stretch = moved_bodies.decompose(obj, matrix)
        mesh = self._mesh(obj, stretch * self.metres_per_unit)
        body = Body(obj.name, Motion.at_rest(position * self.metres_per_unit, quaternion))
        if is_moved:
            body, warnings = _with_mass(obj, body, mesh)
            self.warnings += warnings
        self.bodies.append(body)
        self.meshes.append(mesh)
        self.matrices.append(matrix)
        self.stretches.append(stretch)

    def _mesh(self, obj, linear: np.ndarray, offset: np.ndarray | float = 0.0) -> TriangleMesh:
        mesh, warnings = sensor_reader.mesh_in_body_frame(obj, self.depsgraph, linear, offset)
        self.warnings += warnings
        return mesh

    def _read_surface(self, obj) -> None:
        """Read the sensor, the target, or both, that an object is."""
        body_object = self.body_objects[obj]
        index = self.owners.index(body_object)
        mesh, linear, offset = self.meshes[index], self.stretches[index], np.zeros(3)
        if body_object != obj:
            attachment = moved_bodies.matrix_on_body(obj, body_object, self.depsgraph)
            self.attachments[identity.key(obj)] = attachment
            linear, offset = moved_bodies.to_body_frame(self.matrices[index], attachment)
            mesh = self._mesh(obj, linear * self.metres_per_unit, offset * self.metres_per_unit)
        to_body = linear * self.metres_per_unit, offset * self.metres_per_unit
        is_smooth = obj.palpate.contact_normals == "SMOOTH"
        if obj.palpate.role == "TARGET":
            self._add(self.targets, Target(obj.name, index, mesh, smooth=is_smooth), obj, mesh, to_body)
            return
        sensor = sensor_reader.read_sensor(obj, index, mesh, linear)
        sensor = sensor_reader.with_channels(obj, sensor, to_body, self.depsgraph)
        self.warnings += uv_layouts.layout_warnings(obj, sensor.texels)
        self.sensor_objects.append(obj)
        self._add(self.sensors, sensor, obj, mesh, to_body)
        if obj.palpate.presses:
            target = Target(obj.name, index, mesh, smooth=is_smooth, sensor=len(self.sensors) - 1)
            self._add(self.targets, target, obj, mesh, to_body)

    def _add(self, group: list, part: Sensor | Target, obj, mesh: TriangleMesh, to_body: tuple) -> None:
        """Add a sensor or target to its group, and its surface if it may deform."""
        group.append(part)
        surface = deforming_objects.deforming_surface_of(obj, self.depsgraph, part, len(group) - 1, mesh, *to_body)
        if surface is not None:
            self.surfaces.append(surface)

    def _read_drive(self, index: int) -> None:
        """Give a driven body its drive."""
        obj = self.owners[index]
        drive = moved_bodies.drive_of(obj, self.matrices[index], self.depsgraph)
        leader = moved_bodies.leader_index(obj, self.owners)
        if leader is None and drive.control == "force":
            drive = replace(drive, sensor=moved_bodies.controlled_sensor(obj, self.sensor_objects))
        self.bodies[index] = replace(self.bodies[index], drive=replace(drive, leader=leader))

    def _scenario(self) -> Scenario:
        scene, settings = self.scene, self.scene.palpate
        scenario = Scenario(
            bodies=tuple(self.bodies),
            sensors=tuple(self.sensors),
            targets=tuple(self.targets),
            frame_start=scene.frame_start,
            frame_end=scene.frame_end,
            fps=transforms.frames_per_second(scene),
            gravity=transforms.gravity(scene),
            dt=None if settings.use_auto_dt else transforms.as_typed(settings.dt),
            name=scene.name,
            interpolation=settings.interpolation.lower(),
        )
        sensors, targets = deforming_objects.with_first_shapes(scenario, self.surfaces)
        scenario = replace(scenario, sensors=sensors, targets=targets)
        try:
            check_scenario(scenario)
        except SceneError as error:  # perhaps what is missing is there, and hidden
            raise SceneError(f"{participants.why_left_out(scene)} {error}".strip()) from error
        return scenario


def _with_mass(obj, body: Body, mesh: TriangleMesh) -> tuple[Body, list[str]]:
    """Return a body with its mass properties, and warnings; a free body also gets its initial velocity."""
    settings = obj.palpate
    mass = transforms.as_typed(settings.mass)
    center, inertia, warnings = mass_properties(mesh, mass, obj.name)
    body = replace(body, mass=mass, center_of_mass=center, inertia=inertia)
    if settings.body == "DRIVEN":
        return body, warnings
    return replace(
        body,
        free=True,
        velocity=np.array([transforms.as_typed(value) for value in settings.velocity]),
        angular_velocity=np.array([transforms.as_typed(value) for value in settings.angular_velocity]),
    ), warnings


class _MotionHistory:
    """Poses, drive targets and shapes of a scene, sample after sample."""

    def __init__(self, reading: SceneReading):
        bodies = reading.scenario.bodies
        self._poses = {
            i: (motion_table(b.motion.positions[0]), motion_table(b.motion.quaternions[0]))
            for i, b in enumerate(bodies)
            if not b.free
        }
        self._drive_targets = {i: motion_table(b.drive.target.values[0]) for i, b in enumerate(bodies) if b.drive is not None}
        self._shapes = deforming_objects.ShapeHistory(reading.scenario)

    def append(self, sample: FrameSample) -> None:
        """Add one sample."""
        for index, pose in sample.poses.items():
            for table, part in zip(self._poses[index], pose, strict=True):
                table.append(part)
        for index, value in sample.drive_targets.items():
            self._drive_targets[index].append(value)
        self._shapes.append(sample.shapes)

    def applied_to(self, scenario: Scenario, times: np.ndarray) -> Scenario:
        """Return the scenario with the whole motion; `times` (n,) float, seconds, are those of the samples."""
        bodies = list(scenario.bodies)
        for index, (positions, quaternions) in self._poses.items():
            motion = Motion(times, positions.rows(), quaternions.rows())
            bodies[index] = replace(bodies[index], motion=motion)
        for index, values in self._drive_targets.items():
            drive = replace(bodies[index].drive, target=Signal(times, values.rows()))
            bodies[index] = replace(bodies[index], drive=drive)
        sensors, targets = self._shapes.applied_to(scenario, times)
        return replace(scenario, bodies=tuple(bodies), sensors=sensors, targets=targets)


def _read_frames(scene) -> Generator[Progress, None, SceneReading]:
    """Read the first frame, then sample the others."""
    _check_frame_range(scene)
    for obj in participants.find_participants(scene)[0]:
        if obj.mode == "EDIT":  # what a bake writes on its mesh would be lost when the edit ends
            raise SceneError(f"'{obj.name}' is in Edit Mode: leave it (Tab) before you bake.")
    samples_per_frame = scene.palpate.subframes
    frames = range(scene.frame_start, scene.frame_end + 1)
    scene.frame_set(frames[0])
    depsgraph = participants.depsgraph_of(scene)
    reading = read_start(scene, depsgraph)
    deforming = {surface.name for surface in reading.surfaces}  # only these, curves and texts may differ from their own mesh
    watched = [obj for obj in participants.find_participants(scene)[0] if obj.name in deforming or obj.type != "MESH"]
    reading.record_fingerprints(watched, depsgraph)
    history = _MotionHistory(reading)
    yield Progress("Reading", 1, len(frames), frames[0])
    for frame in frames[1:]:
        for number in range(1, samples_per_frame + 1):
            is_whole = number == samples_per_frame
            scene.frame_set(frame if is_whole else frame - 1, subframe=0.0 if is_whole else number / samples_per_frame)
            depsgraph = participants.depsgraph_of(scene)
            sample = reading.sample(scene, depsgraph)
            history.append(sample)
        for index, matrix in sample.parent_matrices.items():
            before = reading.parent_matrices[index][-1]
            reading.parent_matrices[index].append(before if np.array_equal(before, matrix) else matrix)
        reading.record_fingerprints(watched, depsgraph)
        yield Progress("Reading", frame - frames[0] + 1, len(frames), frame)
    samples = (len(frames) - 1) * samples_per_frame + 1
    times = np.arange(samples) / (reading.scenario.fps * samples_per_frame)
    scenario = history.applied_to(reading.scenario, times)
    warnings = _mass_warnings(scenario) + distance_warnings(scenario)
    warnings += keyframe_warnings(participants.find_participants(scene)[0], scenario, reading.metres_per_unit)
    return replace(reading, scenario=scenario, warnings=reading.warnings + warnings)


def _mass_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Return a warning for each body that forces move and whose shape changes: its mass properties stay constant."""
    return tuple(
        f"'{target.name}' deforms while forces move it: its mass, centre and inertia stay those of the first frame."
        for target in scenario.targets
        if target.deformation is not None and scenario.bodies[target.body].name == target.name
        if scenario.bodies[target.body].moved_by_forces
    )


def _check_frame_range(scene) -> None:
    if scene.frame_end < scene.frame_start:
        raise SceneError(
            f"The frame range of '{scene.name}' runs backwards ({scene.frame_start} to {scene.frame_end}): "
            "set the end frame after the start frame."
        )
