# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports that panels and the 3D view show of a sensor while it is made: its texels, their density, and its problems.

Drawing calls :func:`known_report`, which never computes; a timer computes a new report a moment later.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import bpy

from ...core.errors import PalpateError, SceneError
from ...core.geometry.mesh import TriangleMesh
from ...core.geometry.texels import Texels
from ...core.solver.time_step_adviser import Advice, advise
from ..display import baked_scene
from ..scene import mesh_arrays, participants, scene_fingerprint, scene_reader, sensor_reader
from ..session import session_state, transforms
from . import laid_sensors, problems, sensor_exchange

DELAY = 0.2
"""Seconds from a change to the new report, besides three times the duration of the last computation."""


@dataclass(frozen=True)
class Report:
    """The present state of a sensor.

    Attributes
    ----------
    texels : Texels or None
        In the frame of the object: its location and rotation, metres.
    reach : float, metres
        Maximum penetration.
    metres : float
        Metres per Blender unit.
    body : TriangleMesh or None
        The mesh on which the texels stand, in the same frame.
    problems : list of Problem
    advice : Advice or None
        The advised time step of the scene; None when the scene makes no run.
    missing : str
        Why the scene makes no run, in one sentence.
    """

    texels: Texels | None = None
    reach: float = 0.0
    metres: float = 1.0
    body: TriangleMesh | None = None
    problems: list = field(default_factory=list)
    advice: Advice | None = None
    missing: str = ""

    @property
    def area(self) -> float:
        """Area of the region, m²."""
        return float(self.texels.area.sum())

    @property
    def density(self) -> float:
        """Number of texels per square centimetre."""
        return len(self.texels) / (self.area * 1e4) if self.area > 0 else 0.0


_reports: dict[int, tuple[tuple, Report]] = {}
_requested: set[int] = set()
_last_duration = 0.0


def known_report(obj, scene) -> Report | None:
    """Return the last report of a sensor, and request a new one if the sensor may have changed; fast enough for drawing."""
    key = _key(obj, scene)
    known = _reports.get(obj.session_uid)
    if known is None or known[0] != key:
        _request(obj)
    return known[1] if known else None


def fresh_report(obj, scene) -> Report:
    """Compute the report of a sensor now. Reading gives duplicates their own uid, so their copied bake is removed first."""
    baked_scene.clear_copies(scene)
    key = _key(obj, scene)
    report = _compute(obj, scene)
    _reports[obj.session_uid] = key, report
    return report


def forget() -> None:
    """Forget everything, because another file is open or undo has changed it."""
    _reports.clear()
    _requested.clear()


def _key(obj, scene) -> tuple:
    """Return a key that changes with everything that may change a report, perhaps also without such a change."""
    stretch = tuple(round(length, 6) for length in obj.matrix_world.to_scale())
    carrier = obj.parent.name if obj.parent else ""
    return (*scene_fingerprint.settings_of(scene, [obj]), session_state.session.geometry_version, stretch, carrier, obj.mode)


def _request(obj) -> None:
    """Let the timer compute the report of a sensor."""
    if bpy.app.background:
        return
    _requested.add(obj.session_uid)
    if not bpy.app.timers.is_registered(_work):
        bpy.app.timers.register(_work, first_interval=DELAY + 3.0 * _last_duration)


def _work() -> float | None:
    """Timer: compute the requested reports; while something plays only those of sensors without one, and none during a bake."""
    global _last_duration
    manager = bpy.context.window_manager
    playing = any(window.screen.is_animation_playing for window in manager.windows)
    wanted = _requested.difference(_reports) if playing else set(_requested)
    if session_state.session.suspension_depth or not wanted:
        return DELAY if _requested else None
    scene, start = bpy.context.scene, time.perf_counter()
    for obj in scene.objects:
        if obj.session_uid in wanted and obj.palpate.role in {"SENSOR", "PAD"}:
            fresh_report(obj, scene)
    _requested.difference_update(wanted)
    _last_duration = time.perf_counter() - start
    session_state.redraw_views()
    return DELAY if _requested else None


def _compute(obj, scene) -> Report:
    depsgraph = participants.depsgraph_of(scene)
    advice, missing = _advice(scene, depsgraph)
    hidden = [problems.Problem("HIDDEN", missing)] if missing and participants.find_participants(scene)[1] else []
    missing = "" if hidden else missing  # a problem with a button
    metres = transforms.metres_per_unit(scene)
    reach = transforms.as_typed(obj.palpate.max_penetration)
    notes: list[str] = []
    try:
        notes = mesh_arrays.sensor_arrays(obj, depsgraph)[1]
        sensor, mesh = sensor_reader.sensor_in_own_frame(scene, obj, depsgraph)
        around = sensor_exchange.carrying_surface(scene, obj, depsgraph) if laid_sensors.is_laid(obj) else None
        found = hidden + problems.object_problems(obj, notes)
        found += problems.texel_problems(obj, mesh, sensor.texels, reach, around)
    except PalpateError as error:
        modified = [problems.Problem("MODIFIER", note) for note in notes]  # perhaps why nothing is where it was painted
        return Report(None, reach, metres, None, [problems.problem_of_error(obj, error), *modified], advice, missing)
    return Report(sensor.texels, reach, metres, mesh if around is None else around, found, advice, missing)


def _advice(scene, depsgraph) -> tuple[Advice | None, str]:
    """Return the advised time step of the scene, or why there is none."""
    try:
        scenario = scene_reader.read_start(scene, depsgraph).scenario
    except SceneError as error:
        return None, str(error)
    except PalpateError:  # a problem of some sensor: its own report names it
        return None, ""
    return advise(scenario), ""
