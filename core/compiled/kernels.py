# SPDX-License-Identifier: GPL-3.0-or-later
"""``@kernel``: a function that numba compiles where it can, and that runs as plain Python elsewhere.

``PALPATE_NUMBA=0`` switches compilation off; the numbers are the same to rounding (a test holds them to 1e-12). The compiler
may not reorder arithmetic: there is no fastmath, because "same seed, same bits" is worth more than a few per cent.

Where numba is there, kernels can still be interpreted, until compiled code is ready or because the compiler failed
(:func:`interpret_kernels`, :func:`compile_kernels`). A run may change over between two calls of kernels.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from .kernel_fingerprint import fingerprint
from .numba_internals import (
    COMPILED,
    CPUDispatcher,
    JITCodeLibrary,
    compiler,
    intrinsic,
    ir,
    known_options,
    typeof,
    types,
    typing,
)
from .numba_internals import carray as carray  # of this package only: kernels elsewhere get it from here

# Numba's dispatcher for kernels: every function is compiled once, and may be interpreted meanwhile.
#
# Numba optimises each function with all that it calls, and then once more inside each of its callers. In a program that is one
# tree of small functions, LLVM sees the leaves ten times. Here a kernel that another kernel calls is only translated to LLVM's
# intermediate code and linked into the caller; optimised and turned into machine code is what Python calls, and what kernels
# call by address. Constants among the arguments do not make a version of their own either: where they matter, the call is
# inlined.

KERNELS: list[Any] = []
"""All functions that numba compiles when they are first called; their signatures tell how far that is."""
_interpreted = False
_failed = False


def are_interpreted() -> bool:
    """Return True if kernels run as plain Python now: without numba always."""
    return _interpreted or not COMPILED


def interpret_kernels() -> None:
    """Run all kernels as plain Python from now on."""
    global _interpreted
    _interpreted = True
    _set_class()


def compile_kernels() -> None:
    """Run all kernels as compiled code from now on, unless the compiler has failed in this process.

    Each is compiled or loaded when it is first called.
    """
    global _interpreted
    if _interpreted and not _failed:
        _interpreted = False
        _set_class()


def _set_class() -> None:
    for one in KERNELS:
        one.__class__ = _InterpretedKernel if _interpreted else KernelDispatcher


def _give_up(error: Exception) -> None:
    """Go on with interpreted kernels after the compiler has failed."""
    global _failed
    if not _failed:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        print(f"Palpate's solver cannot be compiled here and computes slowly, with the same numbers: {reason}", file=sys.stderr)
        _failed = True
        interpret_kernels()


if COMPILED:
    from .numba_internals import COMPILER_FAULTS, FunctionCache

    class _Cache(FunctionCache):
        """Numba's cache of one kernel. What cannot be kept is used in this process alone."""

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            """Return the kept machine code for these types, or None."""
            try:
                return super().load_overload(sig, target_context)
            except OSError:
                return None

        def save_overload(self, sig: Any, data: Any) -> None:
            """Keep what was compiled for these types."""
            try:
                super().save_overload(sig, data)
            except OSError as error:
                _say_not_kept(error)

    _said: set[str] = set()

    def _say_not_kept(error: Exception) -> None:
        if not _said:
            _said.add("not kept")
            print(
                f"Palpate's compiled solver cannot be kept and will be compiled again by the next process: {error}; make room "
                "or set NUMBA_CACHE_DIR to a folder that can be written.",
                file=sys.stderr,
            )

    class _LinkedLibrary(JITCodeLibrary):
        """Intermediate code of a kernel that is only linked into others; what it calls is linked there as well."""

        def finalize(self) -> None:
            """Count as complete, without optimisation and machine code."""
            self._finalized = True

    class _Flags(compiler.Flags):
        """Numba's options of a compilation. Comparing them by what was set, not option by option, saves a tenth of the time."""

        def __eq__(self, other: object) -> bool:
            return self._values == getattr(other, "_values", None)

        def __hash__(self) -> int:
            return len(self._values)

    class KernelDispatcher(CPUDispatcher):
        """A kernel that runs compiled."""

        plain_form: Callable[..., Any] | None = None

        @classmethod
        def of(cls, function: Callable[..., Any], options: dict[str, Any]) -> Any:
            """Make a kernel of a Python function."""
            made = cls(function, targetoptions=options)
            try:
                made._cache = _Cache(function)
            except (OSError, RuntimeError) as error:  # there is no folder in which code could be kept
                _say_not_kept(error)
            KERNELS.append(made)
            if _interpreted:
                made.__class__ = _InterpretedKernel
            return made

        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self._linked: dict[tuple[Any, ...], tuple[Any, Any]] = {}
            self._addresses: dict[tuple[int, ...], tuple[tuple[Any, ...], int]] = {}

        @property
        def is_translated(self) -> bool:
            """Whether the compiler has dealt with this kernel."""
            return bool(self._linked or self.overloads)

        def address(self, kinds: tuple[Any, ...]) -> int:
            """Compile for arguments of these types and return the address of the function in C's conventions, or zero."""
            if _interpreted:
                return 0
            identities = tuple(map(id, kinds))  # equal types are one object; comparing what is in them takes a tenth of a ms
            if identities not in self._addresses:
                try:
                    self.compile(kinds)
                except COMPILER_FAULTS as error:
                    _give_up(error)
                    return 0
                result = self.overloads[kinds]
                address = int(result.library.get_pointer_to_function(result.fndesc.llvm_cfunc_wrapper_name))
                self._addresses[identities] = kinds, address  # the types are kept, so that no other gets their identity
            return self._addresses[identities][1]

        def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
            """Return compiled code for arguments such as these, for numba, which calls it; where that fails, plain Python."""
            try:
                return super()._compile_for_args(*args, **kws)
            except COMPILER_FAULTS as error:
                _give_up(error)
                return self.plain_form or self.py_func

        def get_call_template(self, args: Any, kws: Any) -> tuple[Any, Any, tuple[Any, ...], dict[str, Any]]:
            """Return how another kernel calls this one, for numba's type inference."""
            pysig, args = self._compiler.fold_argument_types(args, kws)
            args = tuple(types.unliteral(one) for one in args)
            self._link(args)
            signatures = [result.signature for result, _ in self._linked.values()]
            template = typing.make_concrete_template(f"CallTemplate({self.__name__})", self.__name__, signatures)
            return template, pysig, args, {}

        def get_overload(self, sig: Any) -> Any:
            """Return the key under which numba finds the code that a caller links."""
            return self._linked[tuple(sig)][1]

        def _link(self, args: tuple[Any, ...]) -> None:
            """Translate the function for these types to intermediate code, unless that was done."""
            if args in self._linked:
                return
            flags = _Flags()
            self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
            flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
            library = _LinkedLibrary(self.targetctx.codegen(), self.__qualname__)
            result = compiler.compile_extra(
                self.typingctx, self.targetctx, self.py_func, args, None, flags, self.locals, library=library
            )
            key = object()
            self.targetctx.insert_user_function(key, result.fndesc, [library, *library._linking_libraries])  # noqa: SLF001
            self._linked[args] = result, key

    class _InterpretedKernel(KernelDispatcher):
        """A kernel that runs as plain Python."""

        def __call__(self, *arguments: Any, **named: Any) -> Any:
            """Call the Python function."""
            return (self.plain_form or self.py_func)(*arguments, **named)

