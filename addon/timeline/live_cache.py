# SPDX-License-Identifier: GPL-3.0-or-later
"""Live runs: what playing the timeline has computed so far. One run per scene, in memory only.

A run gives the same numbers as a bake, frame by frame. It starts at the first frame and advances one frame at a time. It is
dropped when anything from which it was computed has changed: settings (compared at every frame), geometry (compared when
Blender reports a change), or the motion of keyframed bodies (poses are compared at every frame that is shown again).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from ...core.errors import PalpateError
from ...core.figures.quantities import Extent, Quantity
from ...core.model.recording import Frame
from ...core.model.scenario import Scenario
from ..properties import object_properties
from ..scene import mesh_arrays, moved_bodies, participants, scene_fingerprint, scene_reader, scene_reading
from ..session import fcurves, first_use, session_state


@dataclass
class LiveRun:
    """A simulation that follows the timeline.

    Attributes
    ----------
    reading : SceneReading
        The scene at its first frame.
    simulation : Simulation
        It stands at the last frame computed.
    placements : dict of int to BodyPlacement
        Of the bodies that forces move, by body index.
    settings : tuple
        :func:`.scene_fingerprint.settings_of` when the run started.
    mesh_fingerprints : dict of str to str
        By name of each participant.
    frames : dict of int to Frame
        What was computed.
    samples : dict of int to FrameSample
        What was read of the scene at those frames.
    loads : dict of int to dict of str to float, N
        Sum of the normal forces at those frames, by sensor.
    largest_net_force : float, N
        On a sensor in those frames; a billionth without any contact.
    placed_channels : dict of int to (14,) float
        Channels that bodies were last given, by body index.
    """

    reading: scene_reading.SceneReading
    simulation: object
    placements: dict[int, moved_bodies.BodyPlacement]
    settings: tuple
    mesh_fingerprints: dict[str, str]
    frames: dict[int, Frame] = field(default_factory=dict)
    samples: dict[int, scene_reading.FrameSample] = field(default_factory=dict)
    loads: dict[int, dict[str, float]] = field(default_factory=dict)
    largest_net_force: float = 1e-9
    placed_channels: dict[int, np.ndarray] = field(default_factory=dict)
    _extents: dict[str, tuple[int, Extent]] = field(default_factory=dict)

    @property
    def scenario(self) -> Scenario:
        """The scenario that is simulated."""
        return self.reading.scenario

    def add(self, number: int, frame: Frame) -> None:
        """Add a frame that was computed."""
        self.frames[number] = frame
        self.loads[number] = {name: float(readings.normal_force.sum()) for name, readings in frame.sensors.items()}
        forces = (float(np.linalg.norm(readings.net_force)) for readings in frame.sensors.values())
        self.largest_net_force = max((self.largest_net_force, *forces))

    def extent(self, quantity: Quantity) -> Extent:
        """Return the extent of a quantity in the frames that were computed."""
        count, known = self._extents.get(quantity.name, (0, None))
        texels = {sensor.name: sensor.texels for sensor in self.scenario.read_out}
        frames = list(self.frames.values())
        new = ((frame.sensors[name], own) for frame in frames[count:] for name, own in texels.items())
        found = Extent.of(quantity, ((felt, own) for felt, own in new if quantity.is_in(felt)), known)
        self._extents[quantity.name] = len(frames), found
        return found


_runs: dict[int, LiveRun] = {}


def get(scene) -> LiveRun | None:
    """Return the run of a scene."""
    return _runs.get(scene.session_uid)


def drop(scene=None) -> None:
    """Forget the run of a scene, or all runs."""
    session_state.forget(_runs, scene)


def start(scene, depsgraph) -> LiveRun | None:
    """Start a run, or return None if it has to wait for the solver. Blender must have evaluated the first frame.

    Raises
    ------
    PalpateError
        The scene makes no run.
    """
    drop(scene)
    reading = scene_reader.read_start(scene, depsgraph)
    if not first_use.can_compute(reading.scenario):
        return None
    objects, everyone = reading.objects(scene), reading.all_objects(scene)
    placements = {
        index: moved_bodies.BodyPlacement.of(objects[index], matrix, reading.parent_matrices[index][0], reading.metres_per_unit)
        for index, matrix in reading.start_matrices.items()
    }
    run = LiveRun(
        reading=reading,
        simulation=first_use.load_solver().Simulation(reading.scenario),
        placements=placements,
        settings=scene_fingerprint.settings_of(scene, everyone),
        mesh_fingerprints={obj.name: mesh_arrays.evaluated_fingerprint(obj, depsgraph) for obj in everyone},
    )
    first = reading.scenario.frame_start
    run.add(first, run.simulation.observe())
    run.samples[first] = reading.sample(scene, depsgraph)
    session_state.session.changed_geometry.difference_update(run.mesh_fingerprints)
    session_state.session.changed_motion.clear()
    _runs[scene.session_uid] = run
    return run


def advance(scene, depsgraph, run: LiveRun) -> LiveRun:
    """Compute the frame at which the scene stands, which must be the frame after the last computed one."""
    frame, _ = fcurves.current_frame(scene)
    sample = run.samples[frame] = run.reading.sample(scene, depsgraph)
    if (parts := scene.palpate.subframes) > 1:  # read the scene between the last frame and this one, as a bake does
        with at_other_frames(scene):
            for part in range(1, parts):
                scene.frame_set(frame - 1, subframe=part / parts)
                between = run.reading.sample(scene, participants.depsgraph_of(scene))
                _extend(run, between, share=part / parts)
    _extend(run, sample)
    run.add(frame, run.simulation.advance())
    return run


def _extend(run: LiveRun, sample: scene_reading.FrameSample, **share) -> None:
    """Tell the simulation how animation goes on, up to the next frame or to a `share` of the way to it."""
    shapes: dict[str, dict] = {"target": {}, "sensor": {}}
    for (kind, index), found in sample.shapes.items():
        shapes[kind][index] = found
    run.simulation.extend(sample.poses, sample.drive_targets, shapes["target"], shapes["sensor"], **share)


@contextmanager
def at_other_frames(scene) -> Iterator[None]:
    """Let the scene stand at other frames without showing them, and return to the present one."""
    with session_state.suspended(), fcurves.frame_kept(scene), fcurves.without_time_stretching(scene):
        yield


def is_stale(scene, depsgraph, run: LiveRun) -> bool:
    """Return True when something from which a run was computed has changed."""
    try:
        objects = run.reading.objects(scene)
    except PalpateError:
        return True
    everyone = {obj.name: obj for obj in run.reading.all_objects(scene)}
    if scene_fingerprint.settings_of(scene, everyone.values()) != run.settings:
        return True
    names = {obj.name: index for index, obj in enumerate(objects)}
    moved_by_user = session_state.session.changed_motion & names.keys()
    if any(names[name] not in run.reading.start_matrices for name in moved_by_user):
        return True
    if _has_new_start(scene, run, objects):
        return True
    touched = session_state.session.changed_geometry & everyone.keys()
    session_state.session.changed_geometry -= touched
    deforming = {surface.name for surface in run.reading.surfaces}
    if any(
        mesh_arrays.evaluated_fingerprint(everyone[name], depsgraph) != run.mesh_fingerprints[name]
        for name in touched - deforming
    ):
        return True
    # What deforms has another shape at every frame: it is compared with its shape at this frame, if that is known.
    if not touched & deforming:
        return False
    return fcurves.current_frame(scene)[0] not in run.samples or has_moved(scene, depsgraph, run)


def _has_new_start(scene, run: LiveRun, objects: list) -> bool:
    """Return True when the user has moved a free or driven body while it stood at the first frame."""
    placed = run.placed_channels
    is_moved = any(not np.array_equal(object_properties.transform_channels(objects[i]), put) for i, put in placed.items())
    stand_at_start = all(not objects[index].palpate.has_start for index in placed)
    return is_moved and stand_at_start and scene.frame_start in run.frames


def has_moved(scene, depsgraph, run: LiveRun) -> bool:
    """Return True when animation gives other poses, shapes or drive targets now than when the present frame was computed."""
    before = run.samples[fcurves.current_frame(scene)[0]]
    try:
        now = run.reading.sample(scene, depsgraph)
    except PalpateError:
        return True
    return (
        any(not np.array_equal(now.poses[i][part], before.poses[i][part]) for i in before.poses for part in (0, 1))
        or any(not np.array_equal(found, before.shapes[place]) for place, found in now.shapes.items())
        or now.drive_targets != before.drive_targets
    )
