# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene becomes a :class:`Scenario`: the only place that reads meshes and poses out of Blender.

Who takes part: every object of the scene with a role that the view layer shows. Hidden and disabled objects are left out,
with a warning; instances of collections never take part.

Each object is a body of its own, unless it is part of its parent's (:mod:`.attached_objects`). A body's frame has the
location and rotation of its object; scale and shear go into the vertices. Keyframed bodies, and surfaces that deform, are
sampled at every frame.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from ...core.effects.engine.sensor_effects import check_scenario
from ...core.errors import SceneError
from ...core.geometry.mesh import TriangleMesh, checked_mesh, mass_properties
from ...core.geometry.texels import texels_from_region
from ...core.jobs.progress import Progress
from ...core.model.body import Body
from ...core.model.motion import Motion, Signal
from ...core.model.scenario import Scenario
from ...core.model.sensor import Sensor
from ...core.model.sensor_parameters import Painted
from ...core.model.target import Target
from ..properties import effect_stack
from ..properties.parameter_properties import sensor_parameters
from ..session import clock, identity, transforms, units
from . import attached_objects, deforming_objects, drives, meshes, moved_bodies, uv_layouts
from .mesh_snapshot import Seen

SAME_STRETCH = 1e-4
"""Largest relative change of an object's scale over time that is put down to rounding."""

