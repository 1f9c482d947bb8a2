# SPDX-License-Identifier: GPL-3.0-or-later
"""The arrays of a simulation, which a later one takes over where only paths of bodies and parameters of sensors differ.

A short run takes less time than making these arrays does, and than telling compiled code where they are.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..compiled.thread_team import make_queue
from ..geometry.bvh import Tree, build_tree
from ..geometry.contact_points import contact_points
from ..geometry.mesh import TriangleMesh, is_closed
from ..model.body import Body
from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..model.shared_results import SharedResults
from ..model.target import Target
from .detection.deforming_surfaces import DeformingSurfaces
from .detection.detection_data import DetectionData, TargetShapes
from .detection.neighbour_lists import neighbour_lists_for
from .model_builder import build_model, initial_state, pairs_of, sensors_of, start_poses
from .parallel_loops import prepare_pair_loops
from .workspace_builder import workspace_for

_BODY_FIELDS = tuple(item.name for item in fields(Body) if item.name != "motion")
_TARGET_FIELDS = tuple(item.name for item in fields(Target))
_SENSOR_FIELDS = tuple(item.name for item in fields(Sensor) if item.name != "parameters")

_ALIGNED = 64
"""Bytes of a line of a processor's cache."""


class Structures:
    """What the kernels of one simulation work on, at its beginning.

    Parameters
    ----------
    scenario : Scenario
    center : (b, 3) float, metres
        Point of each body, in its frame, that is followed.
    dt : float, seconds
        Length of a step.
    threads : int, optional
        See :func:`.thread_team.make_queue`.
    shared : SharedResults

    Attributes
    ----------
    closed : list of bool
        Which targets are closed.
    deforming_surfaces : DeformingSurfaces
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace
    helpers : int
        Threads that help with the steps.
    """

    def __init__(self, scenario: Scenario, center: np.ndarray, dt: float, threads: int | None, shared: SharedResults):
        tree, self.closed = _prepared_targets(scenario, center, shared)
        points = [shared.of(contact_points, s.texels, s.parameters.points_per_texel) for s in scenario.sensors]
        self.model = build_model(scenario, center, points, dt, shared)
        self.deforming_surfaces = DeformingSurfaces(scenario, center, points, tree, self.model)
        surface_motion = self.deforming_surfaces.at(np.zeros(1))
        self.state = initial_state(scenario, self.model, center)
        lists = neighbour_lists_for(len(self.state.triangle), len(self.model.pairs.sensor))
        self.detection = DetectionData(tree, lists, surface_motion, TargetShapes.of([None] * len(scenario.targets)))
        queue, self.helpers = make_queue(len(self.state.triangle), threads)
        self.workspace = workspace_for(self.model, self.state, surface_motion, queue)
        self._center, self._sensors = center, scenario.sensors
        self._memory = self._beginning = np.zeros(0, np.uint8)

    def keep_beginning(self) -> None:
        """Put all that a run changes into one piece of memory, and remember it for :meth:`begin_again`."""
        prepare_pair_loops(self.model, self.detection, self.state, self.workspace)
        detection = self.detection
        parts = (detection.neighbours, detection.surfaces, self.state, self.workspace)
        self._memory = np.zeros(_in_one_piece(parts, None)[1], np.uint8)
        (neighbours, surfaces, self.state, self.workspace), _ = _in_one_piece(parts, self._memory)
        self.detection = detection._replace(neighbours=neighbours, surfaces=surfaces)
        self._beginning = self._memory.copy()

    def begin_again(self, scenario: Scenario, shared: SharedResults) -> None:
        """Bring the numbers of :meth:`keep_beginning` back, with another scenario's poses at first and sensors' parameters."""
        np.copyto(self._memory, self._beginning)
        self.state.position[:], self.state.quaternion[:] = start_poses(scenario, self._center)
        if any(now is not before for now, before in zip(scenario.sensors, self._sensors, strict=True)):
            starts = self.model.sensors.first_point
            sensors = sensors_of(scenario, np.split(self.model.points.frame, starts[1:-1]), starts)
            pairs = pairs_of(scenario, starts, shared)
            for array, now in zip((*self.model.sensors, *self.model.pairs), (*sensors, *pairs), strict=True):
                array[...] = now
            self._sensors = scenario.sensors


