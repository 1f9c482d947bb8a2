# SPDX-License-Identifier: GPL-3.0-or-later
"""The phases of a step whose pairs are shared out among threads (kernels)."""

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
from .detection.narrow_phase import find_contacts
from .dynamics.contact_assembly import sum_pair_contacts
from .dynamics.friction_state import update_pair_friction

FIND_CONTACTS, SUM_CONTACTS, UPDATE_FRICTION = 2, 3, 4
"""Phases of a step whose pairs are shared out: find the contacts, sum them up, bend the bristles."""


@inlined
def find_all_contacts(dt, model, tree, neighbour_lists, surfaces, state, workspace):
    """Contacts of all pairs of sensor and target where the bodies are now. Returns how many points are sunk too deep to act."""
    for body in range(len(state.position)):
        write_rotation(state.quaternion[body], workspace.rotation[body])
    workspace.step[0] = dt
    run_parallel_loop(FIND_CONTACTS, model, tree, neighbour_lists, surfaces, state, workspace)
    return workspace.too_deep.sum()


@inlined
def run_parallel_loop(phase, model, tree, neighbour_lists, surfaces, state, workspace):
    """Do a phase for all pairs, alone or with helpers; surfaces that deform are moved on when first asked for, so alone."""
    queue, pairs = workspace.queue, len(model.pairs)
    if len(queue) == 0 or pairs == 1 or surfaces.moves[0]:
        for pair in range(pairs):
            _run_item(phase, pair, model, tree, neighbour_lists, surfaces, state, workspace)
        return
    begin_loop(queue, phase)
    pair = 0
    while pair < pairs:
        _, pair = claim_item(queue, pairs)
        if pair < pairs:
            _run_item(phase, pair, model, tree, neighbour_lists, surfaces, state, workspace)
            finish_item(queue)
    turn = 0
    while not all_items_done(queue, pairs):
        wait_briefly(queue, turn)
        turn += 1
    if turn >= SPINS:
        queue[LATE_LOOPS] += 1


@kernel
def help_with_loops(model, tree, neighbour_lists, surfaces, state, workspace):
    """Do what :func:`run_parallel_loop` puts on the board, until it says that the helpers may go home."""
    queue, pairs, turn = workspace.queue, len(model.pairs), 0
    while not is_stopped(queue):
        phase, pair = claim_item(queue, pairs)
        if pair < pairs:
            _run_item(phase, pair, model, tree, neighbour_lists, surfaces, state, workspace)
            finish_item(queue)
            turn = 0
        else:
            wait_briefly(queue, turn)
            turn += 1


@inlined
def _run_item(phase, pair, model, tree, neighbour_lists, surfaces, state, workspace):
    """One phase of one pair. What it writes belongs to this pair alone."""
    dt = workspace.step[0]
    if phase == FIND_CONTACTS:
        find_contacts(pair, dt, model, tree, neighbour_lists, surfaces, state, workspace)
    elif workspace.contacts[pair] > 0:
        if phase == SUM_CONTACTS:
            sum_pair_contacts(pair, dt, model, state, workspace)
        else:
            update_pair_friction(pair, dt, model, surfaces, state, workspace)
