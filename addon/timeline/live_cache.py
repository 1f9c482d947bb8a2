# SPDX-License-Identifier: GPL-3.0-or-later
"""What playing has computed so far. One run per scene, in memory only; the same numbers as a bake, frame by frame.

A run begins at the first frame and can only go forward by one frame. It is dropped when anything that it was computed
from has changed: settings (compared at every frame), geometry (compared when Blender reports a change), or the motion of
a keyframed body (the poses of a remembered frame are compared with those that Blender has now).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...core.errors import PalpateError
from ...core.model.recording import Frame
from ...core.model.scenario import Scenario
from ...core.model.sensor_parameters import SENSOR_PARAMETERS
from ..properties import effect_stack
from ..scene import drives, meshes, moved_bodies, scene_reader, uv_layouts
from ..session import clock, dependencies, session_state, units

PAINTED = tuple(f"{key}_{part}" for key in meshes.PAINTED for part in ("map", "factor"))
REGION = ("region", "vertex_group", "threshold", "material", "face_set")
SETTINGS = (
    *SENSOR_PARAMETERS,
    *PAINTED,
    *REGION,
    *drives.SETTINGS,
    *uv_layouts.SETTINGS,
    "role",
    "body",
    "mass",
    "contact_normals",
    "presses",
)


@dataclass
class Run:
    """A simulation that follows the timeline.

    Attributes
    ----------
    scenario, binding, simulation
        The simulation stands at the last frame computed.
    placements : dict of int to Placement
        Of free bodies.
    settings : tuple
        What was set when it began.
    geometry : dict of str to str
        Fingerprint of each object that takes part.
    frames : dict of int to Frame
    moments : dict of int to what :func:`.scene_reader.sample_moment` found at that frame
    written : dict of int to (14,) float
        Where free bodies were last put, by body index.
    loads : dict of int to dict
        Kept by :meth:`load`.
    """

    scenario: Scenario
    binding: scene_reader.Binding
    simulation: object
    placements: dict[int, moved_bodies.Placement]
    settings: tuple
    geometry: dict[str, str]
    frames: dict[int, Frame] = field(default_factory=dict)
    moments: dict[int, scene_reader.Moment] = field(default_factory=dict)
    written: dict[int, np.ndarray] = field(default_factory=dict)
    loads: dict[int, dict[str, float]] = field(default_factory=dict)

    def load(self, number: int) -> dict[str, float]:
        """Return the sums of the normal forces of a remembered frame by sensor, N."""
        if number not in self.loads:
            sensors = self.frames[number].sensors
            self.loads[number] = {name: float(felt.normal_force.sum()) for name, felt in sensors.items()}
        return self.loads[number]


_runs: dict[int, Run] = {}


def get(scene) -> Run | None:
    """Return the run of a scene."""
    return _runs.get(scene.session_uid)


def drop(scene) -> None:
    """Forget the run of a scene."""
    _runs.pop(scene.session_uid, None)


def clear() -> None:
    """Forget all runs."""
    _runs.clear()


def begin(scene, depsgraph) -> Run:
    """Start a run. Blender has to have evaluated the first frame.

    Raises
    ------
    PalpateError
        The scene makes no run.
    """
    drop(scene)
    scenario, binding = scene_reader.sample_start(scene, depsgraph)
    objects = binding.objects(scene)
    placements = {
        index: moved_bodies.Placement.of(objects[index], matrix, binding.parents[index][0], binding.scale)
        for index, matrix in binding.starts.items()
    }
    run = Run(
        scenario=scenario,
        binding=binding,
        simulation=dependencies.solver().Simulation(scenario),
        placements=placements,
        settings=settings_of(scene, binding.everyone(scene)),
        geometry={obj.name: meshes.fingerprint(obj, depsgraph) for obj in binding.everyone(scene)},
    )
    first = scenario.frame_start
    run.frames[first] = run.simulation.observe()
    run.moments[first] = scene_reader.sample_moment(scene, depsgraph, binding)
    session_state.session.changed_geometry.difference_update(run.geometry)
    session_state.session.changed_motion.clear()
    _runs[scene.session_uid] = run
    return run


def go_on(scene, depsgraph, run: Run) -> Run:
    """Compute the frame where the scene stands, which is the one after the last computed."""
    frame, _ = clock.moment(scene)
    moment = run.moments[frame] = scene_reader.sample_moment(scene, depsgraph, run.binding)
    if scene.palpate.subframes > 1:
        _read_between(scene, run, frame)
    run.simulation.extend(moment.poses, moment.targets, moment.vertices, moment.texels)
    run.frames[frame] = run.simulation.advance()
    return run


def _read_between(scene, run: Run, frame: int) -> None:
    """Read what a scene says between two frames, as a bake does, and come back to the second."""
    before, parts = (scene.frame_current, scene.frame_subframe), scene.palpate.subframes
    with session_state.suspended():
        try:
            with clock.unstretched(scene):
                for part in range(1, parts):
                    scene.frame_set(frame - 1, subframe=part / parts)
                    moment = scene_reader.sample_moment(scene, scene_reader.depsgraph_of(scene), run.binding)
                    run.simulation.extend(moment.poses, moment.targets, moment.vertices, moment.texels, share=part / parts)
        finally:
            scene.frame_set(before[0], subframe=before[1])


def is_stale(scene, depsgraph, run: Run) -> bool:
    """Whether something that a run was computed from has changed."""
    try:
        objects = run.binding.objects(scene)
    except PalpateError:
        return True
    everyone = {obj.name: obj for obj in run.binding.everyone(scene)}
    if settings_of(scene, everyone.values()) != run.settings:
        return True
    names = {obj.name: index for index, obj in enumerate(objects)}
    if any(names.get(name, -1) not in run.binding.starts for name in session_state.session.changed_motion if name in names):
        return True
    start = scene.frame_start
    moved = any(not np.array_equal(moved_bodies.channels(objects[index]), put) for index, put in run.written.items())
    if moved and all(not objects[index].palpate.has_start for index in run.written) and start in run.frames:
        return True  # moved while it stood at the first frame: that is a new start
    touched = session_state.session.changed_geometry & everyone.keys()
    session_state.session.changed_geometry -= touched
    bending = {skin.name for skin in run.binding.skins}
    if any(meshes.fingerprint(everyone[name], depsgraph) != run.geometry[name] for name in touched - bending):
        return True
    # What deforms looks different at every frame: it is compared with what it looked like at this one, if that is known.
    return bool(touched & bending) and (clock.moment(scene)[0] not in run.moments or has_moved(scene, depsgraph, run))


def has_moved(scene, depsgraph, run: Run) -> bool:
    """Whether keyframed bodies are elsewhere now than when the present frame was computed."""
    before = run.moments[clock.moment(scene)[0]]
    try:
        now = scene_reader.sample_moment(scene, depsgraph, run.binding)
    except PalpateError:
        return True
    moved = any(not np.array_equal(now.poses[i][part], before.poses[i][part]) for i in before.poses for part in (0, 1))
    bent = any(not np.array_equal(found, before.shapes[place]) for place, found in now.shapes.items())
    return moved or bent or now.targets != before.targets


def settings_of(scene, objects) -> tuple:
    """Return everything that is set by a number or a choice, in a form that can be compared."""
    own = scene.palpate
    taking_part, hidden = scene_reader.participants(scene)
    whole = (
        scene.frame_start,
        units.frames_per_second(scene),
        units.metres_per_unit(scene),
        tuple(units.gravity(scene)),
        own.use_auto_dt or own.dt,
        own.interpolation,
        own.subframes,
        tuple(hidden),
        tuple(obj.name for obj in taking_part),
    )
    return whole + tuple(
        (
            obj.name,
            *(getattr(obj.palpate, key) for key in SETTINGS),
            *obj.palpate.velocity,
            *obj.palpate.angular_velocity,
            *effect_stack.settings(obj),
        )
        for obj in objects
    )
