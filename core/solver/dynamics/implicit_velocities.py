# SPDX-License-Identifier: GPL-3.0-or-later
"""The velocities at a substep's end (kernels).

They are the unknowns of a linear system, implicit in the stiffness and damping of every contact, so that a stiff or heavily
damped contact needs no small step.
"""

from __future__ import annotations

import math

from ...compiled.kernels import inlined, kernel
from ...geometry.rotations import DRIVEN, FREE, KEYFRAMED, solve_positive_definite, write_twist
from ..parallel_loops import SUM_CONTACTS, run_parallel_loop
from .actuators import SPEED, add_actuators
from .free_rotation import matrix_times_vector, mean_angular_velocity
from .linear_system import add_pair_to_system, write_pair_forces
from .passivity import MAX_BISECTIONS, check_energy, reset_force_scales

MAX_ITERATIONS = 40
"""Most rounds in which contacts are linearised anew within a substep; four or five are usual, one at rest."""

CONVERGED = 1e-9
"""What a round may still change to be the last, as a share of the velocity that contacts give in the step."""


@inlined
def solve_velocities(dt, commands, model, tree, neighbour_lists, surfaces, state, workspace):
    """Velocities of free and driven bodies at the step's end, written into the state.

    Contacts and drives are linearised at the current guess and the linear system solved, until the guess no longer moves; a
    contact that would pull is left out of the next round. Rounds that close in are cut short by a secant. Where they go in
    circles (friction that was guessed for too much load throws the contact off, without the contact there is no friction), the
    guess moves by a share of the way only. All that is mixed keeps the momentum. With nothing to solve for one round only
    linearises. Where contacts would give more than they were given (see :mod:`.passivity`), less of their forces acts.
    """
    _initial_guess(dt, model, state, workspace)
    reset_force_scales(model, state, workspace)
    for bisection in range(MAX_BISECTIONS):
        _iterate(dt, commands, model, tree, neighbour_lists, surfaces, state, workspace)
        if model.unknowns == 0 or check_energy(bisection, dt, model, state, workspace):
            break


@inlined
def _iterate(dt, commands, model, tree, neighbour_lists, surfaces, state, workspace):
    """Solve for the velocities with what is held back of the pairs' forces, from the present guess on."""
    matrix, vector, guess, n = workspace.matrix, workspace.vector, workspace.guess, model.unknowns
    last_change, share = 0.0, 1.0
    for turn in range(MAX_ITERATIONS):
        _write_twists(dt, model, state, workspace)
        for i in range(n):
            vector[i] = workspace.momentum[i]
            for j in range(n):
                matrix[i, j] = 0.0
        run_parallel_loop(SUM_CONTACTS, model, tree, neighbour_lists, surfaces, state, workspace)
        for pair in range(len(model.pairs)):
            a, b = model.sensor_body[model.pairs[pair, 0]], model.target_body[model.pairs[pair, 1]]
            if model.at[a] >= 0 or model.at[b] >= 0:
                add_pair_to_system(pair, a, b, dt, model, state, workspace)
        if n == 0:
            return
        for body in range(len(model.kind)):
            if model.kind[body] == FREE:
                at = model.at[body]
                for i in range(3):
                    matrix[at + i, at + i] += model.mass[body]
                    for j in range(i + 1):
                        matrix[at + 3 + i, at + 3 + j] += workspace.inertia[body, i, j]
        if len(model.drives) > 0:
            add_actuators(dt, turn > 0, commands, model, state, workspace)
        solve_positive_definite(matrix, vector, n)
        change, given = 0.0, 0.0  # lengths, so that a scene that is turned as a whole takes the same rounds
        for i in range(n):
            change += (vector[i] - guess[i]) ** 2
            given += (vector[i] - workspace.alone[i]) ** 2
        change, given = math.sqrt(change), math.sqrt(given)
        # Contacts that come on and off in the first rounds find their own way; later ones shrink by 1 - share if all is well.
        if turn > 3 and change > (1.0 - 0.25 * share) * last_change:
            share *= 0.5
        # Drives are without limits in the first round: what it changes says nothing yet.
        last = (turn > 0 or len(model.drives) == 0) and (change <= CONVERGED * given or change < 1e-13)
        write_pair_forces(model, state, workspace)
        _update_guess(share, not last and share == 1.0 and change < 0.9 * last_change, n, workspace)
        if last:
            break
        last_change = change
    _write_twists(dt, model, state, workspace)


