# SPDX-License-Identifier: GPL-3.0-or-later
"""Model that all environments of a pressed sensor share: the sensor, its targets and the solver's model of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

import numpy as np

from ..compiled.thread_team import helper_threads, threads_for
from ..effects.engine.readout_chain import ReadoutChain, transducers_of
from ..effects.engine.registry import in_signal_order
from ..errors import ParameterError
from ..geometry.mesh import TriangleMesh, turned_outwards
from ..geometry.shapes import Shape
from ..laws.contact_law import contact_law
from ..model.body import Body, Motion
from ..model.scenario import Scenario, Target
from ..model.sensor import Sensor
from .detection.detection_data import TargetShapes
from .detection.shape_contacts import blocks_of_points
from .parallel_loops import help_with_loops, prepare_pair_loops
from .pressing import (
    Environment,
    OwnNumbers,
    PressedTexels,
    Pressing,
    StepMemory,
    addresses_of,
    make_environments,
    presser,
)
from .simulation import Simulation
from .structures import step_program, workspace_for
from .workspace import Workspace


def targets_of(given: TriangleMesh | Shape | Sequence[TriangleMesh | Shape]) -> list[TriangleMesh | Shape]:
    """Return a target, or several, as a list; a mesh whose faces point inwards is turned, with a warning."""
    targets = [given] if isinstance(given, TriangleMesh | Shape) else list(given)
    return [turned_outwards(one, "the target") if isinstance(one, TriangleMesh) else one for one in targets]


def pressed_scenario(sensor: Sensor, meshes: Sequence[TriangleMesh], dt: float) -> Scenario:
    """Return a scenario of a sensor and targets that another program moves in steps of `dt` seconds.

    Raises
    ------
    ParameterError
        The step is not above zero, or the sensor deforms by prescription.
    """
    if not (np.isfinite(dt) and dt > 0):
        raise ParameterError(f"The step is {dt:g} s: give a number above zero.")
    if sensor.deformation is not None:
        raise ParameterError(f"'{sensor.name}' deforms by prescription: take a sensor that keeps its shape in this loop.")
    names = [f"target {number}" for number in range(1, len(meshes) + 1)]
    return Scenario(
        bodies=(Body("sensor", Motion.at_rest()), *(Body(name, Motion.at_rest()) for name in names)),
        sensors=(sensor,),
        targets=tuple(Target(name, 1 + i, mesh) for i, (name, mesh) in enumerate(zip(names, meshes, strict=True))),
        frame_start=0,
        frame_end=1,
        fps=1.0 / dt,
        dt=dt,
    )


class PressedModel:
    """A sensor, the object in contact with it, and the solver's arrays for them.

    Parameters
    ----------
    sensor : Sensor
    targets : sequence of TriangleMesh or Shape
        Each in the frame of the object, metres.
    dt : float, seconds
        Of a step.
    threads : int, optional
        To compute one step of one environment with (see :func:`.thread_team.make_queue`).

    Raises
    ------
    PalpateError
        The sensor, the meshes or the step make no run.

    Attributes
    ----------
    sensor : Sensor
    texels : int
        How many it has.
    rate : float, 1/s
        Steps in a second.
    helpers : int
        Threads that help with a step.
    reads_by_chain : bool
        Effects act on readings; otherwise these are a scale and a zero.
    """

    def __init__(self, sensor: Sensor, targets: Sequence[TriangleMesh | Shape], dt: float, threads: int | None = None):
        if not targets:
            raise ParameterError(f"There is no target for '{sensor.name}': give a mesh, or several.")
        meshes = [target.stand_in if isinstance(target, Shape) else target for target in targets]
        simulation = Simulation(pressed_scenario(sensor, meshes, dt), threads)
        self.sensor = sensor
        self.rate = simulation.scenario.fps
        self.texels = len(sensor.texels)
        self._dt = simulation.dt
        self._model, detection, self._state, workspace = simulation.arrays
        shapes = [target if isinstance(target, Shape) else None for target in targets]
        points = blocks_of_points(self._model.pairs, self._model.points.frame)
        self._detection = detection._replace(shapes=TargetShapes.of(shapes, detection.shapes.closed, points))
        self._queue = workspace.queue
        self.helpers = simulation.helpers
        transducers = transducers_of(sensor)
        self._painted = np.array(np.broadcast_to(transducers.painted, self.texels), float)
        self.reads_by_chain = bool(in_signal_order(sensor.effects, readout=True))

    def readout_chain(self, sensor: Sensor | None = None) -> ReadoutChain | None:
        """Return the chain from forces to readings, from its beginning; None where that is a scale and a zero.

        `sensor` is one that differs in parameters.
        """
        return ReadoutChain.of(sensor or self.sensor) if self.reads_by_chain else None

    def environments(self, count: int, sensors: Sequence[Sensor] = ()) -> list[Environment]:
        """Return environments at their beginning; `sensors` are those of each, which differ in parameters, or none."""
        same = self._own_numbers(self.sensor)
        own = [self._own_numbers(sensor) for sensor in sensors]
        return make_environments(count, self._detection, self._state, lambda number: own[number] if own else same)

    def _own_numbers(self, sensor: Sensor) -> OwnNumbers:
        """Return the parameters of a sensor as the kernels take them."""
        p, pairs = sensor.parameters, self._model.pairs
        laws = [contact_law(p, *shares) for shares in zip(pairs.force_share, pairs.overlap_share, strict=True)]
        constants = self._model.effects.constants
        if len(constants):
            constants = step_program([sensor], self._dt).constants
        return OwnNumbers(np.array(laws, float), constants, np.array([p.zero, p.gain], float))

    def threads(self, environments: int, wanted: int | None) -> int:
        """Return how many threads to divide environments among, of those that are wanted or, with None, pay off."""
        return min(environments, threads_for(environments * self.texels, wanted))

    def bytes_of_environment(self) -> int:
        """Return the bytes of an environment: state and neighbour lists."""
        arrays = (*self._detection.neighbours, *self._state)
        return sum(field.nbytes for field in arrays) + BYTES_OF_TUPLES

    def workspace(self) -> Workspace:
        """Return working memory for one thread."""
        workspace = workspace_for(self._model, self._state, self._detection.surfaces, self._queue)
        prepare_pair_loops(self._model, self._detection, self._state, workspace)
        return workspace

    def presser(
        self, memory: StepMemory, pressed: PressedTexels, environments: list[Environment], workspace: Workspace
    ) -> Callable[[int, int], None]:
        """Return what runs one step of some of these environments in one thread (see :func:`.pressing.presser`)."""
        model = self._model
        model = model._replace(
            pairs=model.pairs._replace(law=model.pairs.law.copy()),
            effects=model.effects._replace(constants=model.effects.constants.copy()),
        )
        pressing = Pressing(
            dt=np.array([self._dt]),
            painted=self._painted,
            model=model,
            workspace=workspace,
            memory=memory,
            pressed=pressed,
            addresses=addresses_of(environments),
            example=environments[0],
        )
        return presser(pressing, environments)

    def helping(self, environment: Environment, workspace: Workspace) -> AbstractContextManager[None]:
        """Let other threads help with the steps of an environment meanwhile."""
        arrays = self._model, environment.detection, environment.state, workspace
        return helper_threads(workspace.queue, self.helpers, help_with_loops, *arrays)


BYTES_OF_TUPLES = 8000
"""Bytes of the tuples of an environment and of its views of arrays in Python."""
