# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled: what the solver asks of a sensor's effects in every step, and the same over a whole signal (kernels).

A texel is one spring with one past, whatever presses on it. Per contact point of a sensor there is one row of memory, zero at
first. In each step the solver may ask :func:`texel_force` as often as it likes with ``commit=False``; at the step's end it
calls it once with ``commit=True`` for *every* point of the sensor, with depth, rate and slide zero where nothing touches,
because what was pressed recovers. Where several targets press on one point, the deepest is the one that is remembered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..jit import kernel
from .base import Effect, Form
from .library import complete_values, form_of, in_order, library


def _forms(way: str) -> list[tuple[str, str]]:
    """Names of all forms that act this way; a form's place in the list is its code in the compiled chain."""
    return [(kind.name, form.name) for kind in library().values() for form in kind.forms if getattr(form, way) is not None]


LAWS, FRICTIONS = _forms("law"), _forms("friction")


# What these three names stand for differs from copy to copy of the functions that use them, see _link.
CODE: int = -1
ONE: Any = None
REST: Any = None


def _ask_law(code, force, slope, depth, slide, numbers, row, memory, point, at, commit):
    if code == CODE:
        return ONE(force, slope, depth, slide, numbers, row, memory, point, at, commit)
    return REST(code, force, slope, depth, slide, numbers, row, memory, point, at, commit)


def _no_law(code, force, slope, depth, slide, numbers, row, memory, point, at, commit):
    return force, slope


def _ask_friction(code, speed, force, numbers, row):
    if code == CODE:
        return ONE(speed, force, numbers, row)
    return REST(code, speed, force, numbers, row)


def _no_friction(code, speed, force, numbers, row):
    return 1.0, 0.0


def _law_over_time(force, depth, slide, step, numbers, memory, result):
    for i in range(force.shape[0]):
        row = step[i]
        for point in range(force.shape[1]):
            result[i, point], _ = ONE(
                force[i, point], 1.0, depth[i, point], slide[i, point], numbers, row, memory, point, 0, True
            )


def _link(function: Any, name: str, **meaning: Any) -> Any:
    """Return a copy of a function, compiled, in which global names mean what is given.

    numba has no table of functions that it could also keep on disk; the copies have names of their own, so it keeps each.
    """
    copy = FunctionType(function.__code__, {**meaning, "__name__": __name__})
    copy.__qualname__ = f"{function.__name__}_{name}"
    copy.__module__ = __name__
    return kernel(copy)


@cache
def _compiled(function: Callable[..., Any]) -> Any:
    return kernel(function)


def _chain(functions: Sequence[Callable[..., Any] | None], ask: Any, end: Any) -> Any:
    """Return a kernel that calls the function with the code it is given; the optimiser makes a jump table of the chain."""
    rest = kernel(end)
    for code, function in reversed(list(enumerate(functions))):
        assert function is not None
        rest = _link(ask, str(code), CODE=code, ONE=_compiled(function), REST=rest)
    return rest


law_of_code = _chain([form_of(*names).law for names in LAWS], _ask_law, _no_law)
friction_of_code = _chain([form_of(*names).friction for names in FRICTIONS], _ask_friction, _no_friction)


@cache
def _over_time(law: Callable[..., Any]) -> Any:
    name = f"{law.__module__.rpartition('.')[2]}_{law.__name__}"
    return _link(_law_over_time, name, ONE=_compiled(law))


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


