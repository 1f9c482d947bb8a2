# SPDX-License-Identifier: GPL-3.0-or-later
"""The loops over pairs in a step, whose pairs are divided among threads (kernels)."""

from __future__ import annotations

from ..compiled.kernels import inlined, kernel
from ..compiled.thread_team import (
    LATE_LOOPS,
    SPINS,
    all_items_done,
    begin_loop,
    claim_item,
    finish_item,
    is_stopped,
    wait_briefly,
)
from ..geometry.rotations import write_rotation
from .detection.detection_data import DetectionData
from .detection.narrow_phase import find_contacts
from .detection.surface_kinematics import finish_contacts
from .dynamics.contact_assembly import sum_pair_contacts
from .dynamics.friction_state import update_pair_friction
from .solver_model import SolverModel, State
from .workspace import Workspace

FIND_CONTACTS, SUM_CONTACTS, UPDATE_FRICTION = 2, 3, 4
"""Numbers of the loops in the queue. :mod:`.thread_team` has the numbers 0 (idle) and 1 (stop)."""


@inlined
def find_all_contacts(dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> int:
    """Find the contacts of all pairs where the bodies are now, and return how many points are pressed too deep to act.

    `dt` is the length of the step that begins, or minus the length of the step that has ended (see :func:`.finish_contacts`).
    """
    for body in range(len(state.position)):
        write_rotation(state.quaternion[body], workspace.bodies.rotation[body])
    workspace.step[0] = dt
    run_parallel_loop(FIND_CONTACTS, model, detection, state, workspace)
    return workspace.contacts.too_deep.sum()


@inlined
def run_parallel_loop(loop: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Run a loop over all pairs, alone or with helper threads.

    Surfaces that deform are brought to the present moment when they are first asked for, so then one thread works alone.
    """
    queue, pairs = workspace.queue, len(model.pairs.sensor)
    if len(queue) == 0 or pairs == 1 or detection.surfaces.any_deforms[0]:
        for pair in range(pairs):
            _run_item(loop, pair, model, detection, state, workspace)
        return
    begin_loop(queue, loop)
    pair = 0
    while pair < pairs:
        _, pair = claim_item(queue, pairs)
        if pair < pairs:
            _run_item(loop, pair, model, detection, state, workspace)
            finish_item(queue)
    waits = 0
    while not all_items_done(queue, pairs):
        wait_briefly(queue, waits)
        waits += 1
    if waits >= SPINS:
        queue[LATE_LOOPS] += 1


@kernel
def help_with_loops(model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Work on the loops that :func:`run_parallel_loop` puts into the queue, until the queue says stop."""
    queue, pairs, waits = workspace.queue, len(model.pairs.sensor), 0
    while not is_stopped(queue):
        loop, pair = claim_item(queue, pairs)
        if pair < pairs:
            _run_item(loop, pair, model, detection, state, workspace)
            finish_item(queue)
            waits = 0
        else:
            wait_briefly(queue, waits)
            waits += 1


@inlined
def _run_item(loop: int, pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Run one pair of a loop. What it writes belongs to this pair alone."""
    dt = workspace.step[0]
    if loop == FIND_CONTACTS:
        find_contacts(pair, model, detection, state, workspace)
        if workspace.contacts.number[pair] > 0:
            finish_contacts(pair, dt, model, detection, state, workspace)
    elif workspace.contacts.number[pair] > 0:
        if loop == SUM_CONTACTS:
            sum_pair_contacts(pair, dt, model, state, workspace)
        else:  # UPDATE_FRICTION
            update_pair_friction(pair, dt, model, detection.surfaces, state, workspace)
