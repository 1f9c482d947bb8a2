# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects of sensors on contact forces, compiled for the solver, and single laws over whole signals (kernels).

Every texel is one spring with one history, whatever presses on it. Each contact point of a sensor has one row of memory, zero
at the start. During a step the solver may call :func:`apply_force_laws` any number of times with ``commit=False``. At the end
of the step it calls it once with ``commit=True`` for *every* point of the sensor, with depth, rate and sliding step zero where
nothing touches, because what was pressed recovers. If several targets press on one point, the deepest is remembered.

Which laws a sensor has is known only at run time, but the solver's kernels are compiled once and for all. So each law is
compiled into a loop over points with a fixed signature of its own, and the solver calls it by the address of its machine code.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...compiled.kernels import (
    address_of,
    allocating_addressed_kernel,
    are_interpreted,
    call_address,
    carray,
    kernel,
    plain,
    pointer_to,
    with_plain_form,
)
from ...compiled.struct_reference import by_reference
from ...laws.contact_law import ContactLaw
from ...laws.normal_force import damped_force_derivatives, damping_coefficient, elastic_force, elastic_stiffness
from ...model.sensor import Effect, Value, Values
from .registry import complete_values, in_signal_order
from .specification import Form, TexelInput

Columns = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
CONSTANTS_KEPT = 16
"""Number of results of :func:`constants_of` that are kept."""

# The loops below are compiled once for each law: `_specialised` copies them with LAW standing for that law.
LAW: Any = None


