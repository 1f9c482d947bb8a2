# SPDX-License-Identifier: GPL-3.0-or-later
"""The loops over pairs in a step, whose pairs are divided among threads (kernels)."""

from __future__ import annotations

from ..compiled.kernels import (
    address_of,
    addressed_kernel,
    are_interpreted,
    call_address,
    inlined,
    kernel,
    with_plain_form,
)
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
from ..effects.engine.compiled_program import prepare_laws
from ..geometry.rotations import write_rotation
from .detection.detection_data import DetectionData
from .detection.narrow_phase import find_contacts, write_last_contacts
from .detection.surface_kinematics import finish_contacts
from .dynamics.contact_assembly import sum_pair_contacts
from .dynamics.friction_state import update_pair_friction
from .solver_model import SolverModel, State
from .workspace import Workspace

FIND_CONTACTS, SUM_CONTACTS, UPDATE_FRICTION, WRITE_CONTACTS = 2, 3, 4, 5
"""Numbers of the loops in the queue. :mod:`.thread_team` has the numbers 0 (idle) and 1 (stop)."""


@addressed_kernel
def find_pair_contacts(
    pair: int, dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Find the contacts of one pair."""
    find_contacts(pair, model, detection, state, workspace)
    if workspace.contacts.number[pair] > 0:
        finish_contacts(pair, dt, model, detection, state, workspace)


@addressed_kernel
def write_pair_contacts(
    pair: int, dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Write the contacts of one pair that were found last, when the bodies have not moved since."""
    write_last_contacts(pair, model, detection, state, workspace)
    if workspace.contacts.number[pair] > 0:
        finish_contacts(pair, dt, model, detection, state, workspace)


PAIR_LOOPS = {
    FIND_CONTACTS: find_pair_contacts,
    SUM_CONTACTS: sum_pair_contacts,
    UPDATE_FRICTION: update_pair_friction,
    WRITE_CONTACTS: write_pair_contacts,
}
"""Work of each loop on a pair. It writes only to memory of this pair."""


def prepare_pair_loops(model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Compile what the loops do with a pair, unless that was done, and write the addresses into the workspace.

    The laws of effects, which these functions call, are compiled as well. Kernels call these functions, which contain most of a
    step's arithmetic, by address, so that they are compiled once and not inside each of their callers. A call takes no time
    beside the work on a pair.
    """
    if workspace.pair_loops[FIND_CONTACTS] == 0 and not are_interpreted():
        prepare_laws(model.effects)
        for loop, function in PAIR_LOOPS.items():
            workspace.pair_loops[loop] = address_of(function, 0, 0.0, model, detection, state, workspace)


def _run_item_plain(
    loop: int, pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Do as :func:`_run_item` without compiled code."""
    PAIR_LOOPS[loop](pair, workspace.step[0], model, detection, state, workspace)


@with_plain_form(_run_item_plain)
@kernel
def _run_item(loop: int, pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Run one pair of a loop."""
    call_address(workspace.pair_loops[loop], pair, workspace.step[0], model, detection, state, workspace)


@inlined
def find_all_contacts(dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> int:
    """Find the contacts of all pairs where the bodies are now, and return how many points are pressed too deep to act.

    `dt` is the length of the step that begins, or minus the length of the step that has ended (see :func:`.finish_contacts`).
    """
    _run_at_bodies(FIND_CONTACTS, dt, model, detection, state, workspace)
    too_deep = 0
    for pair in range(len(model.pairs.sensor)):
        too_deep += workspace.contacts.too_deep[pair]
    return too_deep


@inlined
def write_all_contacts(dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Do as :func:`find_all_contacts` where contacts were found last at the poses where the bodies are now."""
    _run_at_bodies(WRITE_CONTACTS, dt, model, detection, state, workspace)


@inlined
def _run_at_bodies(
    loop: int, dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Run a loop that looks where the bodies are."""
    for body in range(len(state.position)):
        write_rotation(state.quaternion[body], workspace.bodies.rotation[body])
    workspace.step[0] = dt
    run_parallel_loop(loop, model, detection, state, workspace)


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
