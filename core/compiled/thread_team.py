# SPDX-License-Identifier: GPL-3.0-or-later
"""Several threads for the work of one step: who is free takes the next piece.

A step has a few phases, each of many pieces that do not depend on one another. The thread that runs the step says on a board
which phase it is; it and its helpers then take pieces until there are none left. It never waits for a helper to come, only for
pieces that one has taken, so a busy machine makes it no slower than alone. Which thread does a piece changes no bit of it, and
what the pieces sum up to is added in their order.

Helpers last for one frame. They are plain Python threads inside a kernel, which lets the interpreter go: nothing of Blender is
touched, no pool stays behind, and several simulations may run beside one another (numba's own thread pools forbid that or spin
between frames).
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from .kernels import COMPILED, inlined, kernel

ENOUGH = 2000
"""Contact points from which on a second thread is worth while; each further one asks for as many again."""

# Places on the board, each in a cache line of its own.
TICKET, DONE = 0, 8  # phase · PIECES + the next piece; how many pieces of the phase are done
YIELD = 16  # address of the system's function that lets other threads run
PHASES, LATE = 17, 18  # how many phases there were in a frame, and in how many a helper kept the others waiting
ALONE = 19  # for how many frames to come no helper is called
BOARD = 24
PIECES = 1 << 32
REST, STOP = 0, 1  # phases in which there is nothing to do for helpers; other numbers are the caller's
SPINS = 2000
"""Looks at the board before a waiting thread lets others run: a few pieces' time."""
PATIENCE, SOLITUDE = 0.05, 20
"""Share of late phases above which the processors are taken to be busy with other work, and for how many frames."""

if COMPILED:
    from llvmlite import ir
    from numba.core import types
    from numba.core.cgutils import get_or_insert_function
    from numba.extending import intrinsic

    def _place(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
        """Pointer to an element of a one-dimensional array."""
        return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])

    @intrinsic
    def add(typingctx, board, place, value):
        """Add to a place on the board and return what was there before, in one go for all threads."""

        def codegen(context, builder, signature, arguments):
            pointer = _place(context, builder, signature.args[0], *arguments[:2])
            return builder.atomic_rmw("add", pointer, arguments[2], "seq_cst")

        return types.int64(board, types.int64, types.int64), codegen

    @intrinsic
    def look(typingctx, board, place):
        """Read a place on the board, and all that was written before its value was."""

        def codegen(context, builder, signature, arguments):
            return builder.load_atomic(_place(context, builder, signature.args[0], *arguments), "seq_cst", 8)

        return types.int64(board, types.int64), codegen

    @intrinsic
    def put(typingctx, board, place, value):
        """Write a place on the board, after all that was written before."""

        def codegen(context, builder, signature, arguments):
            builder.store_atomic(arguments[2], _place(context, builder, signature.args[0], *arguments[:2]), "seq_cst", 8)
            return context.get_dummy_value()

        return types.void(board, types.int64, types.int64), codegen

    @intrinsic
    def _call(typingctx, address):
        """Call the function without arguments that is at an address."""

        def codegen(context, builder, signature, arguments):
            function = ir.FunctionType(ir.IntType(32), [])
            builder.call(builder.inttoptr(arguments[0], function.as_pointer()), [])
            return context.get_dummy_value()

        return types.void(types.int64), codegen

    @intrinsic
    def _pause(typingctx):
        """Tell the processor that this thread only waits."""
        machine = platform.machine().lower()

        def codegen(context, builder, signature, arguments):
            if machine in ("x86_64", "amd64"):
                pause = ir.FunctionType(ir.VoidType(), [])
                builder.call(get_or_insert_function(builder.module, pause, "llvm.x86.sse2.pause"), [])
            elif machine in ("arm64", "aarch64"):
                hint = ir.FunctionType(ir.VoidType(), [ir.IntType(32)])
                builder.call(get_or_insert_function(builder.module, hint, "llvm.aarch64.hint"), [ir.IntType(32)(1)])
            return context.get_dummy_value()

        return types.void(), codegen


@inlined
def announce(board, phase):
    """Begin a phase: its pieces may be taken from now on."""
    board[PHASES] += 1
    put(board, DONE, 0)
    put(board, TICKET, phase * PIECES)


@inlined
def take(board, pieces):
    """Take a piece; returns the phase and the piece, REST and `pieces` when there is none."""
    ticket = look(board, TICKET)
    if ticket % PIECES < pieces and ticket // PIECES > STOP:
        ticket = add(board, TICKET, 1)  # by now of a later phase, maybe
        if ticket % PIECES < pieces and ticket // PIECES > STOP:
            return ticket // PIECES, ticket % PIECES
    return REST, pieces


@inlined
def hand_in(board):
    """One piece is done."""
    add(board, DONE, 1)


@inlined
def is_over(board, pieces):
    """Whether all pieces of the phase are done."""
    return look(board, DONE) >= pieces


@inlined
def is_stopped(board):
    """Whether helpers may go home."""
    return look(board, TICKET) // PIECES == STOP


@kernel
def linger(board, turn):
    """Wait a moment, for the `turn`-th time in a row."""
    _pause()
    if turn % SPINS == SPINS - 1:
        _call(board[YIELD])


def board_for(points: int, threads: int | None = None) -> tuple[np.ndarray, int]:
    """Return a board and how many helpers shall look at it.

    Parameters
    ----------
    points : int
        Contact points of all pairs.
    threads : int, optional
        How many to use; otherwise the environment variable ``PALPATE_THREADS``, or as many as are worth while and there are.

    Returns
    -------
    board : (BOARD,) int, or (0,) without helpers
    helpers : int
    """
    threads = threads or int(os.environ.get("PALPATE_THREADS", "0")) or min(_processors(), 1 + points // ENOUGH)
    if not COMPILED or threads < 2:
        return np.zeros(0, np.int64), 0
    board = np.zeros(BOARD, np.int64)
    board[YIELD] = _address_of_yield()
    return board, threads - 1


def _processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _address_of_yield() -> int:
    if sys.platform == "win32":
        function = ctypes.WinDLL("kernel32").SwitchToThread
    else:
        function = ctypes.CDLL(None).sched_yield
    return ctypes.cast(function, ctypes.c_void_p).value or 0


@contextmanager
def helpers(board: np.ndarray, number: int, work: Callable[..., Any], *arguments: Any) -> Iterator[None]:
    """Have `number` threads run ``work(*arguments)`` meanwhile, which is to return when the board says STOP.

    Where the processors are busy with other work a helper is sent away in the middle of a piece, and all wait for it: after a
    frame in which that was often so, none is called for a while.
    """
    if number == 0 or board[ALONE] > 0:
        if number > 0:
            board[ALONE] -= 1
        yield
        return
    board[PHASES] = board[LATE] = 0
    board[TICKET] = REST * PIECES
    threads = [threading.Thread(target=work, args=arguments, name="palpate helper", daemon=True) for _ in range(number)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        board[TICKET] = STOP * PIECES
        for thread in threads:
            thread.join()
        if board[LATE] > PATIENCE * board[PHASES]:
            board[ALONE] = SOLITUDE
