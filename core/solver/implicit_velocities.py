# SPDX-License-Identifier: GPL-3.0-or-later
"""The velocities at a substep's end (kernels).

They are the unknowns of a linear system, implicit in the stiffness and damping of every contact, so that a stiff or heavily
damped contact needs no small step.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..geometry.rotations import solve_positive_definite
from .detection.detection_data import DetectionData
from .dynamics.actuators import SPEED, add_actuators
from .dynamics.linear_system import MAX_BISECTIONS, add_pair_to_system, check_energy, reset_force_scales, write_pair_forces
from .dynamics.modes import add_mass, write_guess, write_motion
from .parallel_loops import SUM_CONTACTS, run_parallel_loop
from .solver_model import SolverModel, State
from .workspace import Workspace

MAX_ITERATIONS = 40
"""Most iterations, in which contacts are linearised again, within a substep; four or five are usual, one at rest."""

CONVERGED = 1e-9
"""The iterations end when one changes less than this share of the velocity that contacts give in the step."""


@inlined
def solve_velocities(
    dt: float, commands: np.ndarray, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Solve for the velocities of free and driven bodies at the step's end, and write them into the state.

    Contacts and drives are linearised at the current guess and the linear system is solved, until the guess no longer moves; a
    contact that would pull is left out of the next iteration. A converging sequence is accelerated by a secant. Where the
    iterations cycle (friction that was guessed for too large a load separates the contact, and without the contact there is no
    friction), the guess moves by a share of the way only. Every mixture of iterates keeps the momentum. With nothing to solve
    for, a single iteration only linearises. Where contacts would give more energy than was put into them
    (see :func:`.check_energy`), their forces are scaled down.
    """
    _write_initial_guess(dt, model, state, workspace)
    reset_force_scales(model, state, workspace)
    for bisection in range(MAX_BISECTIONS):
        _iterate(dt, commands, model, detection, state, workspace)
        if model.bodies.unknowns == 0 or check_energy(bisection, dt, model, state, workspace):
            break


@inlined
def _iterate(
    dt: float, commands: np.ndarray, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Solve for the velocities with the present factors on the pairs' forces, starting from the present guess."""
    system, bodies, pairs = workspace.system, model.bodies, model.pairs
    vector, guess, n = system.vector, system.guess, bodies.unknowns
    last_change, share = 0.0, 1.0
    for iteration in range(MAX_ITERATIONS):
        _write_step_motions(dt, model, state, workspace)
        for i in range(n):
            vector[i] = system.momentum[i]
            for j in range(n):
                system.matrix[i, j] = 0.0
        run_parallel_loop(SUM_CONTACTS, model, detection, state, workspace)
        for pair in range(len(pairs.sensor)):
            a, b = pairs.sensor_body[pair], pairs.target_body[pair]
            if bodies.first_unknown[a] >= 0 or bodies.first_unknown[b] >= 0:
                add_pair_to_system(pair, dt, model, state, workspace)
        if n == 0:
            return
        for body in range(len(bodies.mode)):
            add_mass(body, model, workspace)
        if len(model.drives.gains) > 0:
            add_actuators(dt, iteration > 0, commands, model, state, workspace)
        solve_positive_definite(system.matrix, vector, n)
        change, given = 0.0, 0.0  # Euclidean lengths, so that a scene that is rotated as a whole takes the same iterations
        for i in range(n):
            change += (vector[i] - guess[i]) ** 2
            given += (vector[i] - system.free_solution[i]) ** 2
        change, given = math.sqrt(change), math.sqrt(given)
        # In the first iterations contacts open and close; later changes should shrink by the factor 1 - share.
        if iteration > 3 and change > (1.0 - 0.25 * share) * last_change:
            share *= 0.5
        # Drives are without limits in the first iteration: its change is no criterion.
        last = (iteration > 0 or len(model.drives.gains) == 0) and (change <= CONVERGED * given or change < 1e-13)
        write_pair_forces(model, state, workspace)
        _update_guess(share, not last and share == 1.0 and change < 0.9 * last_change, n, workspace)
        if last:
            break
        last_change = change
    _write_step_motions(dt, model, state, workspace)


@kernel
def _update_guess(share: float, accelerate: bool, n: int, workspace: Workspace) -> None:
    """Make a new guess from the solution of an iteration: a share of the way there, or beyond it where `accelerate` is true.

    A converging sequence shrinks by about the same factor in each iteration. The secant through the last two tells where it
    will end (Anderson, J. ACM 12, 1965, with one earlier iterate).
    """
    energy, system = workspace.energy, workspace.system
    vector, guess, previous = system.vector, system.guess, system.previous
    along, square = 0.0, 0.0
    for i in range(n):
        change = vector[i] - guess[i]
        difference = change - previous[1, i]
        along += change * difference
        square += difference * difference
    further = along / square if accelerate and square > 0.0 else 0.0
    for i in range(n):
        found, change = vector[i], vector[i] - guess[i]
        guess[i] = share * (found - further * (found - previous[0, i])) + (1.0 - share) * guess[i]
        previous[0, i], previous[1, i] = found, change
    for pair in range(len(energy.tracked)):  # forces are mixed as velocities are, so that both belong together
        for i in range(6):
            found, before = energy.new_force[pair, i], energy.previous_force[pair, i]
            energy.force[pair, i] = share * (found - further * (found - before)) + (1.0 - share) * energy.force[pair, i]
            energy.previous_force[pair, i] = found


@inlined
def _write_initial_guess(dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the present velocities as the first guess, and the bodies' momentum without contacts and drives."""
    for body in range(len(model.bodies.mode)):
        write_guess(body, dt, model, state, workspace)
    system = workspace.system
    for drive in range(len(model.drives.gains)):
        at = model.drives.unknown[drive]
        system.guess[at] = system.free_solution[at] = state.drives[drive, SPEED]
        system.momentum[at] = workspace.drives.mass[drive] * system.guess[at] - workspace.drives.load[drive]


@kernel
def _write_step_motions(dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the velocities and step motions that follow from the guess."""
    for body in range(len(model.bodies.mode)):
        write_motion(body, dt, model, state, workspace)
