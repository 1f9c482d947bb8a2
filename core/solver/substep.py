# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame's substeps (kernels).

In each, contacts are found where the bodies are, velocities at its end solved for, bristles brought forward, and positions
follow with those velocities.
"""

from __future__ import annotations

from ..compiled.kernels import inlined, kernel
from ..geometry.rotations import DRIVEN, FREE, KEYFRAMED, look_back, turn_quaternion, write_rotation, write_world_inertia
from .detection.deformation import refit, set_moment
from .dynamics.actuators import carry_driven, move_drives, place_driven
from .dynamics.effect_kernels import remember_step
from .dynamics.free_rotation import product, spin_of
from .dynamics.implicit_velocities import solve_velocities
from .parallel_loops import BEND, gather_all, share_out


@kernel
def advance_steps(
    dt, first, last, path_position, path_quaternion, path_velocity, commands, world, tree, neighbours, shapes, state, scratch
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
    moves = shapes.moves[0]
    if moves and first == 0:
        refit(shapes, tree)
    for step in range(first, last):
        _place(path_position[step], path_quaternion[step], world, state, scratch)
        for drive in range(len(world.drives)):
            scratch.drive_mass[drive] = scratch.drive_load[drive] = 0.0
        for body in range(len(world.kind)):
            for i in range(6):
                scratch.before[body, i] = state.velocity[body, i]
            if world.kind[body] == KEYFRAMED:
                for i in range(6):
                    state.velocity[body, i] = path_velocity[step, body, i]
            elif world.kind[body] == DRIVEN:
                after = path_quaternion[step + 1, body]
                carry_driven(body, dt, after, path_velocity[step, body], world, state, scratch)
        if moves:
            set_moment(step, step + 1, dt, world, shapes)
        worst = max(worst, gather_all(dt, world, tree, neighbours, shapes, state, scratch))
        for body in range(len(world.kind)):
            if world.kind[body] == FREE:
                write_world_inertia(scratch.rotation[body], world.inertia[body], scratch.inertia[body])
        solve_velocities(dt, commands[step], world, tree, neighbours, shapes, state, scratch)
        if len(scratch.felt) > 0:
            remember_step(dt, world, state, scratch)
        share_out(BEND, world, tree, neighbours, shapes, state, scratch)
        if len(world.drives) > 0:
            move_drives(dt, commands[step], world, state, scratch)
        for body in range(len(world.kind)):
            if world.kind[body] == FREE:
                _move_free(body, dt, world, state, scratch)
    if moves:
        set_moment(last, last - 1, dt, world, shapes)
    _place(path_position[last], path_quaternion[last], world, state, scratch)
    for body in range(len(world.kind)):
        look_back(state.velocity[body], dt, scratch.twist[body])
    return worst


@inlined
def _place(position, quaternion, world, state, scratch):
    """Put keyframed and driven bodies where they are at the beginning of a step."""
    for body in range(len(world.kind)):
        if world.kind[body] != FREE:
            for i in range(4):
                state.quaternion[body, i] = quaternion[body, i]
            for i in range(3):
                state.position[body, i] = position[body, i]
            if world.kind[body] == DRIVEN:
                place_driven(body, position[body], world, state, scratch.axis[body])


@inlined
def _move_free(body, dt, world, state, scratch):
    """Move a free body with its new velocity. What nothing touches keeps its angular momentum and its energy."""
    velocity, rotation, extra = state.velocity[body], scratch.rotation[body], scratch.tumbling[body]
    for i in range(3):
        state.position[body, i] += dt * velocity[i]
    lx, ly, lz = product(scratch.inertia[body], velocity[3] - extra[0], velocity[4] - extra[1], velocity[5] - extra[2])
    turn_quaternion(state.quaternion[body], dt * velocity[3], dt * velocity[4], dt * velocity[5])
    write_rotation(state.quaternion[body], rotation)
    velocity[3], velocity[4], velocity[5] = spin_of(rotation, world.inverse_inertia[body], lx, ly, lz)
