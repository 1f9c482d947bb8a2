# SPDX-License-Identifier: GPL-3.0-or-later
"""``@kernel``: a function that numba compiles where it can, and that runs as plain Python elsewhere.

``PALPATE_NUMBA=0`` switches compilation off; the numbers are the same to rounding (a test holds them to 1e-12). The compiler
may not reorder arithmetic: there is no fastmath, because "same seed, same bits" is worth more than a few per cent.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .kernel_fingerprint import fingerprint
from .numba_internals import COMPILED, carray, intrinsic, ir, known_options, numba, types

__all__ = [
    "COMPILED",
    "KERNELS",
    "allocating_kernel",
    "call_address",
    "carray",
    "compiled_callback",
    "inlined",
    "kernel",
    "plain",
]

FINGERPRINT = fingerprint() if COMPILED else ""

KERNELS: list[Any] = []
"""All functions that numba compiles when they are first called; their signatures tell how far that is."""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` for the types it is first called with, and keep the result in numba's cache.

    Such a function allocates nothing. Numba then counts no references in it, which in a small step would take more time than
    all the arithmetic, and it refuses whatever would make an array.
    """
    if not COMPILED:
        return function
    return _compiled(function, **known_options(_nrt=False))


def allocating_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`kernel` for a function that makes arrays. None of these is called in the inner loop."""
    if not COMPILED:
        return function
    return _compiled(function)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`kernel`, and insert the machine code into every caller, whose loops can then run in vector registers.

    A loop with a call is not vectorised. Such a function takes and returns numbers, and selects with ``a if c else b`` instead
    of branching.
    """
    if not COMPILED:
        return function
    return _compiled(function, **known_options(_nrt=False, forceinline=True))


def plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the Python function that a kernel was made from: a formula without branches on its numbers also takes arrays."""
    return getattr(function, "py_func", function)


def _compiled(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    function.__qualname__ += f"_{FINGERPRINT}"  # part of the name under which numba keeps the result
    compiled: Callable[..., Any] = numba.njit(
        cache=True, no_cfunc_wrapper=True, fastmath=False, error_model="numpy", nogil=True, **options
    )(function)
    KERNELS.append(compiled)
    return compiled


# --- functions that kernels call by their address, so that the kernel need not be compiled anew for each of them

if COMPILED:
    _POINTERS, _INTEGER_POINTERS, _NUMBERS = range(7), (6,), 13
    """Which arguments of such a function are addresses of arrays, which of those arrays hold integers, and how many arguments
    there are."""

    def compiled_callback(function: Callable[..., Any]) -> Any:
        """Compile `function` for calls by its `address`, with pointers to arrays first and integers after them."""
        function.__qualname__ += f"_{FINGERPRINT}"
        kinds = [types.int64 if i in _INTEGER_POINTERS else types.float64 for i in _POINTERS]
        arguments = [types.CPointer(kind) for kind in kinds] + [types.int64] * (_NUMBERS - len(kinds))
        return numba.cfunc(types.void(*arguments), cache=True, error_model="numpy")(function)

    @intrinsic
    def call_address(_context, address, *numbers):  # type: ignore[no-untyped-def]
        """Call a function that :func:`compiled_callback` made, from a kernel."""
        signature = types.void(types.int64, types.StarArgTuple.from_types([types.int64] * _NUMBERS))

        def codegen(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            given = [builder.extract_value(arguments[1], i) for i in range(_NUMBERS)]
            kinds = [ir.IntType(64)] * _NUMBERS
            for i in _POINTERS:
                kinds[i] = (ir.IntType(64) if i in _INTEGER_POINTERS else ir.DoubleType()).as_pointer()
                given[i] = builder.inttoptr(given[i], kinds[i])
            kind = ir.FunctionType(ir.VoidType(), kinds)
            builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), given)
            return context.get_dummy_value()

        return signature, codegen

else:

    def compiled_callback(function: Callable[..., Any]) -> Any:
        """Raise: only compiled code has addresses."""
        raise RuntimeError(
            f"'{function.__name__}' has no address without numba: look at COMPILED first, and call the function itself."
        )

    def call_address(_address: int, *_numbers: int) -> None:
        """Raise: only compiled code has addresses."""
        raise RuntimeError("Nothing can be called by its address without numba: look at COMPILED first.")
