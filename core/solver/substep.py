# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame's substeps (kernels).

In each substep, contacts are found where the bodies are, the velocities at its end are solved for, the bristles are brought
forward, and the positions follow with those velocities.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..geometry.rotations import write_backward_step_motion, write_world_inertia
from .detection.deformation import refit_boxes, set_moment
from .detection.detection_data import DetectionData
from .dynamics.actuators import move_drives, place_driven, prepare_driven
from .dynamics.effect_memory import commit_effect_memory
from .implicit_velocities import solve_velocities
from .parallel_loops import UPDATE_FRICTION, find_all_contacts, run_parallel_loop
from .solver_model import DRIVEN, FREE, KEYFRAMED, SolverModel, State
from .workspace import Workspace


class FramePath(NamedTuple):
    """What is prescribed during the steps of a frame.

    Attributes
    ----------
    position, quaternion : (steps + 1, b, 3) and (steps + 1, b, 4) float
        Of keyframed bodies at the beginning of each step, and at the end of the last; of driven ones without their travel.
    velocity : (steps, b, 6) float
        Their velocities during each step.
    commands : (steps, d, 4) float
        Commands to the actuators.
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    commands: np.ndarray


@kernel
def advance_steps(
    dt: float,
    first: int,
    last: int,
    path: FramePath,
    model: SolverModel,
    detection: DetectionData,
    state: State,
    workspace: Workspace,
) -> int:
    """Run some of the substeps of one frame; the state is brought forward in place.

    Parameters
    ----------
    dt : float, seconds
    first, last : int
        Steps to run, the last one excluded.
    path : FramePath
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace

    Returns
    -------
    too_deep : int
        Largest number of contact points that were pressed too deep to act in any one step; if it is not zero,
        ``workspace.contacts.most_too_deep`` has their numbers in that step, by pair.
    """
    worst = 0
    surfaces = detection.surfaces
    deforms = surfaces.any_deforms[0]
    if deforms and first == 0:
        refit_boxes(surfaces, detection.tree)
    for step in range(first, last):
        _place(path.position[step], path.quaternion[step], model, state, workspace)
        _set_prescribed_velocities(step, dt, path, model, state, workspace)
        if deforms:
            set_moment(step, step + 1, dt, model, surfaces)
        too_deep = find_all_contacts(dt, model, detection, state, workspace)
        if too_deep > worst:
            worst = too_deep
            for pair in range(len(model.pairs.sensor)):
                workspace.contacts.most_too_deep[pair] = workspace.contacts.too_deep[pair]
        for body in range(len(model.bodies.kind)):
            if model.bodies.kind[body] == FREE:
                write_world_inertia(workspace.bodies.rotation[body], model.bodies.inertia[body], workspace.bodies.inertia[body])
        solve_velocities(dt, path.commands[step], model, detection, state, workspace)
        if len(workspace.effects.contacts.force) > 0:
            commit_effect_memory(dt, model, state, workspace)
        run_parallel_loop(UPDATE_FRICTION, model, detection, state, workspace)
        if len(model.drives.gains) > 0:
            move_drives(dt, path.commands[step], model, state, workspace)
        for body in range(len(model.bodies.kind)):
            if model.bodies.kind[body] == FREE:
                _move_free(body, dt, state, workspace)
    if deforms:
        set_moment(last, last - 1, dt, model, surfaces)
    _place(path.position[last], path.quaternion[last], model, state, workspace)
    for body in range(len(model.bodies.kind)):
        write_backward_step_motion(state.velocity[body], dt, workspace.bodies.step_motion[body])
    return worst


@inlined
def _set_prescribed_velocities(
    step: int, dt: float, path: FramePath, model: SolverModel, state: State, workspace: Workspace
) -> None:
    """Remember the velocities at a step's beginning, and give keyframed and driven bodies those of the path."""
    bodies = model.bodies
    for drive in range(len(model.drives.gains)):
        workspace.drives.mass[drive] = workspace.drives.load[drive] = 0.0
    for body in range(len(bodies.kind)):
        for i in range(6):
            workspace.bodies.velocity_before[body, i] = state.velocity[body, i]
        if bodies.kind[body] == KEYFRAMED:
            for i in range(6):
                state.velocity[body, i] = path.velocity[step, body, i]
        elif bodies.kind[body] == DRIVEN:
            after = path.quaternion[step + 1, body]
            prepare_driven(body, dt, after, path.velocity[step, body], model, state, workspace)


@inlined
def _place(position: np.ndarray, quaternion: np.ndarray, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Put keyframed and driven bodies where they are at the beginning of a step."""
    kind = model.bodies.kind
    for body in range(len(kind)):
        if kind[body] != FREE:
            for i in range(4):
                state.quaternion[body, i] = quaternion[body, i]
            for i in range(3):
                state.position[body, i] = position[body, i]
            if kind[body] == DRIVEN:
                place_driven(body, position[body], model, state, workspace.drives.axis[body])


@inlined
def _move_free(body: int, dt: float, state: State, workspace: Workspace) -> None:
    """Move a free body with its new velocity, and give it the orientation and spin that :mod:`.passivity` found for the end."""
    velocity, work = state.velocity[body], workspace.bodies
    for i in range(3):
        state.position[body, i] += dt * velocity[i]
        velocity[3 + i] = work.end_spin[body, i]
        for j in range(3):
            work.rotation[body, i, j] = work.end_rotation[body, i, j]
    for i in range(4):
        state.quaternion[body, i] = work.end_quaternion[body, i]
