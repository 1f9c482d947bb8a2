# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame's substeps (kernels).

In each, contacts are found where the bodies are, velocities at its end solved for, bristles brought forward, and positions
follow with those velocities.
"""

from __future__ import annotations

from ..compiled.kernels import inlined, kernel
from ..geometry.rotations import (
    DRIVEN,
    FREE,
    KEYFRAMED,
    rotate_quaternion,
    write_backward_twist,
    write_rotation,
    write_world_inertia,
)
from .detection.deformation import refit_boxes, set_moment
from .dynamics.actuators import move_drives, place_driven, prepare_driven
from .dynamics.effect_kernels import commit_effect_memory
from .dynamics.free_rotation import angular_velocity_of, matrix_times_vector
from .dynamics.implicit_velocities import solve_velocities
from .parallel_loops import UPDATE_FRICTION, find_all_contacts, run_parallel_loop


@kernel
def advance_steps(
    dt,
    first,
    last,
    path_position,
    path_quaternion,
    path_velocity,
    commands,
    model,
    tree,
    neighbour_lists,
    surfaces,
    state,
    workspace,
):
    """Run some of the substeps of one frame; the state is brought forward in place.

    Parameters
    ----------
    dt : float, seconds
    first, last : int
        Steps to run, the last one excluded.
    path_position, path_quaternion : (steps + 1, b, 3) and (steps + 1, b, 4) float
        Where the keyframed bodies are at the beginning of each step, and at the end of the last; driven ones without the way
        of their drives.
    path_velocity : (steps, b, 6) float
        Their velocities during each step.
    commands : (steps, d, 4) float
        What the drives are told.

    Returns
    -------
    sunk : int
        Most contact points that were sunk too deep to act in any one step.
    """
    worst = 0
    moves = surfaces.moves[0]
    if moves and first == 0:
        refit_boxes(surfaces, tree)
    for step in range(first, last):
        _place(path_position[step], path_quaternion[step], model, state, workspace)
        for drive in range(len(model.drives)):
            workspace.drive_mass[drive] = workspace.drive_load[drive] = 0.0
        for body in range(len(model.kind)):
            for i in range(6):
                workspace.before[body, i] = state.velocity[body, i]
            if model.kind[body] == KEYFRAMED:
                for i in range(6):
                    state.velocity[body, i] = path_velocity[step, body, i]
            elif model.kind[body] == DRIVEN:
                after = path_quaternion[step + 1, body]
                prepare_driven(body, dt, after, path_velocity[step, body], model, state, workspace)
        if moves:
            set_moment(step, step + 1, dt, model, surfaces)
        worst = max(worst, find_all_contacts(dt, model, tree, neighbour_lists, surfaces, state, workspace))
        for body in range(len(model.kind)):
            if model.kind[body] == FREE:
                write_world_inertia(workspace.rotation[body], model.inertia[body], workspace.inertia[body])
        solve_velocities(dt, commands[step], model, tree, neighbour_lists, surfaces, state, workspace)
        if len(workspace.felt) > 0:
            commit_effect_memory(dt, model, state, workspace)
        run_parallel_loop(UPDATE_FRICTION, model, tree, neighbour_lists, surfaces, state, workspace)
        if len(model.drives) > 0:
            move_drives(dt, commands[step], model, state, workspace)
        for body in range(len(model.kind)):
            if model.kind[body] == FREE:
                _move_free(body, dt, model, state, workspace)
    if moves:
        set_moment(last, last - 1, dt, model, surfaces)
    _place(path_position[last], path_quaternion[last], model, state, workspace)
    for body in range(len(model.kind)):
        write_backward_twist(state.velocity[body], dt, workspace.twist[body])
    return worst


@inlined
def _place(position, quaternion, model, state, workspace):
    """Put keyframed and driven bodies where they are at the beginning of a step."""
    for body in range(len(model.kind)):
        if model.kind[body] != FREE:
            for i in range(4):
                state.quaternion[body, i] = quaternion[body, i]
            for i in range(3):
                state.position[body, i] = position[body, i]
            if model.kind[body] == DRIVEN:
                place_driven(body, position[body], model, state, workspace.axis[body])


@inlined
def _move_free(body, dt, model, state, workspace):
    """Move a free body with its new velocity. What nothing touches keeps its angular momentum and its energy."""
    velocity, rotation, extra = state.velocity[body], workspace.rotation[body], workspace.tumbling[body]
    for i in range(3):
        state.position[body, i] += dt * velocity[i]
    lx, ly, lz = matrix_times_vector(
        workspace.inertia[body], velocity[3] - extra[0], velocity[4] - extra[1], velocity[5] - extra[2]
    )
    rotate_quaternion(state.quaternion[body], dt * velocity[3], dt * velocity[4], dt * velocity[5])
    write_rotation(state.quaternion[body], rotation)
    velocity[3], velocity[4], velocity[5] = angular_velocity_of(rotation, model.inverse_inertia[body], lx, ly, lz)
