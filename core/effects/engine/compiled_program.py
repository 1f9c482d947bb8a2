# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled: what the solver asks of a sensor's effects in every step, and the same over a whole signal (kernels).

A texel is one spring with one past, whatever presses on it. Per contact point of a sensor there is one row of memory, zero at
first. In each step the solver may ask :func:`apply_force_laws` as often as it likes with ``commit=False``; at the step's end it
asks once with ``commit=True`` for *every* point of the sensor, with depth, rate and slide zero where nothing touches, because
what was pressed recovers. Where several targets press on one point, the deepest is the one that is remembered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...compiled.kernels import COMPILED, call_address, carray, compiled_callback, kernel
from ...compiled.struct_reference import by_reference
from ...model.effect import Effect
from .registry import complete_values, in_signal_order
from .specification import Form

# What this name stands for differs from copy to copy of the functions that use it, see _link.
ONE: Any = None


def _law_over_time(force, depth, slide, step, numbers, memory, result):
    for i in range(force.shape[0]):
        row = step[i]
        for point in range(force.shape[1]):
            result[i, point], _ = ONE(
                force[i, point], 1.0, depth[i, point], slide[i, point], numbers, row, memory, point, 0, True
            )


def _law_over_points(work, force, slope, depth, slide, count, slots, slot, offset, numbers, row, memory, at, commit):
    for i in range(count):
        point = offset + slots[slot + i]
        work[force + i], work[slope + i] = ONE(
            work[force + i], work[slope + i], work[depth + i], work[slide + i], numbers, row, memory, point, at, commit
        )


def _friction_over_points(work, speed, force, factor, viscous, count, slots, slot, offset, numbers, row, memory, at, commit):
    for i in range(count):
        more, thicker = ONE(work[speed + i], work[force + i], numbers, row)
        work[factor + i] *= more
        work[viscous + i] += thicker


def _entry(
    work, works, slots, slotted, numbers, rows, width, memory, points, columns, a, b, c, d, count, slot, offset, row, at, commit
):
    ONE(
        carray(work, (works,)), a, b, c, d, count, carray(slots, (slotted,)), slot, offset,
        carray(numbers, (rows, width)), row, carray(memory, (points, columns)), at, commit != 0,
    )  # fmt: skip


def _link(function: Any, name: str, wrap: Callable[[Any], Any] = kernel, **meaning: Any) -> Any:
    """Return a copy of a function, compiled, in which global names mean what is given, under a name of its own in the cache."""
    copy = FunctionType(function.__code__, {**meaning, "__name__": __name__})
    copy.__qualname__ = f"{function.__name__}_{name}"
    copy.__module__ = __name__
    return wrap(copy)


@cache
def _compiled(function: Callable[..., Any]) -> Any:
    return kernel(function)


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__.rpartition('.')[2]}_{function.__name__}"


@cache
def _over_time(law: Callable[..., Any]) -> Any:
    return _link(_law_over_time, _name(law), ONE=_compiled(law))


# --- laws by number, for kernels that are compiled once and for all: which laws a sensor has is only known when it runs

_UNCOMPILED: list[Callable[..., Any]] = []
_ENTRIES: dict[int, Any] = {}


@cache
def _number_of(form_way: Callable[..., Any], loop: Any) -> int:
    """Number under which :func:`call_law` knows a law: the address of its machine code; without numba its place in a list."""
    over_points = _link(loop, _name(form_way), ONE=_compiled(form_way))
    if not COMPILED:
        _UNCOMPILED.append(over_points)
        return len(_UNCOMPILED) - 1
    entry = _link(_entry, _name(form_way), compiled_callback, ONE=over_points, carray=carray)
    _ENTRIES[entry.address] = entry  # has to stay alive
    return int(entry.address)


if COMPILED:

    @kernel
    def call_law(number, work, block, a, b, c, d, count, slots, slot, offset, numbers, row, memory, at, commit):
        """Let a law act on `count` points; see :func:`apply_force_laws`."""
        start = block * work.shape[1]
        call_address(
            number, work.ctypes.data, work.size, slots.ctypes.data, slots.size, numbers.ctypes.data, numbers.shape[0],
            numbers.shape[1], memory.ctypes.data, memory.shape[0], memory.shape[1], start + a, start + b, start + c, start + d,
            count, slot, offset, row, at, 1 if commit else 0,
        )  # fmt: skip