def kernel_template(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a function of which :func:`_specialised` compiles a copy for each law; by itself it is never called."""
    return function


@kernel_template
def _law_over_time(
    force: np.ndarray,
    depth: np.ndarray,
    slide_step: np.ndarray,
    step: np.ndarray,
    constants: np.ndarray,
    memory: np.ndarray,
    result: np.ndarray,
) -> None:
    for i in range(force.shape[0]):
        row = constants[step[i]]
        for point in range(force.shape[1]):
            texel = TexelInput(force[i, point], 1.0, depth[i, point], slide_step[i, point])
            result[i, point], _ = LAW(texel, row, memory[point], True)


@kernel_template
def _law_over_points(
    columns: Columns, constants: np.ndarray, memory: np.ndarray, rows: np.ndarray, offset: int, commit: bool
) -> None:
    force, slope, depth, slide_step = columns
    for i in range(len(rows)):
        texel = TexelInput(force[i], slope[i], depth[i], slide_step[i])
        force[i], slope[i] = LAW(texel, constants, memory[offset + rows[i]], commit)


@kernel_template
def _friction_law_over_points(
    columns: Columns, constants: np.ndarray, memory: np.ndarray, rows: np.ndarray, offset: int, commit: bool
) -> None:
    speed, force, factor, viscous = columns
    for i in range(len(rows)):
        factor_here, viscous_here = LAW(speed[i], force[i], constants)
        factor[i] *= factor_here
        viscous[i] += viscous_here


@kernel_template
def _entry(  # type: ignore[no-untyped-def]  # addresses and numbers, as `call_law` gives them
    a, b, c, d, constants, memory, rows, count, width, points, state_size, offset, commit
):  # fmt: skip
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

_OVER_POINTS: list[Callable[..., Any]] = []
"""The loops of all laws that were asked for, by number."""
_ADDRESSES = np.zeros(1024, np.int64)
"""Addresses of their machine code; zero before they are compiled."""
_ARGUMENTS = (*(pointer_to(integers=i == 6) for i in range(7)), *[0] * 6)
"""Arguments of :func:`_entry`: addresses of arrays, the last of which holds integers, and numbers."""


@cache
def _number_of(law: Callable[..., Any], loop: Any) -> int:
    """Return the number by which :func:`call_law` finds a law."""
    _OVER_POINTS.append(_specialised(loop, _compiled(law), _name(law)))
    if len(_OVER_POINTS) > len(_ADDRESSES):
        raise RuntimeError(f"More than {len(_ADDRESSES)} laws of effects in one process")
    return len(_OVER_POINTS) - 1


@cache
def _entry_of(number: int) -> Any:
    over_points = _OVER_POINTS[number]
    return _specialised(_entry, over_points, plain(over_points).__qualname__, allocating_addressed_kernel)


def prepare_laws(program: EffectProgram) -> None:
    """Compile the laws of a program, unless that was done, so that kernels can call them."""
    for number in (*program.law.tolist(), *program.friction_law.tolist()):
        if _ADDRESSES[number] == 0 and not are_interpreted():
            _ADDRESSES[number] = address_of(_entry_of(number), *_ARGUMENTS)


def _call_law_plain(
    number: int,
    columns: Columns,
    points: PointRange,
    program: EffectProgram,
    row: int,
    memory: np.ndarray,
    first_state: int,
    commit: bool,
) -> None:
    """Call a law as :func:`call_law` does, without compiled code."""
    these = slice(points.first, points.first + points.number)
    rows = points.rows.reshape(-1)[points.first_row : points.first_row + points.number]
    parts = tuple(column[points.block, these] for column in columns)
    _OVER_POINTS[number](parts, program.constants[row], memory[:, first_state:], rows, points.offset, commit)


@with_plain_form(_call_law_plain)
@kernel
def call_law(
    number: int,
    columns: Columns,
    points: PointRange,
    program: EffectProgram,
    row: int,
    memory: np.ndarray,
    first_state: int,
    commit: bool,
) -> None:
    """Let a law act on a range of points.

    Parameters
    ----------
    number : int
        Of the law, see :func:`_number_of`.
    columns : tuple of four (blocks, n) float
        Inputs and outputs of the loop over points, of :class:`TexelContacts`.
    points : PointRange
    program : EffectProgram
    row : int
        The constants of the law are ``program.constants[row]``.
    memory, first_state : (N, state_size) float, int
        The state of the law begins in this column.
    commit : bool
    """
    a, b, c, d = columns
    constants = program.constants
    start = 8 * (points.block * a.shape[1] + points.first)
    call_address(
        program.addresses[number], a.ctypes.data + start, b.ctypes.data + start, c.ctypes.data + start, d.ctypes.data + start,
        constants.ctypes.data + 8 * row * constants.shape[1], memory.ctypes.data + 8 * first_state,
        points.rows.ctypes.data + 8 * points.first_row, points.number, constants.shape[1], memory.shape[0], memory.shape[1],
        points.offset, 1 if commit else 0,
    )  # fmt: skip


def constants_of(form: Form, values: Values, lengths: np.ndarray) -> np.ndarray:
    """Return the constants of a law for steps of some lengths, (m, c) float, which must not be written to."""
    assert form.constants is not None
    return _constants_kept(form.constants, tuple(values.items()), np.ascontiguousarray(lengths, float).tobytes())


@lru_cache(maxsize=4)
def _zeros(shape: tuple[int, ...]) -> np.ndarray:
    """Zeros that nobody writes to: what a law on readings knows of depth and sliding."""
    return np.zeros(shape)


@lru_cache(maxsize=CONSTANTS_KEPT)
def _constants_kept(
    constants: Callable[[Values, np.ndarray], np.ndarray], values: tuple[tuple[str, Value], ...], lengths: bytes
) -> np.ndarray:
    """Constants of a law. A fit asks for the same ones for each of its recordings."""
    return constants(dict(values), np.frombuffer(lengths))


def law_over_time(
    form: Form,
    force: np.ndarray,
    step: np.ndarray,
    constants: np.ndarray,
    memory: np.ndarray,
    depth: np.ndarray | None = None,
    slide_step: np.ndarray | None = None,
) -> np.ndarray:
    """Run one law over t samples of n points; return (t, n) float. The numbers are those of the same run step by step.

    Parameters
    ----------
    form : Form
        With a law.
    force, depth, slide_step : (t, n) float
        Inputs of the law, see :class:`.TexelInput`.
    step : (t,) int
        The row of `constants` that belongs to each sample.
    constants : (m, c) float
        A row for each different duration of a step.
    memory : (n, state_size) float
        Brought up to date.
    """
    assert form.law is not None
    # Contiguous arrays of one type, so that the law is compiled only once.
    force = np.ascontiguousarray(force, dtype=float)
    depth = _zeros(force.shape) if depth is None else np.ascontiguousarray(depth, dtype=float)
    slide_step = _zeros(force.shape) if slide_step is None else np.ascontiguousarray(slide_step, dtype=float)
    constants = np.ascontiguousarray(constants, dtype=float)
    result = np.empty_like(force)
    _over_time(form.law)(force, depth, slide_step, step, constants, memory, result)
    return result


@by_reference
class EffectProgram(NamedTuple):
    """The laws of m sensors as arrays. Those of sensor s have the indices ``first_law[s]`` to ``first_law[s + 1]``.

    Attributes
    ----------
    first_law : (m + 1,) int
    first_unclipped : (m,) int
        From this index on, laws act after the normal force was clipped at zero.
    law : (laws,) int
        Number of the law, for :func:`call_law`.
    state : (laws,) int
        First column of its state in the memory.
    row : (laws,) int
        Row of its constants for the first length of step; those for the other lengths follow.
    first_friction_law : (m + 1,) int
    friction_law, friction_row : (friction laws,) int
    constants : (rows, c) float
    addresses : (…) int
        Of the machine code of all laws, by number (see :func:`prepare_laws`).
    state_size : int
        Number of columns that the memory of a point needs.
    """

    first_law: np.ndarray
    first_unclipped: np.ndarray
    law: np.ndarray
    state: np.ndarray
    row: np.ndarray
    first_friction_law: np.ndarray
    friction_law: np.ndarray
    friction_row: np.ndarray
    constants: np.ndarray
    addresses: np.ndarray
    state_size: int

    @property
    def is_empty(self) -> bool:
        """True if no sensor has an effect that acts on forces."""
        return len(self.law) == 0 and len(self.friction_law) == 0

    def memory(self, points: int) -> np.ndarray:
        """Return the memory of untouched points, (points, state_size) float."""
        return np.zeros((points, self.state_size))


def compile_program(stacks: Sequence[Sequence[Effect]], dt: ArrayLike) -> EffectProgram:
    """Return the laws that act on the forces of several sensors.

    Parameters
    ----------
    stacks : sequence of sequences of Effect
        The effects of each sensor; effects on readings are ignored.
    dt : (m,) float, s
        Lengths of step that will occur. The argument `step_length` of :func:`apply_force_laws` is an index of these.
    """
    lengths = np.atleast_1d(np.asarray(dt, dtype=float))
    tables: list[np.ndarray] = []  # of each law, (m, c) with a c of its own
    first_law, first_unclipped, first_friction_law = [0], [], [0]
    laws: list[tuple[int, int, int]] = []
    friction_laws: list[tuple[int, int]] = []
    state_size = 0
    for stack in stacks:
        state, unclipped = 0, 0
        for item, form in in_signal_order(stack, readout=False):
            if form.constants is None:
                continue
            row = len(tables) * len(lengths)
            tables.append(form.constants(complete_values(item), lengths))
            if form.law is not None:
                laws.append((_number_of(form.law, _law_over_points), state, row))
                state += form.state_size
                unclipped += form.after_clip
            else:
                assert form.friction_law is not None
                friction_laws.append((_number_of(form.friction_law, _friction_law_over_points), row))
        first_law.append(len(laws))
        first_unclipped.append(len(laws) - unclipped)
        first_friction_law.append(len(friction_laws))
        state_size = max(state_size, state)
    constants = np.zeros((len(tables), len(lengths), max((table.shape[1] for table in tables), default=1)))
    for own, table in zip(constants, tables, strict=True):
        own[:, : table.shape[1]] = table
    law, law_state, law_row = np.array(laws, dtype=np.int64).reshape(-1, 3).T.copy()
    friction_law, friction_row = np.array(friction_laws, dtype=np.int64).reshape(-1, 2).T.copy()
    program = EffectProgram(
        first_law=np.array(first_law, dtype=np.int64),
        first_unclipped=np.array(first_unclipped, dtype=np.int64),
        law=law,
        state=law_state,
        row=law_row,
        first_friction_law=np.array(first_friction_law, dtype=np.int64),
        friction_law=friction_law,
        friction_row=friction_row,
        constants=constants.reshape(len(tables) * len(lengths), constants.shape[2]),
        addresses=_ADDRESSES,
        state_size=state_size,
    )
    prepare_laws(program)
    return program


class TexelMotion(NamedTuple):
    """How a texel is pressed.

    Attributes
    ----------
    depth : float, m
        At the end of the step, zero or less where nothing touches.
    rate : float, m/s
        Of the depth, during the step.
    slide_step : float, m
        Distance slid in the step.
    speed : float, m/s
        Of sliding.
    """

    depth: float
    rate: float
    slide_step: float
    speed: float


@by_reference
class TexelContacts(NamedTuple):
    """Penetration of texels and the results of it; arrays in blocks of n points.

    Attributes
    ----------
    depth, rate, slide_step, speed : (blocks, n) float
        See :class:`TexelMotion`; the depth is never negative.
    force : (blocks, n) float, N
        Normal force.
    by_depth, by_rate : (blocks, n) float, N/m and N·s/m
        Its derivatives by the depth at the end of the step and by the rate. Before :func:`apply_force_laws`, `by_rate` is the
        coefficient of damping (see :func:`.damping_coefficient`).
    friction_factor : (blocks, n) float
        Factor on the friction coefficients of Eq. 10–12; at speed zero also on what static friction can hold.
    extra_viscosity : (blocks, n) float, N·s/m
        Is added to `ct`.
    """

    depth: np.ndarray
    rate: np.ndarray
    slide_step: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    by_depth: np.ndarray
    by_rate: np.ndarray
    friction_factor: np.ndarray
    extra_viscosity: np.ndarray

    @classmethod
    def zeros(cls, blocks: int, points: int) -> TexelContacts:
        """Return arrays for so many blocks of so many points each."""
        return cls(*(np.zeros((blocks, points)) for _ in cls._fields))


class PointRange(NamedTuple):
    """Some neighbouring points of one block of :class:`TexelContacts`, and the rows of memory that belong to them.

    Attributes
    ----------
    block, first, number : int
    rows, first_row, offset : (…) int, int, int
        The memory of the i-th point is in row ``offset + rows.ravel()[first_row + i]``.
    """

    block: int
    first: int
    number: int
    rows: np.ndarray
    first_row: int
    offset: int


@kernel
def write_base_law(contacts: TexelContacts, block: int, point: int, motion: TexelMotion, law: ContactLaw) -> None:
    """Write the elastic force of a texel without effects, its tangent, and the coefficient of damping.

    Parameters
    ----------
    contacts : TexelContacts
    block, point : int
    motion : TexelMotion
    law : ContactLaw
        Of a whole texel.
    """
    depth, force, by_depth = motion.depth, 0.0, 0.0
    if depth > 0.0:
        force = elastic_force(depth, law)
        by_depth = elastic_stiffness(depth, force, law)
    contacts.depth[block, point], contacts.rate[block, point] = max(depth, 0.0), motion.rate
    contacts.slide_step[block, point], contacts.speed[block, point] = motion.slide_step, motion.speed
    contacts.force[block, point], contacts.by_depth[block, point] = force, by_depth
    contacts.by_rate[block, point] = damping_coefficient(law)


@kernel
def apply_force_laws(
    sensor: int,
    step_length: int,
    contacts: TexelContacts,
    points: PointRange,
    linear: bool,
    program: EffectProgram,
    memory: np.ndarray,
    commit: bool,
) -> None:
    """Turn what :func:`write_base_law` wrote into normal forces and their derivatives, with effects and damping.

    Parameters
    ----------
    sensor : int
    step_length : int
        Index of the length of the step, see :func:`compile_program`.
    contacts : TexelContacts
    points : PointRange
    linear : bool
        The base law is Eq. 8.
    program : EffectProgram
    memory : (N, state_size) float
    commit : bool
        Update the memory: once per step and point, at the end of the step.
    """
    columns, block = (contacts.force, contacts.by_depth, contacts.depth, contacts.slide_step), points.block
    for i in range(program.first_law[sensor], program.first_unclipped[sensor]):
        row = program.row[i] + step_length
        call_law(program.law[i], columns, points, program, row, memory, program.state[i], commit)
    for i in range(points.first, points.first + points.number):
        force, by_depth, by_rate = damped_force_derivatives(
            contacts.force[block, i], contacts.by_depth[block, i], contacts.by_rate[block, i], contacts.rate[block, i], linear
        )
        if force <= 0.0 or contacts.depth[block, i] <= 0.0:
            force = by_depth = by_rate = 0.0
        contacts.force[block, i], contacts.by_depth[block, i], contacts.by_rate[block, i] = force, by_depth, by_rate
    for i in range(program.first_unclipped[sensor], program.first_law[sensor + 1]):
        row = program.row[i] + step_length
        call_law(program.law[i], columns, points, program, row, memory, program.state[i], commit)


@kernel
def apply_friction_laws(
    sensor: int, contacts: TexelContacts, points: PointRange, program: EffectProgram, memory: np.ndarray
) -> None:
    """Write how the effects change friction, given speed and normal force; arguments as in :func:`apply_force_laws`."""
    for i in range(points.first, points.first + points.number):
        contacts.friction_factor[points.block, i], contacts.extra_viscosity[points.block, i] = 1.0, 0.0
    columns = contacts.speed, contacts.force, contacts.friction_factor, contacts.extra_viscosity
    for i in range(program.first_friction_law[sensor], program.first_friction_law[sensor + 1]):
        call_law(program.friction_law[i], columns, points, program, program.friction_row[i], memory, 0, False)


@kernel
def has_effects(sensor: int, program: EffectProgram) -> bool:
    """Return whether any effect acts on the forces of a sensor."""
    laws = program.first_law[sensor] < program.first_law[sensor + 1]
    return laws or program.first_friction_law[sensor] < program.first_friction_law[sensor + 1]


@kernel
def may_pull(sensor: int, program: EffectProgram) -> bool:
    """Return whether the normal force of a sensor can be negative."""
    return program.first_unclipped[sensor] < program.first_law[sensor + 1]