class Program(NamedTuple):
    """The laws of m sensors as arrays; of sensor s those with index ``start[s]`` to ``start[s + 1]``.

    Attributes
    ----------
    start : (m + 1,) int
    clip : (m,) int
        From this index on laws act after the force was cut off at zero.
    code, at, row : (laws,) int
        Which law; the first column of its memory; its row of constants for the first length of step, others follow.
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


def compile_program(stacks: Sequence[Sequence[Effect]], dt: ArrayLike) -> Program:
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
        for item, form in in_order(stack, readout=False):
            if form.constants is None:
                continue
            first = sum(len(table) for table in tables)
            if form.law is not None:
                code.append(LAWS.index((item.name, form.name)))
                at.append(column)
                row.append(first)
                column += form.memory
                after += form.after_clip
            else:
                friction_code.append(FRICTIONS.index((item.name, form.name)))
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
    return Program(
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


@kernel
def elastic_force(sensor, point, step, force, slope, depth, slide, program, memory, commit):
    """Elastic force of a contact point under the effects that act before the cut-off at zero.

    Parameters
    ----------
    sensor, point, step : int
        Point counts rows of `memory`, step the lengths of step the program was compiled for.
    force, slope : float, N and N/m
        What the base law gives without damping at the step's end, and its derivative by the depth there.
    depth, slide : float, m
        Depth at the step's end, distance slid in the step.
    program : Program
    memory : (points, columns) float
    commit : bool
        Write the memory: once per step and point, at the step's end.

    Returns
    -------
    force, slope : float
    """
    for e in range(program.start[sensor], program.clip[sensor]):
        row = program.row[e] + step
        force, slope = law_of_code(
            program.code[e], force, slope, depth, slide, program.numbers, row, memory, point, program.at[e], commit
        )
    return force, slope


@kernel
def surface_force(sensor, point, step, force, slope, depth, slide, program, memory, commit):
    """Force under the effects that act after the cut-off at zero, and may pull; see :func:`elastic_force`."""
    for e in range(program.clip[sensor], program.start[sensor + 1]):
        row = program.row[e] + step
        force, slope = law_of_code(
            program.code[e], force, slope, depth, slide, program.numbers, row, memory, point, program.at[e], commit
        )
    return force, slope


@kernel
def texel_force(sensor, point, step, depth, rate, slide, k, cn, exponent, dissipation, program, memory, commit):
    """Normal force of a contact point with the effects on it, by the base law of Eq. 8 or of Hunt and Crossley.

    Parameters
    ----------
    sensor, point, step, depth, slide, program, memory, commit
        See :func:`elastic_force`.
    rate : float, m/s
        Of the depth, during the step.
    k, cn, exponent, dissipation : float
        As in :class:`.SensorParameters`; an exponent of zero is Eq. 8.

    Returns
    -------
    force : float, N
    slope : float, N/m
        Its derivative by the depth at the step's end.
    damping : float, N·s/m
        Its derivative by the rate where the depth stays as it is.
    """
    force, slope, damping = 0.0, 0.0, 0.0
    if depth > 0.0:
        force, slope = k * depth, k
        if exponent != 0.0:
            force = k * depth**exponent
            slope = exponent * force / depth
    force, slope = elastic_force(sensor, point, step, force, slope, depth, slide, program, memory, commit)
    if depth > 0.0:
        damping = cn
        if exponent != 0.0:
            damping = 1.5 * dissipation * force
            slope *= 1.0 + 1.5 * dissipation * rate
        force += damping * rate
    if force <= 0.0 or depth <= 0.0:
        force, slope, damping = 0.0, 0.0, 0.0
    force, slope = surface_force(sensor, point, step, force, slope, depth, slide, program, memory, commit)
    return force, slope, damping


@kernel
def sliding(sensor, speed, force, program):
    """How the effects change friction at a sliding speed (m/s) under a normal force (N).

    Returns
    -------
    factor : float
        On the friction coefficient of Eq. 10–12; at speed zero also on what static friction can hold.
    viscous : float, N·s/m
        To be added to `ct`.
    """
    factor, viscous = 1.0, 0.0
    for e in range(program.friction_start[sensor], program.friction_start[sensor + 1]):
        more, thicker = friction_of_code(program.friction_code[e], speed, force, program.numbers, program.friction_row[e])
        factor *= more
        viscous += thicker
    return factor, viscous


@kernel
def friction_over_all(speed, force, program, factor, viscous):
    """:func:`sliding` of the program's first sensor for arrays of one length."""
    for i in range(len(speed)):
        factor[i], viscous[i] = sliding(0, speed[i], force[i], program)