@kernel
def _update_guess(share, ahead, n, workspace):
    """Guess anew from what a round has found (`vector`): a share of the way there, or further `ahead`.

    Rounds that close in on the solution do so by about the same factor each, most of all friction's. From the last two the
    secant tells where they will end (Anderson, J. ACM 12, 1965, with one earlier round).
    """
    vector, guess, earlier = workspace.vector, workspace.guess, workspace.earlier
    along, square = 0.0, 0.0
    for i in range(n):
        change = vector[i] - guess[i]
        bend = change - earlier[1, i]
        along += change * bend
        square += bend * bend
    further = along / square if ahead and square > 0.0 else 0.0
    for i in range(n):
        found, change = vector[i], vector[i] - guess[i]
        guess[i] = share * (found - further * (found - earlier[0, i])) + (1.0 - share) * guess[i]
        earlier[0, i], earlier[1, i] = found, change
    for pair in range(len(workspace.counted)):  # forces are mixed as velocities are, so that both belong together
        for i in range(6):
            found, before = workspace.found[pair, i], workspace.found_before[pair, i]
            workspace.force[pair, i] = share * (found - further * (found - before)) + (1.0 - share) * workspace.force[pair, i]
            workspace.found_before[pair, i] = found


@inlined
def _initial_guess(dt, model, state, workspace):
    """Velocities as they are for a first guess, and what momentum the bodies would have without contacts and drives."""
    momentum, guess, alone, velocity = workspace.momentum, workspace.guess, workspace.alone, state.velocity
    for body in range(len(model.kind)):
        at = model.at[body]
        if model.kind[body] == FREE:
            inertia, spin = workspace.inertia[body], velocity[body, 3:]
            lx, ly, lz = matrix_times_vector(inertia, spin[0], spin[1], spin[2])
            mean = mean_angular_velocity(workspace.rotation[body], model.inverse_inertia[body], lx, ly, lz, dt)
            # The spin that is solved for is the mean over the step, so that a body tumbles as it should.
            for i in range(3):
                guess[at + i] = velocity[body, i]
                alone[at + i] = velocity[body, i] + dt * model.gravity[i]
                momentum[at + i] = model.mass[body] * alone[at + i]
                guess[at + 3 + i] = alone[at + 3 + i] = workspace.before[body, 3 + i] = mean[i]
                workspace.tumbling[body, i] = mean[i] - spin[i]
            momentum[at + 3], momentum[at + 4], momentum[at + 5] = matrix_times_vector(inertia, mean[0], mean[1], mean[2])
        elif model.kind[body] == KEYFRAMED:
            write_twist(velocity[body], dt, workspace.twist[body])
            for i in range(12):
                workspace.known[body, i] = workspace.twist[body, i]
    for drive in range(len(model.drives)):
        at = model.drive_at[drive]
        guess[at] = alone[at] = state.drives[drive, SPEED]
        momentum[at] = workspace.drive_mass[drive] * guess[at] - workspace.drive_load[drive]


@kernel
def _write_twists(dt, model, state, workspace):
    """Velocities and twists that follow from the guess, and the part of the twists that is not solved for.

    That is a finite turn's excess over ``ω × r`` of a free body, and what its carrier does of a driven one.
    """
    guess, velocity, twist, known = workspace.guess, state.velocity, workspace.twist, workspace.known
    for body in range(len(model.kind)):
        at = model.at[body]
        if model.kind[body] == FREE:
            for i in range(6):
                velocity[body, i] = guess[at + i]
            write_twist(velocity[body], dt, twist[body])
            for i in range(3):
                known[body, i] = 0.0
            for i in range(3, 12):
                known[body, i] = twist[body, i]
            known[body, 4] += velocity[body, 5]
            known[body, 5] -= velocity[body, 4]
            known[body, 6] -= velocity[body, 5]
            known[body, 8] += velocity[body, 3]
            known[body, 9] += velocity[body, 4]
            known[body, 10] -= velocity[body, 3]
        elif model.kind[body] == DRIVEN:
            for i in range(6):
                velocity[body, i] = workspace.carried[body, i]
            write_twist(velocity[body], dt, known[body])
            for i in range(3):
                velocity[body, i] += guess[at] * workspace.axis[body, i]
            write_twist(velocity[body], dt, twist[body])