else:

    def call_law(number, work, block, a, b, c, d, count, slots, slot, offset, numbers, row, memory, at, commit):
        """Let a law act on `count` points; see :func:`apply_force_laws`."""
        start = block * work.shape[1]
        _UNCOMPILED[number](
            work.reshape(-1), start + a, start + b, start + c, start + d, count, slots.reshape(-1), slot, offset,
            numbers, row, memory, at, commit,
        )  # fmt: skip


def law_over_time(
    form: Form,
    force: np.ndarray,
    step: np.ndarray,
    numbers: np.ndarray,
    memory: np.ndarray,
    depth: np.ndarray | None = None,
    slide: np.ndarray | None = None,
) -> np.ndarray:
    """Run one law over t samples of n points, (t, n) float: the same numbers as step by step, with less to decide on the way.

    Parameters
    ----------
    form : Form
        With a law.
    force, depth, slide : (t, n) float
        What goes into the law.
    step : (t,) int
        Which row of `numbers` belongs to each sample.
    numbers : (…, c) float
    memory : (n, columns) float
        Brought up to date.
    """
    assert form.law is not None
    # Arrays of one kind, so that the law is compiled only once.
    force = np.ascontiguousarray(force, dtype=float)
    depth = np.zeros_like(force) if depth is None else np.ascontiguousarray(depth, dtype=float)
    slide = np.zeros_like(force) if slide is None else np.ascontiguousarray(slide, dtype=float)
    result = np.empty_like(force)
    _over_time(form.law)(force, depth, slide, step, numbers, memory, result)
    return result


@by_reference
class EffectProgram(NamedTuple):
    """The laws of m sensors as arrays; of sensor s those with index ``start[s]`` to ``start[s + 1]``.

    Attributes
    ----------
    start : (m + 1,) int
    clip : (m,) int
        From this index on laws act after the force was cut off at zero.
    code, at, row : (laws,) int
        Which law, for :func:`call_law`; the first column of its memory; its row of constants for the first length of step,
        others follow.
    friction_start : (m + 1,) int
    friction_code, friction_row : (friction laws,) int
    numbers : (rows, c) float
    columns : int
        Columns of memory that a point needs.
    """

    start: np.ndarray
    clip: np.ndarray
    code: np.ndarray
    at: np.ndarray
    row: np.ndarray
    friction_start: np.ndarray
    friction_code: np.ndarray
    friction_row: np.ndarray
    numbers: np.ndarray
    columns: int

    @property
    def is_empty(self) -> bool:
        """True when no sensor has an effect that acts on forces."""
        return len(self.code) == 0 and len(self.friction_code) == 0

    def memory(self, points: int) -> np.ndarray:
        """Return the memory of that many untouched points, (points, columns) float."""
        return np.zeros((points, self.columns))


def compile_program(stacks: Sequence[Sequence[Effect]], dt: ArrayLike) -> EffectProgram:
    """Return what acts on the forces of several sensors, for steps of the given lengths.

    Parameters
    ----------
    stacks : sequence of sequences of Effect
        The effects of each sensor; those on readings are left out.
    dt : (m,) float, s
        Lengths of step that will occur; the argument `step` of the kernels counts them.
    """
    lengths = np.atleast_1d(np.asarray(dt, dtype=float))
    start, clip, friction_start = [0], [], [0]
    code: list[int] = []
    at: list[int] = []
    row: list[int] = []
    friction_code: list[int] = []
    friction_row: list[int] = []
    tables: list[np.ndarray] = []
    columns = 0
    for stack in stacks:
        column, after = 0, 0
        for item, form in in_signal_order(stack, readout=False):
            if form.constants is None:
                continue
            first = sum(len(table) for table in tables)
            if form.law is not None:
                code.append(_number_of(form.law, _law_over_points))
                at.append(column)
                row.append(first)
                column += form.memory
                after += form.after_clip
            else:
                assert form.friction_law is not None
                friction_code.append(_number_of(form.friction_law, _friction_over_points))
                friction_row.append(first)
            tables.append(form.constants(complete_values(item), lengths))
        start.append(len(code))
        clip.append(len(code) - after)
        friction_start.append(len(friction_code))
        columns = max(columns, column)
    width = max((table.shape[1] for table in tables), default=1)
    numbers = np.zeros((sum(len(table) for table in tables), width))
    first = 0
    for table in tables:
        numbers[first : first + len(table), : table.shape[1]] = table
        first += len(table)
    return EffectProgram(
        start=np.array(start, dtype=np.int64),
        clip=np.array(clip, dtype=np.int64),
        code=np.array(code, dtype=np.int64),
        at=np.array(at, dtype=np.int64),
        row=np.array(row, dtype=np.int64),
        friction_start=np.array(friction_start, dtype=np.int64),
        friction_code=np.array(friction_code, dtype=np.int64),
        friction_row=np.array(friction_row, dtype=np.int64),
        numbers=numbers,
        columns=columns,
    )


