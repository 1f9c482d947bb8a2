# SPDX-License-Identifier: GPL-3.0-or-later
"""Several threads for the loops of one step: a free thread takes the next item.

A step has a few loops, each over many items that do not depend on one another. The thread that runs the step announces a loop
in a queue; it and its helpers then take items until none is left. It never waits for a helper to start, only for items that a
helper has taken, so a busy machine makes it no slower than a single thread. Which thread works on an item changes no bit of the
result, and sums over the items are added in the items' order.

Helpers last for one frame. They are Python threads inside a kernel, which releases the interpreter: nothing of Blender is
touched, no pool stays behind, and several simulations may run at the same time (numba's own thread pools forbid that or spin
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

from .kernels import COMPILED, are_interpreted, inlined, kernel
from .numba_internals import get_or_insert_function, intrinsic, ir, types

POINTS_PER_THREAD = 2000
"""A second thread is used from this number of contact points on; each further thread needs as many again."""

# Places in the queue; those that several threads write have a cache line of their own.
NEXT_ITEM, ITEMS_DONE = 0, 8  # loop · LOOP_FACTOR + the next item; how many items of the loop are done
YIELD_ADDRESS = 16  # address of the system's function that lets other threads run
LOOPS, LATE_LOOPS = 17, 18  # how many loops a frame had, and in how many of them a helper kept the others waiting
FRAMES_ALONE = 19  # for how many frames to come no helper is started
QUEUE_SIZE = 24
LOOP_FACTOR = 1 << 32
IDLE, STOP = 0, 1  # numbers of loops in which helpers have nothing to do, or return; other numbers are the caller's
SPINS = 2000
"""How often a waiting thread looks at the queue before it lets others run: the time of a few items."""
MAX_LATE_SHARE, SINGLE_THREAD_FRAMES = 0.05, 20
"""Share of late loops above which the processors count as busy with other work, and the frames without helpers that follow."""

if COMPILED:

    def _element_pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
        """Pointer to an element of a one-dimensional array."""
        return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])

    @intrinsic
    def atomic_add(typingctx: Any, queue: Any, place: Any, value: Any) -> Any:
        """Add to a place in the queue and return the value before, as one atomic operation."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer = _element_pointer(context, builder, signature.args[0], *arguments[:2])
            return builder.atomic_rmw("add", pointer, arguments[2], "seq_cst")

        return types.int64(queue, types.int64, types.int64), codegen

    @intrinsic
    def atomic_load(typingctx: Any, queue: Any, place: Any) -> Any:
        """Read a place in the queue, and see all that was written before its value."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.load_atomic(_element_pointer(context, builder, signature.args[0], *arguments), "seq_cst", 8)

        return types.int64(queue, types.int64), codegen

    @intrinsic
    def atomic_store(typingctx: Any, queue: Any, place: Any, value: Any) -> Any:
        """Write a place in the queue, after all that was written before."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            builder.store_atomic(
                arguments[2], _element_pointer(context, builder, signature.args[0], *arguments[:2]), "seq_cst", 8
            )
            return context.get_dummy_value()

        return types.void(queue, types.int64, types.int64), codegen

    @intrinsic
    def _call_address(typingctx: Any, address: Any) -> Any:
        """Call the function without arguments that is at an address."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            function = ir.FunctionType(ir.IntType(32), [])
            builder.call(builder.inttoptr(arguments[0], function.as_pointer()), [])
            return context.get_dummy_value()

        return types.void(types.int64), codegen

    @intrinsic
    def _cpu_pause(typingctx: Any) -> Any:
        """Tell the processor that this thread only waits."""
        machine = platform.machine().lower()

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            if machine in ("x86_64", "amd64"):
                pause = ir.FunctionType(ir.VoidType(), [])
                builder.call(get_or_insert_function(builder.module, pause, "llvm.x86.sse2.pause"), [])
            elif machine in ("arm64", "aarch64"):
                hint = ir.FunctionType(ir.VoidType(), [ir.IntType(32)])
                builder.call(get_or_insert_function(builder.module, hint, "llvm.aarch64.hint"), [ir.IntType(32)(1)])
            return context.get_dummy_value()

        return types.void(), codegen


@inlined
def begin_loop(queue: np.ndarray, loop: int) -> None:
    """Begin a loop: its items may be claimed from now on."""
    queue[LOOPS] += 1
    atomic_store(queue, ITEMS_DONE, 0)
    atomic_store(queue, NEXT_ITEM, loop * LOOP_FACTOR)


@inlined
def claim_item(queue: np.ndarray, items: int) -> tuple[int, int]:
    """Claim an item; return the loop and the item, or IDLE and `items` when there is none."""
    claim = atomic_load(queue, NEXT_ITEM)
    if claim % LOOP_FACTOR < items and claim // LOOP_FACTOR > STOP:
        claim = atomic_add(queue, NEXT_ITEM, 1)  # by now it may belong to a later loop
        if claim % LOOP_FACTOR < items and claim // LOOP_FACTOR > STOP:
            return claim // LOOP_FACTOR, claim % LOOP_FACTOR
    return IDLE, items


@inlined
def finish_item(queue: np.ndarray) -> None:
    """Count one item as done."""
    atomic_add(queue, ITEMS_DONE, 1)


@inlined
def all_items_done(queue: np.ndarray, items: int) -> bool:
    """Whether all items of the loop are done."""
    return atomic_load(queue, ITEMS_DONE) >= items


@inlined
def is_stopped(queue: np.ndarray) -> bool:
    """True when helpers have to return."""
    return atomic_load(queue, NEXT_ITEM) // LOOP_FACTOR == STOP


@kernel
def wait_briefly(queue: np.ndarray, turn: int) -> None:
    """Wait a moment, for the `turn`-th time in a row."""
    _cpu_pause()
    if turn % SPINS == SPINS - 1:
        _call_address(queue[YIELD_ADDRESS])


def make_queue(points: int, threads: int | None = None) -> tuple[np.ndarray, int]:
    """Return a queue and the number of helpers for it.

    Parameters
    ----------
    points : int
        Contact points of all pairs.
    threads : int, optional
        How many to use; by default the environment variable ``PALPATE_THREADS``, or as many as pay off, up to the processors.

    Returns
    -------
    queue : (QUEUE_SIZE,) int, or (0,) without helpers
    helpers : int
    """
    threads = threads_for(points, threads)
    if are_interpreted() or threads < 2:
        return np.zeros(0, np.int64), 0
    queue = np.zeros(QUEUE_SIZE, np.int64)
    queue[YIELD_ADDRESS] = _address_of_yield()
    return queue, threads - 1


def threads_for(points: int, threads: int | None = None) -> int:
    """Return how many threads to use; the arguments are those of :func:`make_queue`."""
    return threads or int(os.environ.get("PALPATE_THREADS", "0")) or min(count_of_cores(), 1 + points // POINTS_PER_THREAD)


def count_of_cores() -> int:
    """Return how many cores this process may use."""
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
    """Run ``work(*arguments)`` in `number` threads meanwhile; it has to return when the queue says STOP.

    Where the processors are busy with other work, a helper may be suspended in the middle of an item, and all wait for it.
    After a frame in which that happened often, no helper is started for some frames.
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
