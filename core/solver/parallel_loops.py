# SPDX-License-Identifier: GPL-3.0-or-later
"""The phases of a step whose pairs are shared out among threads (kernels)."""

from __future__ import annotations

from ..compiled.kernels import inlined, kernel
from ..compiled.thread_team import LATE, SPINS, announce, hand_in, is_over, is_stopped, linger, take
from ..geometry.rotations import write_rotation
from .detection.narrow_phase import gather
from .dynamics.contact_assembly import sum_pair
from .dynamics.friction_state import bend_pair

GATHER, SUM, BEND = 2, 3, 4
"""Phases of a step whose pairs are shared out: find the contacts, sum them up, bend the bristles."""


@inlined
def gather_all(dt, world, tree, neighbours, shapes, state, scratch):
    """Contacts of all pairs of sensor and target where the bodies are now. Returns how many points are sunk too deep to act."""
    for body in range(len(state.position)):
        write_rotation(state.quaternion[body], scratch.rotation[body])
    scratch.step[0] = dt
    share_out(GATHER, world, tree, neighbours, shapes, state, scratch)
    return scratch.sunk.sum()


@inlined
def share_out(phase, world, tree, neighbours, shapes, state, scratch):
    """Do a phase for all pairs, alone or with helpers; surfaces that deform are moved on when first asked for, so alone."""
    board, pairs = scratch.board, len(world.pairs)
    if len(board) == 0 or pairs == 1 or shapes.moves[0]:
        for pair in range(pairs):
            _do(phase, pair, world, tree, neighbours, shapes, state, scratch)
        return
    announce(board, phase)
    pair = 0
    while pair < pairs:
        _, pair = take(board, pairs)
        if pair < pairs:
            _do(phase, pair, world, tree, neighbours, shapes, state, scratch)
            hand_in(board)
    turn = 0
    while not is_over(board, pairs):
        linger(board, turn)
        turn += 1
    if turn >= SPINS:
        board[LATE] += 1


@kernel
def help_out(world, tree, neighbours, shapes, state, scratch):
    """Do what :func:`share_out` puts on the board, until it says that the helpers may go home."""
    board, pairs, turn = scratch.board, len(world.pairs), 0
    while not is_stopped(board):
        phase, pair = take(board, pairs)
        if pair < pairs:
            _do(phase, pair, world, tree, neighbours, shapes, state, scratch)
            hand_in(board)
            turn = 0
        else:
            linger(board, turn)
            turn += 1


@inlined
def _do(phase, pair, world, tree, neighbours, shapes, state, scratch):
    """One phase of one pair. What it writes belongs to this pair alone."""
    dt = scratch.step[0]
    if phase == GATHER:
        gather(pair, dt, world, tree, neighbours, shapes, state, scratch)
    elif scratch.contacts[pair] > 0:
        if phase == SUM:
            sum_pair(pair, dt, world, state, scratch)
        else:
            bend_pair(pair, dt, world, shapes, state, scratch)