class LastStructures:
    """The structures that simulations of similar scenarios have one after the other."""

    def __init__(self, *_: object):
        self._kept: Structures | None = None
        self._user: weakref.ref[Any] | None = None

    def lend(
        self, user: object, scenario: Scenario, center: np.ndarray, dt: float, threads: int | None, shared: SharedResults
    ) -> Structures:
        """Return structures at the beginning of a scenario: new ones while the last user of the kept ones is there.

        Parameters
        ----------
        user : object
            Who works on them; nobody else gets them as long as it lives.
        scenario, center, dt, threads, shared
            See :class:`Structures`.
        """
        if self._user is not None and self._user() is not None:
            return Structures(scenario, center, dt, threads, shared)
        if self._kept is not None:
            self._kept.begin_again(scenario, shared)
            found = self._kept
        else:
            found = Structures(scenario, center, dt, threads, shared)
            if self._user is not None:  # not the first time: there may be many more
                found.keep_beginning()
                self._kept = found
        self._user = weakref.ref(user)
        return found


def structures_for(
    user: object, scenario: Scenario, center: np.ndarray, dt: float, threads: int | None, shared: SharedResults
) -> Structures:
    """Return structures for a simulation: those of an earlier one with the same `shared` that is gone, if they fit."""
    if any_deforms(scenario):
        return Structures(scenario, center, dt, threads, shared)
    last = shared.of(LastStructures, dt, threads or 0, *_what_shapes(scenario))
    return last.lend(user, scenario, center, dt, threads, shared)


def any_deforms(scenario: Scenario) -> bool:
    """Return whether a target or a sensor deforms."""
    deformations = [part.deformation for part in scenario.targets] + [part.deformation for part in scenario.sensors]
    return any(found is not None for found in deformations)


def _what_shapes(scenario: Scenario) -> Iterator[Any]:
    """Yield all that structures depend on, apart from what :meth:`Structures.begin_again` sets."""
    yield len(scenario.sensors)
    for sensor in scenario.sensors:
        yield sensor.parameters.points_per_texel
        yield from (getattr(sensor, name) for name in _SENSOR_FIELDS)
    for target in scenario.targets:
        yield from (getattr(target, name) for name in _TARGET_FIELDS)
    yield np.asarray(scenario.gravity, float).tobytes()
    for body in scenario.bodies:
        for name in _BODY_FIELDS:
            value = getattr(body, name)
            yield value.tobytes() if isinstance(value, np.ndarray) else value


def _in_one_piece(part: Any, memory: np.ndarray | None, at: int = 0) -> tuple[Any, int]:
    """Return a tuple of arrays and of such tuples with its arrays in a piece of memory, and the place behind them.

    Without memory, only the place is found.
    """
    if isinstance(part, tuple):
        own = []
        for field in part:
            moved, at = _in_one_piece(field, memory, at)
            own.append(moved)
        return (type(part)(*own) if hasattr(part, "_fields") else tuple(own)), at
    if not isinstance(part, np.ndarray) or part.size == 0:
        return part, at
    stop = at + part.nbytes
    if memory is not None:
        place = memory[at:stop].view(part.dtype).reshape(part.shape)
        place[...] = part
        part = place
    return part, -(-stop // _ALIGNED) * _ALIGNED


def _prepared_targets(scenario: Scenario, center: np.ndarray, shared: SharedResults) -> tuple[Tree, list[bool]]:
    """Return the tree of all targets, and which of them are closed; the tree of what deforms is the simulation's own."""
    centers = np.array([center[target.body] for target in scenario.targets]).tobytes()
    meshes = [target.mesh for target in scenario.targets]
    closed = [shared.of(_is_closed, mesh) for mesh in meshes]
    return (_tree_about(centers, *meshes) if any_deforms(scenario) else shared.of(_tree_about, centers, *meshes)), closed


def _tree_about(centers: bytes, *meshes: TriangleMesh) -> Tree:
    """Return the tree of meshes whose points are seen from others, (m, 3) float as bytes, m."""
    middles = np.frombuffer(centers).reshape(-1, 3)
    return build_tree([replace(mesh, vertices=mesh.vertices - middle) for mesh, middle in zip(meshes, middles, strict=True)])


def _is_closed(mesh: TriangleMesh) -> bool:
    return is_closed(mesh.triangles)
