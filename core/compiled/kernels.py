# SPDX-License-Identifier: GPL-3.0-or-later
"""``@kernel``: a function that numba compiles where it can, and that runs as plain Python elsewhere.

``PALPATE_NUMBA=0`` switches compilation off; the numbers are the same to rounding (a test holds them to 1e-12). The compiler
may not reorder arithmetic: there is no fastmath, because "same seed, same bits" is worth more than a few per cent.

Where numba is there, kernels can still be interpreted, until compiled code is ready or because the compiler failed
(:func:`interpret_kernels`, :func:`compile_kernels`). A run may change over between two calls of kernels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from . import kernel_dispatcher
from .kernel_dispatcher import KernelDispatcher, are_interpreted, compile_kernels, interpret_kernels
from .numba_internals import COMPILED, carray, intrinsic, ir, known_options, typeof, types

KERNEL_MARKS = (
    b"@kernel",
    b"@inlined",
    b"@allocating_kernel",
    b"@by_reference",
    b"KIND = Kind(",
    b"from numba",
    b"= specified(",
)
"""A file that holds one of these influences the compiled code.

The laws of effects are compiled as well, and the specified parameters of a sensor are the fields of the contact law. Of the
packages laws and compiled every file counts.
"""


CORE = Path(__file__).resolve().parents[1]


@cache
def fingerprint() -> str:
    """Return a hash of all files in core that kernels are made from.

    A compiled kernel contains the machine code of the kernels that it calls, but numba looks only at a kernel's own file to
    see whether its cached result is still good. After a change in another file, or an upgrade, old code would go on running.
    """
    digest = hashlib.sha256()
    for path in sorted(CORE.rglob("*.py")):
        source = path.read_bytes()
        if path.parent.name in ("laws", "compiled") or any(mark in source for mark in KERNEL_MARKS):
            digest.update(source)
    return digest.hexdigest()[:12]


__all__ = [
    "COMPILED",
    "KERNELS",
    "address_of",
    "addressed_kernel",
    "allocating_addressed_kernel",
    "allocating_kernel",
    "are_interpreted",
    "call_address",
    "carray",
    "compile_kernels",
    "inlined",
    "interpret_kernels",
    "kernel",
    "plain",
    "pointer_to",
    "with_plain_form",
]

FINGERPRINT = fingerprint() if COMPILED else ""

KERNELS: list[Any] = kernel_dispatcher.KERNELS
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
    settings = {"nopython": True, "fastmath": False, "error_model": "numpy", "nogil": True, "boundscheck": None}
    return KernelDispatcher.of(function, {**settings, "no_cfunc_wrapper": True, **options})


# --- functions that kernels call by their address: they are compiled once, and not inside each of their callers

if COMPILED:

    def addressed_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Do as :func:`kernel` for a function without result that kernels call by its address (:func:`address_of`)."""
        return _compiled(function, no_cfunc_wrapper=False, **known_options(_nrt=False))

    def allocating_addressed_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Do as :func:`addressed_kernel` for a function that makes arrays, also of pointers."""
        return _compiled(function, no_cfunc_wrapper=False)

    def address_of(function: Any, *arguments: Any) -> int:
        """Compile an :func:`addressed_kernel` for arguments such as these, and return the address of its machine code.

        Zero if kernels are interpreted, or are from now on because the compiler failed.
        """
        kinds = tuple(one if isinstance(one, types.Type) else typeof(one) for one in arguments)
        return int(function.address(kinds))

    def pointer_to(integers: bool = False) -> Any:
        """Return the type of a pointer to floats or integers, as an argument of :func:`address_of`."""
        return types.CPointer(types.int64 if integers else types.float64)

    @intrinsic
    def call_address(_context, address, *arguments):  # type: ignore[no-untyped-def]
        """Call an :func:`addressed_kernel` from a kernel; an array is given as its address."""
        kinds = [types.unliteral(one) for one in arguments]
        signature = types.void(types.int64, types.StarArgTuple.from_types(kinds))

        def codegen(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            given = [builder.extract_value(arguments[1], i) for i in range(len(kinds))]
            kind = ir.FunctionType(ir.VoidType(), [one.type for one in given])
            builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), given)
            return context.get_dummy_value()

        return signature, codegen

else:

    def addressed_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function: without numba nothing has an address."""
        return function

    allocating_addressed_kernel = addressed_kernel

    def address_of(function: Any, *arguments: Any) -> int:
        """Return zero: only compiled code has addresses."""
        return 0

    def pointer_to(integers: bool = False) -> Any:
        """Return None: only compiled code has pointers."""

    def call_address(_address: int, *_arguments: Any) -> None:
        """Raise: only compiled code has addresses."""
        raise RuntimeError("Nothing can be called by its address without numba: look at COMPILED first.")


def with_plain_form(plain_form: Callable[..., Any]) -> Callable[[Any], Any]:
    """Let a kernel that only works compiled, as one that calls addresses, run as `plain_form` where it is interpreted."""

    def decorate(compiled: Any) -> Any:
        if not COMPILED:
            return plain_form
        compiled.plain_form = plain_form
        return compiled

    return decorate
