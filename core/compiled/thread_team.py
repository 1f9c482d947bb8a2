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

POINTS_PER_THREAD = 2000
"""Contact points from which on a second thread is worth while; each further one asks for as many again."""

# Places on the board, each in a cache line of its own.
NEXT_ITEM, ITEMS_DONE = 0, 8  # phase · LOOP_FACTOR + the next piece; how many pieces of the phase are done
YIELD_ADDRESS = 16  # address of the system's function that lets other threads run
LOOPS, LATE_LOOPS = 17, 18  # how many phases there were in a frame, and in how many a helper kept the others waiting
FRAMES_ALONE = 19  # for how many frames to come no helper is called
QUEUE_SIZE = 24
LOOP_FACTOR = 1 << 32
IDLE, STOP = 0, 1  # phases in which there is nothing to do for helpers; other numbers are the caller's
SPINS = 2000
"""Looks at the board before a waiting thread lets others run: a few pieces' time."""
MAX_LATE_SHARE, SINGLE_THREAD_FRAMES = 0.05, 20
"""Share of late phases above which the processors are taken to be busy with other work, and for how many frames."""

if COMPILED:
    from llvmlite import ir
    from numba.core import types
    from numba.core.cgutils import get_or_insert_function
    from numba.extending import intrinsic

    def _element_pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
        """Pointer to an element of a one-dimensional array."""
        return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])

    @intrinsic
    def atomic_add(typingctx, queue, place, value):
        """Add to a place on the board and return what was there before, in one go for all threads."""

        def codegen(context, builder, signature, arguments):
            pointer = _element_pointer(context, builder, signature.args[0], *arguments[:2])
            return builder.atomic_rmw("add", pointer, arguments[2], "seq_cst")

        return types.int64(queue, types.int64, types.int64), codegen

    @intrinsic
    def atomic_load(typingctx, queue, place):
        """Read a place on the board, and all that was written before its value was."""

        def codegen(context, builder, signature, arguments):
            return builder.load_atomic(_element_pointer(context, builder, signature.args[0], *arguments), "seq_cst", 8)

        return types.int64(queue, types.int64), codegen

    @intrinsic
    def atomic_store(typingctx, queue, place, value):
        """Write a place on the board, after all that was written before."""

        def codegen(context, builder, signature, arguments):
            builder.store_atomic(
                arguments[2], _element_pointer(context, builder, signature.args[0], *arguments[:2]), "seq_cst", 8
            )
            return context.get_dummy_value()

        return types.void(queue, types.int64, types.int64), codegen

    @intrinsic
    def _call_address(typingctx, address):
        """Call the function without arguments that is at an address."""

        def codegen(context, builder, signature, arguments):
            function = ir.FunctionType(ir.IntType(32), [])
            builder.call(builder.inttoptr(arguments[0], function.as_pointer()), [])
            return context.get_dummy_value()

        return types.void(types.int64), codegen

    @intrinsic
    def _cpu_pause(typingctx):
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
def begin_loop(queue, phase):
    """Begin a phase: its pieces may be taken from now on."""
    queue[LOOPS] += 1
    atomic_store(queue, ITEMS_DONE, 0)
    atomic_store(queue, NEXT_ITEM, phase * LOOP_FACTOR)


@inlined
def claim_item(queue, pieces):
    """Take a piece; returns the phase and the piece, REST and `pieces` when there is none."""
    ticket = atomic_load(queue, NEXT_ITEM)
    if ticket % LOOP_FACTOR < pieces and ticket // LOOP_FACTOR > STOP:
        ticket = atomic_add(queue, NEXT_ITEM, 1)  # by now of a later phase, maybe
        if ticket % LOOP_FACTOR < pieces and ticket // LOOP_FACTOR > STOP:
            return ticket // LOOP_FACTOR, ticket % LOOP_FACTOR
    return IDLE, pieces


@inlined
def finish_item(queue):
    """One piece is done."""
    atomic_add(queue, ITEMS_DONE, 1)


@inlined
def all_items_done(queue, pieces):
    """Whether all pieces of the phase are done."""
    return atomic_load(queue, ITEMS_DONE) >= pieces


@inlined
def is_stopped(queue):
    """Whether helpers may go home."""
    return atomic_load(queue, NEXT_ITEM) // LOOP_FACTOR == STOP


@kernel
def wait_briefly(queue, turn):
    """Wait a moment, for the `turn`-th time in a row."""
    _cpu_pause()
    if turn % SPINS == SPINS - 1:
        _call_address(queue[YIELD_ADDRESS])


def make_queue(points: int, threads: int | None = None) -> tuple[np.ndarray, int]:
    """Return a board and how many helpers shall look at it.

    Parameters
    ----------
    points : int
        Contact points of all pairs.
    threads : int, optional
        How many to use; otherwise the environment variable ``PALPATE_THREADS``, or as many as are worth while and there are.

    Returns
    -------
    board : (QUEUE_SIZE,) int, or (0,) without helpers
    helpers : int
    """
    threads = threads or int(os.environ.get("PALPATE_THREADS", "0")) or min(_processors(), 1 + points // POINTS_PER_THREAD)
    if not COMPILED or threads < 2:
        return np.zeros(0, np.int64), 0
    queue = np.zeros(QUEUE_SIZE, np.int64)
    queue[YIELD_ADDRESS] = _address_of_yield()
    return queue, threads - 1


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
def helper_threads(queue: np.ndarray, number: int, work: Callable[..., Any], *arguments: Any) -> Iterator[None]:
    """Have `number` threads run ``work(*arguments)`` meanwhile, which is to return when the board says STOP.

    Where the processors are busy with other work a helper is sent away in the middle of a piece, and all wait for it: after a
    frame in which that was often so, none is called for a while.
    """
    if number == 0 or queue[FRAMES_ALONE] > 0:
        if number > 0:
            queue[FRAMES_ALONE] -= 1
        yield
        return
    queue[LOOPS] = queue[LATE_LOOPS] = 0
    queue[NEXT_ITEM] = IDLE * LOOP_FACTOR
    threads = [threading.Thread(target=work, args=arguments, name="palpate helper", daemon=True) for _ in range(number)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        queue[NEXT_ITEM] = STOP * LOOP_FACTOR
        for thread in threads:
            thread.join()
        if queue[LATE_LOOPS] > MAX_LATE_SHARE * queue[LOOPS]:
            queue[FRAMES_ALONE] = SINGLE_THREAD_FRAMES
