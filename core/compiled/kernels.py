# SPDX-License-Identifier: GPL-3.0-or-later
"""``@kernel``: compiled by numba where numba is, plain Python where it is not.

``PALPATE_NUMBA=0`` switches compilation off; the numbers are the same to rounding (a test holds them to 1e-12). Nothing here
lets the compiler reorder arithmetic: no fastmath, because "same seed, same bits" is worth more than a few per cent.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from .kernel_fingerprint import fingerprint

COMPILED = False

if os.environ.get("PALPATE_NUMBA", "1") != "0":
    try:
        import numba

        COMPILED = True
    except ImportError:
        COMPILED = False


FINGERPRINT = fingerprint() if COMPILED else ""

KERNELS: list[Any] = []
"""All that numba compiles when it is first called; for saying how far that is."""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` for the types it is first called with, and keep the result in numba's cache.

    What is so compiled allocates nothing: numba counts no references in it (which would take more time in a small step than
    all the arithmetic, since every function counts for each of a hundred arrays) and refuses what would make an array.
    """
    if not COMPILED:
        return function
    return _compiled(function, _nrt=False)


def allocating_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`kernel` for a function that makes arrays. None of these is called in the inner loop."""
    if not COMPILED:
        return function
    return _compiled(function)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`kernel`, and become part of every caller, so that the caller's loops can run in vector registers.

    A loop that calls is not vectorised. Such a function takes and returns numbers, and chooses with ``a if c else b`` where a
    branch would do something.
    """
    if not COMPILED:
        return function
    return _compiled(function, forceinline=True, _nrt=False)


def _compiled(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    function.__qualname__ += f"_{FINGERPRINT}"  # part of the name under which numba keeps the result
    compiled: Callable[..., Any] = numba.njit(
        cache=True, no_cfunc_wrapper=True, fastmath=False, error_model="numpy", nogil=True, **options
    )(function)
    KERNELS.append(compiled)
    return compiled


# --- functions that compiled code finds by an address, so that it need not be compiled anew for each

if COMPILED:
    from llvmlite import ir
    from numba import carray, types
    from numba.extending import intrinsic

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
        """Call what :func:`compiled_callback` made, from a kernel."""
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
        """Only compiled code has addresses."""
        raise NotImplementedError

    carray = call_address = compiled_callback
