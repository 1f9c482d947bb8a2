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
from ...laws.normal_force import damped_force_derivatives, damping_coefficient, elastic_force, elastic_stiffness
from ...model.effect import Effect
from .registry import complete_values, in_signal_order
from .specification import Form, TexelInput

# The loops below are compiled once for each law: `_specialised` copies them with LAW standing for that law.
LAW: Any = None


def kernel_template(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a function of which :func:`_specialised` compiles a copy for each law; by itself it is never called."""
    return function


@kernel_template
def _law_over_time(force, depth, slide, step, constants, memory, result):
    for i in range(force.shape[0]):
        row = constants[step[i]]
        for point in range(force.shape[1]):
            texel = TexelInput(force[i, point], 1.0, depth[i, point], slide[i, point])
            result[i, point], _ = LAW(texel, row, memory[point], True)


@kernel_template
def _law_over_points(columns, constants, memory, rows, offset, commit):
    force, slope, depth, slide = columns
    for i in range(len(rows)):
        texel = TexelInput(force[i], slope[i], depth[i], slide[i])
        force[i], slope[i] = LAW(texel, constants, memory[offset + rows[i]], commit)


@kernel_template
def _friction_law_over_points(columns, constants, memory, rows, offset, commit):
    speed, force, factor, viscous = columns
    for i in range(len(rows)):
        factor_here, viscous_here = LAW(speed[i], force[i], constants)
        factor[i] *= factor_here
        viscous[i] += viscous_here


@kernel_template
def _entry(a, b, c, d, constants, memory, rows, count, width, points, state_size, offset, commit):
    """Make arrays of the addresses and numbers that :func:`call_address` hands over; `LAW` is one of the loops over points."""
    columns = carray(a, (count,)), carray(b, (count,)), carray(c, (count,)), carray(d, (count,))
    LAW(columns, carray(constants, (width,)), carray(memory, (points, state_size)), carray(rows, (count,)), offset, commit != 0)


def _specialised(template: Any, law: Any, name: str, compiler: Callable[[Any], Any] = kernel) -> Any:
    """Return a compiled copy of a template in which LAW means `law`, under a name of its own in numba's cache."""
    copy = FunctionType(template.__code__, {"LAW": law, "TexelInput": TexelInput, "carray": carray, "__name__": __name__})
    copy.__qualname__ = f"{template.__name__}_{name}"
    copy.__module__ = __name__
    return compiler(copy)


@cache
def _compiled(law: Callable[..., Any]) -> Any:
    return kernel(law)


def _name(law: Callable[..., Any]) -> str:
    return f"{law.__module__.rpartition('.')[2]}_{law.__name__}"


@cache
def _over_time(law: Callable[..., Any]) -> Any:
    return _specialised(_law_over_time, _compiled(law), _name(law))


# --- Laws by number, for kernels that are compiled once for all sensors: which laws a sensor has is known only at run time.

_UNCOMPILED: list[Callable[..., Any]] = []
_ENTRIES: dict[int, Any] = {}
"""Keeps the compiled entries alive, by their addresses."""


@cache
def _number_of(law: Callable[..., Any], loop: Any) -> int:
    """Return the number by which :func:`call_law` finds a law: the address of its machine code, or without numba an index."""
    over_points = _specialised(loop, _compiled(law), _name(law))
    if not COMPILED:
        _UNCOMPILED.append(over_points)
        return len(_UNCOMPILED) - 1
    entry = _specialised(_entry, over_points, _name(law), compiled_callback)
    _ENTRIES[entry.address] = entry
    return int(entry.address)


if COMPILED:

    @kernel
    def call_law(number, work, block, a, b, c, d, count, slots, slot, offset, numbers, row, memory, at, commit):
        """Let a law act on `count` points; see :func:`apply_force_laws`."""
        start = work.ctypes.data + 8 * block * work.shape[1]
        call_address(
            number, start + 8 * a, start + 8 * b, start + 8 * c, start + 8 * d,
            numbers.ctypes.data + 8 * row * numbers.shape[1], memory.ctypes.data + 8 * at, slots.ctypes.data + 8 * slot,
            count, numbers.shape[1], memory.shape[0], memory.shape[1], offset, 1 if commit else 0,
        )  # fmt: skip
else:

    def call_law(number, work, block, a, b, c, d, count, slots, slot, offset, numbers, row, memory, at, commit):
        """Let a law act on `count` points; see :func:`apply_force_laws`."""
        columns = tuple(work[block, first : first + count] for first in (a, b, c, d))
        _UNCOMPILED[number](columns, numbers[row], memory[:, at:], slots.reshape(-1)[slot : slot + count], offset, commit)


def law_over_time(
    form: Form,
    force: np.ndarray,
    step: np.ndarray,
    constants: np.ndarray,
    memory: np.ndarray,
    depth: np.ndarray | None = None,
    slide: np.ndarray | None = None,
) -> np.ndarray:
    """Run one law over t samples of n points; return (t, n) float. The numbers are those of the same run step by step.

    Parameters
    ----------
    form : Form
        With a law.
    force, depth, slide : (t, n) float
        Inputs of the law, see :class:`.TexelInput`.
    step : (t,) int
        The row of `constants` that belongs to each sample.
    constants : (lengths of step, c) float
    memory : (n, state_size) float
        Brought up to date.
    """
    assert form.law is not None
    # Contiguous arrays of one type, so that the law is compiled only once.
    force = np.ascontiguousarray(force, dtype=float)
    depth = np.zeros_like(force) if depth is None else np.ascontiguousarray(depth, dtype=float)
    slide = np.zeros_like(force) if slide is None else np.ascontiguousarray(slide, dtype=float)
    constants = np.ascontiguousarray(constants, dtype=float)
    result = np.empty_like(force)
    _over_time(form.law)(force, depth, slide, step, constants, memory, result)
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
                column += form.state_size
                after += form.after_clip
            else:
                assert form.friction_law is not None
                friction_code.append(_number_of(form.friction_law, _friction_law_over_points))
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
def press(work, block, stride, i, depth, rate, slide, speed, law):
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
    law : ContactLaw
        Of a whole texel.
    """
    force, slope, damping = 0.0, 0.0, damping_coefficient(law)
    if depth > 0.0:
        force = elastic_force(depth, law)
        slope = elastic_stiffness(depth, force, law)
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
        work[block, force + i], work[block, slope + i], work[block, damping + i] = damped_force_derivatives(
            work[block, force + i], work[block, slope + i], work[block, damping + i], work[block, rate + i], linear
        )
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