# What presses on points, in blocks with the points of each column side by side; the first five are given, the others found.
DEPTH, RATE, SLIDE, SPEED, DAMPING, FORCE, SLOPE, FACTOR, VISCOUS = range(9)
COLUMNS = 9


@kernel
def press(work, block, stride, i, depth, rate, slide, speed, k, cn, exponent, dissipation):
    """Write what the base law makes of a point.

    Parameters
    ----------
    work : (blocks, COLUMNS · stride) float
        Column c of point i is at ``work[block, c * stride + i]``.
    block, stride, i : int
    depth, rate : float, m and m/s
        Depth at the step's end, zero or less where nothing touches; its rate during the step.
    slide, speed : float, m and m/s
        Distance slid in the step, and speed of it.
    k, cn, exponent, dissipation : float
        As in :class:`.SensorParameters`; an exponent of zero is Eq. 8.
    """
    force, slope, damping = 0.0, 0.0, cn
    if depth > 0.0:
        force, slope = k * depth, k
        if exponent != 0.0:
            force = k * depth**exponent
            slope = exponent * force / depth
    if exponent != 0.0:
        damping = 1.5 * dissipation
    work[block, DEPTH * stride + i], work[block, RATE * stride + i] = max(depth, 0.0), rate
    work[block, SLIDE * stride + i], work[block, SPEED * stride + i] = slide, speed
    work[block, FORCE * stride + i], work[block, SLOPE * stride + i] = force, slope
    work[block, DAMPING * stride + i] = damping


@kernel
def apply_force_laws(sensor, step, work, block, stride, begin, count, slots, slot, offset, linear, program, memory, commit):
    """Let the effects act on what :func:`press` wrote.

    FORCE is then the normal force (N), SLOPE and DAMPING its derivatives by the depth at the step's end (N/m) and by the rate
    (N·s/m).

    Parameters
    ----------
    sensor, step : int
        Step counts the lengths of step that the program was compiled for.
    work, block, stride
        See :func:`press`.
    begin, count : int
        The first of the points in the block, and how many.
    slots, slot, offset : (…) int, int, int
        The memory of the i-th of them is row ``offset + slots.ravel()[slot + i]``.
    linear : bool
        The base law is Eq. 8.
    program : EffectProgram
    memory : (points, columns) float
    commit : bool
        Write the memory: once per step and point, at the step's end.
    """
    force, slope, damping = FORCE * stride + begin, SLOPE * stride + begin, DAMPING * stride + begin
    depth, slide, rate = DEPTH * stride + begin, SLIDE * stride + begin, RATE * stride + begin
    for e in range(program.start[sensor], program.clip[sensor]):
        call_law(
            program.code[e], work, block, force, slope, depth, slide, count, slots, slot, offset,
            program.numbers, program.row[e] + step, memory, program.at[e], commit,
        )  # fmt: skip
    for i in range(count):
        if not linear:
            work[block, slope + i] *= 1.0 + work[block, damping + i] * work[block, rate + i]
            work[block, damping + i] *= work[block, force + i]
        work[block, force + i] += work[block, damping + i] * work[block, rate + i]
        if work[block, force + i] <= 0.0 or work[block, depth + i] <= 0.0:
            work[block, force + i] = work[block, slope + i] = work[block, damping + i] = 0.0
    for e in range(program.clip[sensor], program.start[sensor + 1]):
        call_law(
            program.code[e], work, block, force, slope, depth, slide, count, slots, slot, offset,
            program.numbers, program.row[e] + step, memory, program.at[e], commit,
        )  # fmt: skip


@kernel
def apply_friction_laws(sensor, work, block, stride, begin, count, slots, program, memory):
    """How the effects change friction at SPEED under FORCE: written into FACTOR and VISCOUS.

    FACTOR is on the friction coefficient of Eq. 10–12, at speed zero also on what static friction can hold; VISCOUS is to be
    added to `ct`, N·s/m.
    """
    factor, viscous = FACTOR * stride + begin, VISCOUS * stride + begin
    for i in range(count):
        work[block, factor + i], work[block, viscous + i] = 1.0, 0.0
    for e in range(program.friction_start[sensor], program.friction_start[sensor + 1]):
        call_law(
            program.friction_code[e], work, block, SPEED * stride + begin, FORCE * stride + begin, factor, viscous, count,
            slots, 0, 0, program.numbers, program.friction_row[e], memory, 0, False,
        )  # fmt: skip