else:
    KernelDispatcher: Any = None  # type: ignore[no-redef]
    _InterpretedKernel: Any = None  # type: ignore[no-redef]


FINGERPRINT = fingerprint() if COMPILED else ""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` for the types it is first called with, and keep the result in numba's cache.

    Such a function allocates nothing. Numba then counts no references in it, which in a small step would take more time than
    all the arithmetic, and it refuses whatever would make an array.
    """
    return _compiled(function, **known_options(_nrt=False))


def allocating_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`kernel` for a function that makes arrays. None of these is called in the inner loop."""
    return _compiled(function)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`kernel`, and insert the machine code into every caller, whose loops can then run in vector registers.

    A loop with a call is not vectorised. Such a function takes and returns numbers, and selects with ``a if c else b`` instead
    of branching.
    """
    return _compiled(function, **known_options(_nrt=False, forceinline=True))


def plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the Python function that a kernel was made from: a formula without branches on its numbers also takes arrays."""
    return getattr(function, "py_func", function)


def _compiled(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    if not COMPILED:
        return function
    function.__qualname__ += f"_{FINGERPRINT}"  # part of the name under which numba keeps the result
    settings = {"nopython": True, "fastmath": False, "error_model": "numpy", "nogil": True, "boundscheck": None}
    return KernelDispatcher.of(function, {**settings, "no_cfunc_wrapper": True, **options})


# --- functions that kernels call by their address: they are compiled once, and not inside each of their callers


def addressed_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`kernel` for a function without result that kernels call by its address (:func:`address_of`)."""
    return _compiled(function, no_cfunc_wrapper=False, **known_options(_nrt=False))


def allocating_addressed_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Do as :func:`addressed_kernel` for a function that makes arrays, also of pointers."""
    return _compiled(function, no_cfunc_wrapper=False)


def address_of(function: Any, *arguments: Any) -> int:
    """Compile an :func:`addressed_kernel` for arguments such as these, and return the address of its machine code.

    Zero without numba, if kernels are interpreted, or are from now on because the compiler failed.
    """
    if not COMPILED:
        return 0
    return int(function.address(tuple(one if isinstance(one, types.Type) else typeof(one) for one in arguments)))


def pointer_to(integers: bool = False) -> Any:
    """Return the type of a pointer to floats or integers, as an argument of :func:`address_of`; None without numba."""
    return types.CPointer(types.int64 if integers else types.float64) if COMPILED else None


if COMPILED:

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