Poses = dict[int, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Moment:
    """What a scene says at one frame, by body index.

    Attributes
    ----------
    poses : dict of int to (position (3,) m, quaternion (4,))
        Of keyframed bodies, and of driven ones without their drives.
    parents : dict of int to (4, 4) float
        What their parents do to free and driven bodies.
    targets : dict of int to float
        Of the drives.
    vertices, texels : dict of int to (n, 3) and (n, 9) float
        Shapes of targets and sensors that may deform, by target and sensor index (see :class:`.Deformation`).
    """

    poses: Poses
    parents: dict[int, np.ndarray]
    targets: dict[int, float]
    vertices: dict[int, np.ndarray]
    texels: dict[int, np.ndarray]

    @property
    def shapes(self) -> dict[tuple[str, int], np.ndarray]:
        """Both in one."""
        return {("target", i): found for i, found in self.vertices.items()} | {
            ("sensor", i): found for i, found in self.texels.items()
        }


@dataclass
class Binding:
    """Which body of a scenario is which object.

    Attributes
    ----------
    keys : tuple of str
        Of the objects (:mod:`.identity`), by body index.
    names : tuple of str
        For messages when one of them is gone.
    scale : float
        Metres per Blender unit.
    stretch : (b, 3, 3) float
        Of each object at the first frame (:mod:`.transforms`).
    starts : dict of int to (4, 4) float
        World matrices at the first frame of the bodies that forces move, by body index.
    parents : dict of int to list of (4, 4) float
        What their parents do to these bodies, frame by frame.
    driven : tuple of int
        Driven bodies.
    warnings : tuple of str
    sensor_keys : tuple of str
        Of the objects that hold the sensors and pads, by sensor index.
    parts : dict of str to (4, 4) float
        Where the parts of other bodies are in those bodies' objects, by key.
    skins : tuple of Skin
        Surfaces that may deform.
    looks : dict of str to list of str
        Fingerprints, frame by frame, of what those and other objects that become meshes look like; by name.
    seen : Seen
        Their surfaces as they were read last.
    placed : dict of int to (bytes, pose)
        Matrices as they were read last, and the poses that they are, by body index: most bodies rest most of the time.
    """

    keys: tuple[str, ...]
    names: tuple[str, ...]
    scale: float
    stretch: np.ndarray
    starts: dict[int, np.ndarray]
    parents: dict[int, list[np.ndarray]]
    driven: tuple[int, ...]
    warnings: tuple[str, ...]
    sensor_keys: tuple[str, ...]
    parts: dict[str, np.ndarray]
    skins: tuple[deforming_objects.Skin, ...]
    looks: dict[str, list[str]] = field(default_factory=dict)
    seen: Seen = field(default_factory=Seen)
    placed: dict[int, tuple] = field(default_factory=dict)

    def sensor_objects(self, scene) -> list:
        """Return the objects that hold the sensors and pads, by sensor index; None for one that was deleted."""
        found = identity.find(scene, self.sensor_keys)
        return [found.get(key) for key in self.sensor_keys]

    def objects(self, scene) -> list:
        """Return the objects by body index.

        Raises
        ------
        SceneError
            One of them was deleted or hidden from the scene.
        """
        found = identity.find(scene, self.keys)
        for key, name in zip(self.keys, self.names, strict=True):
            if key not in found:
                raise SceneError(f"'{name}' was deleted while its forces were computed: undo that, or start again without it.")
        return [found[key] for key in self.keys]

    def everyone(self, scene) -> list:
        """Return the objects by body index, and behind them the parts of their bodies, as far as they are there."""
        found = identity.find(scene, self.parts)
        return self.objects(scene) + [found[key] for key in self.parts if key in found]


def view_layer_of(scene):
    """Return the view layer that decides what takes part: the window's, else the scene's first."""
    import bpy

    context = bpy.context
    return context.view_layer if context.scene == scene and context.view_layer else scene.view_layers[0]


def depsgraph_of(scene):
    """Return the up-to-date dependency graph of a scene's present frame."""
    layer = view_layer_of(scene)
    layer.update()
    return layer.depsgraph


def participants(scene) -> tuple[list, list[str]]:
    """Return the objects that take part, in the scene's order, and a warning for each that would but is hidden."""
    layer = view_layer_of(scene)
    found, warnings = [], []
    for obj in scene.objects:
        if obj.palpate.role == "NONE" or obj.type not in meshes.KINDS:
            continue
        if obj.visible_get(view_layer=layer):
            found.append(obj)
        else:
            warnings.append(f"'{obj.name}' is hidden and takes no part.")
    return found, warnings


def sample_start(scene, depsgraph) -> tuple[Scenario, Binding]:
    """Read a scene at its first frame, where it has to stand.

    Returns
    -------
    scenario : Scenario
        Keyframed bodies have one sample of their motion.
    binding : Binding

    Raises
    ------
    PalpateError
        Something in the scene makes no run; the message names it.
    """
    objects, warnings = participants(scene)
    for obj in objects:
        identity.ensure(obj)
    carriers = attached_objects.carriers(objects)
    attached_objects.check(objects, carriers)
    settings, scale = scene.palpate, units.metres_per_unit(scene)
    bodies, stretches, starts, matrices, own = [], [], {}, [], []
    owners = [obj for obj in objects if carriers[obj] == obj]
    for index, obj in enumerate(owners):
        moved = obj.palpate.body in moved_bodies.MOVED
        if moved:
            moved_bodies.check(obj)
        elif obj.palpate.has_start:
            raise SceneError(f"'{obj.name}' is Keyframed, but its keyframes are those of a bake: use Clear Bake first.")
        matrix = moved_bodies.start_matrix(obj, depsgraph) if moved else _world(obj, depsgraph)
        position, quaternion, stretch = _split(obj, matrix)
        stretches.append(stretch)
        matrices.append(matrix)
        mesh, arrays_warnings = _mesh(obj, depsgraph, stretch * scale)
        own.append(mesh)
        warnings += arrays_warnings
        body = Body(obj.name, Motion.at_rest(position * scale, quaternion))
        if moved:
            starts[index] = matrix
            body, more = _moved(obj, body, mesh)
            warnings += more
        bodies.append(body)
    sensors, targets, sensor_objects, places, skins = [], [], [], {}, []
    for obj in objects:
        index = owners.index(carriers[obj])
        mesh, linear, offset = own[index], stretches[index], np.zeros(3)
        if carriers[obj] != obj:
            place = places[identity.key(obj)] = attached_objects.place(obj, carriers[obj], depsgraph)
            linear, offset = attached_objects.into_body(matrices[index], place)
            mesh, more = _mesh(obj, depsgraph, linear * scale, offset * scale)
            warnings += more
        if obj.palpate.role == "TARGET":
            targets.append(Target(obj.name, index, mesh, smooth=obj.palpate.contact_normals == "SMOOTH"))
            skins.append(
                deforming_objects.skin_of(obj, depsgraph, targets[-1], len(targets) - 1, mesh, linear * scale, offset * scale)
            )
        else:
            sensors.append(_sensor(obj, index, mesh))
            warnings += uv_layouts.notes(obj, sensors[-1].texels)
            sensor_objects.append(obj)
            skins.append(
                deforming_objects.skin_of(obj, depsgraph, sensors[-1], len(sensors) - 1, mesh, linear * scale, offset * scale)
            )
            if obj.palpate.presses:
                smooth = obj.palpate.contact_normals == "SMOOTH"
                targets.append(Target(obj.name, index, mesh, smooth=smooth, sensor=len(sensors) - 1))
                skins.append(
                    deforming_objects.skin_of(
                        obj, depsgraph, targets[-1], len(targets) - 1, mesh, linear * scale, offset * scale
                    )
                )
    driven = tuple(index for index in starts if owners[index].palpate.body == "DRIVEN")
    for index in driven:
        drive = drives.drive_of(owners[index], matrices[index], depsgraph)
        chosen = drives.leader(owners[index], owners)
        if chosen is None and drive.control == "force":
            drive = replace(drive, sensor=drives.sensor(owners[index], sensor_objects))
        bodies[index] = replace(bodies[index], drive=replace(drive, leader=chosen))
    scenario = Scenario(
        bodies=tuple(bodies),
        sensors=tuple(sensors),
        targets=tuple(targets),
        frame_start=scene.frame_start,
        frame_end=scene.frame_end,
        fps=units.frames_per_second(scene),
        gravity=units.gravity(scene),
        dt=None if settings.use_auto_dt else units.as_typed(settings.dt),
        name=scene.name,
        interpolation=settings.interpolation.lower(),
    )
    skins = tuple(skin for skin in skins if skin is not None)
    sensors, targets = deforming_objects.declared(scenario, skins)
    scenario = replace(scenario, sensors=sensors, targets=targets)
    check_scenario(scenario)
    binding = Binding(
        keys=tuple(identity.key(obj) for obj in owners),
        names=tuple(obj.name for obj in owners),
        scale=scale,
        stretch=np.array(stretches),
        starts=starts,
        parents={index: [moved_bodies.parent_matrix(owners[index], depsgraph)] for index in starts},
        warnings=tuple(warnings),
        driven=driven,
        sensor_keys=tuple(identity.key(obj) for obj in sensor_objects),
        parts=places,
        skins=skins,
    )
    return scenario, binding


def sample_moment(scene, depsgraph, binding: Binding) -> Moment:
    """Read what a scene says at its present frame."""
    poses, parents, targets, matrices = {}, {}, {}, {}
    may_change = {skin.body for skin in binding.skins}
    for index, obj in enumerate(binding.objects(scene)):
        if index in binding.starts:
            matrices[index] = binding.starts[index]
            parents[index] = moved_bodies.parent_matrix(obj, depsgraph)
            if index not in binding.driven:
                continue
            targets[index] = drives.target(obj, depsgraph)
            matrix = drives.carried(binding.starts[index], binding.parents[index][0], parents[index])
        else:
            matrix = _world(obj, depsgraph)
        if index not in binding.starts:
            matrices[index] = matrix
        before, poses[index] = binding.placed.get(index, (b"", None))
        if matrix.tobytes() != before:
            rigid = index not in may_change or not deforming_objects.has_animated_scale(obj)
            poses[index] = _pose(scene, obj, matrix, binding.scale, binding.stretch[index] if rigid else None)
            binding.placed[index] = matrix.tobytes(), poses[index]
    if binding.parts:
        attached_objects.check_places(scene, depsgraph, binding.parts)
    return Moment(poses, parents, targets, *_shapes(scene, depsgraph, binding, matrices))


def _pose(scene, obj, matrix: np.ndarray, scale: float, stretch: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the pose of an object's body, whose stretch has to be as it was where it is given."""
    position, quaternion, found = _split(obj, matrix)
    if stretch is not None and np.abs(found - stretch).max() > SAME_STRETCH * np.abs(stretch).max():
        raise SceneError(
            f"The scale of '{obj.name}' changes (frame {scene.frame_current}) without keyframes or drivers of its own or a "
            "parent: give it some, or keep the scale constant."
        )
    return position * scale, quaternion


def _shapes(scene, depsgraph, binding: Binding, matrices: dict[int, np.ndarray]) -> tuple[dict, dict]:
    """Read what may deform: vertices by target index, frames of texels by sensor index."""
    vertices, texels = {}, {}
    binding.seen.begin()
    objects = identity.find(scene, {skin.key for skin in binding.skins})
    for skin in binding.skins:
        if skin.key not in objects:
            raise SceneError(f"'{skin.name}' was deleted while its forces were computed: undo that, or start again without it.")
        linear, offset, matrix = skin.linear, skin.offset, matrices[skin.body]
        if skin.scaled:
            place = binding.parts.get(skin.key)
            linear, offset = (
                (transforms.split(matrix)[2], np.zeros(3)) if place is None else attached_objects.into_body(matrix, place)
            )
            linear, offset = linear * binding.scale, offset * binding.scale
        found = vertices if skin.follower is None else texels
        found[skin.index] = skin.at(binding.seen.of(objects[skin.key], depsgraph), scene.frame_current, linear, offset)
    return vertices, texels


def sample_scenario(scene) -> Generator[Progress, None, tuple[Scenario, Binding]]:
    """Read a scene over its whole frame range, frame by frame, and leave it at the frame where it stood."""
    before = scene.frame_current, scene.frame_subframe
    try:
        with clock.unstretched(scene):
            return (yield from _sample_scenario(scene))
    finally:
        with suppress(ReferenceError):  # the scene went while its frames were read
            scene.frame_set(before[0], subframe=before[1])


def _sample_scenario(scene) -> Generator[Progress, None, tuple[Scenario, Binding]]:
    _check_range(scene)
    _check_modes(participants(scene)[0])
    parts_of_frame = scene.palpate.subframes
    frames = range(scene.frame_start, scene.frame_end + 1)
    scene.frame_set(frames[0])
    scenario, binding = sample_start(scene, depsgraph_of(scene))
    watched = _watched(scene, binding)
    _look(scene, watched, binding)
    motions = {index: body.motion for index, body in enumerate(scenario.bodies) if not body.free}
    samples = {index: [(motion.positions[0], motion.quaternions[0])] for index, motion in motions.items()}
    targets = {index: list(scenario.bodies[index].drive.target.values) for index in binding.driven}
    shapes = deforming_objects.Shapes(scenario)
    yield Progress("Reading", 1, len(frames), frames[0])
    for frame in frames[1:]:
        for part in range(1, parts_of_frame + 1):
            whole, rest = _whole_and_part(frame - 1, part, parts_of_frame)
            scene.frame_set(whole, subframe=rest)
            moment = sample_moment(scene, depsgraph_of(scene), binding)
            for index, pose in moment.poses.items():
                samples[index].append(pose)
            for index, value in moment.targets.items():
                targets[index].append(value)
            shapes.append(moment.shapes)
        for index, matrix in moment.parents.items():
            binding.parents[index].append(matrix)
        _look(scene, watched, binding)
        yield Progress("Reading", frame - frames[0] + 1, len(frames), frame)
    times = np.array([step / (scenario.fps * parts_of_frame) for step in range((len(frames) - 1) * parts_of_frame + 1)])
    bodies = list(scenario.bodies)
    for index, path in samples.items():
        positions, quaternions = (np.array(part) for part in zip(*path, strict=True))
        bodies[index] = replace(bodies[index], motion=Motion(times, positions, quaternions))
    for index, values in targets.items():
        drive = replace(bodies[index].drive, target=Signal(times, np.array(values)))
        bodies[index] = replace(bodies[index], drive=drive)
    sensors, targets = shapes.finished(scenario, times)
    scenario = replace(scenario, bodies=tuple(bodies), sensors=sensors, targets=targets)
    return scenario, replace(binding, warnings=binding.warnings + _unchanged_masses(scenario))


def _watched(scene, binding: Binding) -> list:
    """Return the objects whose evaluated mesh tells more than their own data: those that may deform, curves, texts."""
    bending = {skin.name for skin in binding.skins}
    return [obj for obj in participants(scene)[0] if obj.name in bending or obj.type != "MESH"]


def _look(scene, watched, binding: Binding) -> None:
    depsgraph = depsgraph_of(scene)
    for obj in watched:
        binding.looks.setdefault(obj.name, []).append(binding.seen.look(obj, depsgraph))


def _unchanged_masses(scenario: Scenario) -> tuple[str, ...]:
    """Say of which bodies that forces move the shape changes and the mass properties do not."""
    return tuple(
        f"'{target.name}' deforms while forces move it: its mass, centre and inertia stay those of the first frame."
        for target in scenario.targets
        if target.deformation is not None and scenario.bodies[target.body].name == target.name
        if scenario.bodies[target.body].moved_by_forces
    )


def _whole_and_part(frame: int, part: int, parts_of_frame: int) -> tuple[int, float]:
    return (frame + 1, 0.0) if part == parts_of_frame else (frame, part / parts_of_frame)


def pose(scene, obj, depsgraph) -> np.ndarray:
    """(7,) float: position (m) and quaternion of an object's body frame at the present frame."""
    position, quaternion, _ = _split(obj, _world(obj, depsgraph))
    return np.concatenate([position * units.metres_per_unit(scene), quaternion])


def _check_range(scene) -> None:
    if scene.frame_end < scene.frame_start:
        raise SceneError(
            f"The frame range of '{scene.name}' runs backwards ({scene.frame_start} to {scene.frame_end}): "
            "set the end frame after the start frame."
        )


def _check_modes(objects) -> None:
    """Refuse meshes that are being edited: what a bake writes on them would be lost when the edit ends."""
    for obj in objects:
        if obj.mode == "EDIT":
            raise SceneError(f"'{obj.name}' is in Edit Mode: leave it (Tab) before you bake.")


def _world(obj, depsgraph) -> np.ndarray:
    return transforms.array(obj.evaluated_get(depsgraph).matrix_world)


def _split(obj, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if not np.isfinite(matrix).all():
        raise SceneError(f"'{obj.name}' has a NaN or infinite location, rotation or scale: check its drivers and constraints.")
    if transforms.is_singular(matrix):
        raise SceneError(f"The scale of '{obj.name}' is zero in at least one direction: give it a scale, it has no volume.")
    return transforms.split(matrix)


def _mesh(obj, depsgraph, stretch: np.ndarray, offset: np.ndarray | float = 0.0) -> tuple[TriangleMesh, list[str]]:
    """Return an object's mesh in its body's frame, metres: its vertices times `stretch` (3, 3), then moved by `offset` (3,)."""
    if obj.palpate.role == "TARGET":
        arrays, warnings = meshes.target_arrays(obj, depsgraph), []
    else:
        arrays, warnings = meshes.sensor_arrays(obj, depsgraph)
    triangles, quads = arrays.triangles, arrays.quads
    if np.linalg.det(stretch) < 0:
        triangles, quads = triangles[:, ::-1], quads[:, ::-1]
        warnings.append(f"The scale of '{obj.name}' mirrors it: its faces were turned so that they still point outwards.")
    mesh, more = checked_mesh(arrays.vertices @ stretch.T + offset, triangles, obj.name, quads)
    return mesh, warnings + more


def _moved(obj, body: Body, mesh: TriangleMesh) -> tuple[Body, list[str]]:
    """Return a body with its mass; a free one also with the velocity that it starts with."""
    settings = obj.palpate
    mass = units.as_typed(settings.mass)
    center, inertia, warnings = mass_properties(mesh, mass, obj.name)
    body = replace(body, mass=mass, center_of_mass=center, inertia=inertia)
    if settings.body == "DRIVEN":
        return body, warnings
    return replace(
        body,
        free=True,
        velocity=np.array([units.as_typed(value) for value in settings.velocity]),
        angular_velocity=np.array([units.as_typed(value) for value in settings.angular_velocity]),
    ), warnings


def sensor_alone(scene, obj, depsgraph) -> tuple[Sensor, TriangleMesh]:
    """Return a sensor in the frame of its own object, and its mesh.

    Raises
    ------
    PalpateError
        Its mesh or region makes no sensor.
    """
    _, _, stretch = _split(obj, _world(obj, depsgraph))
    mesh, _ = _mesh(obj, depsgraph, stretch * units.metres_per_unit(scene))
    return _sensor(obj, 0, mesh), mesh


def _sensor(obj, body: int, mesh: TriangleMesh) -> Sensor:
    found = sensor_parameters(obj.palpate)
    found.check(obj.name)
    texels = texels_from_region(mesh, meshes.region(obj, len(mesh.vertices)), obj.name)
    if obj.palpate.role == "SENSOR":
        texels = uv_layouts.laid_out(obj, texels)
    readout, painted = obj.palpate.role == "SENSOR", _painted(obj, texels.vertex)
    return Sensor(obj.name, body, texels, found, readout=readout, painted=painted, effects=effect_stack.stack(obj))


def _painted(obj, vertex: np.ndarray) -> Painted:
    """Return what is painted at the vertices that the texels stand on."""
    maps = {key: meshes.multipliers(obj, key) for key in meshes.PAINTED}
    return Painted(**{key: None if values is None else values[vertex] for key, values in maps.items()})
