# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of numba and LLVM beyond their documented interface that Palpate uses. No other module imports such parts.

A release of numba may change them. Where one of them is missing, or numba itself is, or ``PALPATE_NUMBA=0`` is set, nothing is
compiled: all kernels then run as plain Python, with the same numbers to rounding, only slowly.
"""

from __future__ import annotations

import os
import sys
from typing import Any

COMPILED = False
"""Whether kernels are compiled."""
REASON = "PALPATE_NUMBA is 0"
"""Why nothing is compiled; empty otherwise."""

TRIED = ("0.68.",)
"""Releases of numba with whose internals all tests passed. With others kernels are interpreted."""

if os.environ.get("PALPATE_NUMBA", "1") != "0":
    try:
        import numba as _numba

        if not _numba.__version__.startswith(TRIED):
            raise ImportError(
                f"Palpate computes slowly, as it was never tried with numba {_numba.__version__}: install numba {TRIED[-1]}*"
            )
        from llvmlite import ir
        from numba import carray, typeof, types
        from numba.core import cgutils, compiler, typing
        from numba.core.caching import FunctionCache
        from numba.core.cgutils import get_or_insert_function
        from numba.core.codegen import JITCodeLibrary
        from numba.core.cpu import CPUTargetOptions
        from numba.core.datamodel import models
        from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
        from numba.core.registry import CPUDispatcher
        from numba.core.typing.templates import AttributeTemplate, infer_getattr
        from numba.extending import NativeValue, intrinsic, register_model, typeof_impl, unbox

        COMPILER_FAULTS = (OSError, RuntimeError, MemoryError, ValueError, AttributeError)
        numba: Any = _numba
        COMPILED, REASON = True, ""
    except (ImportError, AttributeError) as error:
        REASON = str(error)
        if "numba" in sys.modules:  # it is there, but not as it was
            print(REASON, file=sys.stderr)

if not COMPILED:
    numba = ir = carray = typeof = types = CPUTargetOptions = cgutils = None
    compiler = typing = FunctionCache = JITCodeLibrary = CPUDispatcher = None
    get_or_insert_function = models = impl_ret_borrowed = None
    lower_getattr_generic = AttributeTemplate = infer_getattr = None
    NativeValue = intrinsic = register_model = typeof_impl = unbox = None

CAN_PACK = False
"""Whether machine code can be packed and unpacked; without that, kernels are compiled at first use."""
if COMPILED:
    try:
        from llvmlite.binding import get_host_cpu_features
        from numba.core import environment, serialize

        dumps: Any = serialize.dumps
        rebuild_environment: Any = environment._rebuild_env
        CAN_PACK = True
    except (ImportError, AttributeError):
        pass
if not CAN_PACK:
    dumps = rebuild_environment = get_host_cpu_features = None


def known_options(**options: bool) -> dict[str, bool]:
    """Return those options of ``numba.njit`` that this release of numba knows; the others only make kernels faster."""
    return {name: value for name, value in options.items() if hasattr(CPUTargetOptions, name)}


def processor_features() -> dict[str, bool]:
    """Return LLVM's names of this processor's features, and whether it has them."""
    return dict(get_host_cpu_features())


def reduced_overloads(kernel: Any) -> list[tuple[Any, Any]]:
    """Return numba's saved compiled versions of a kernel: signature and content, without the paths of source files."""
    found = []
    for signature, compiled in kernel.overloads.items():
        content = list(kernel._cache._impl.reduce(compiled))
        content[TYPE_ANNOTATION] = ""
        found.append((signature, tuple(content)))
    return found


def save_overload(kernel: Any, signature: Any, content: Any) -> None:
    """Put a compiled form of a kernel into numba's cache, as if it had been compiled here."""
    cache = kernel._cache
    cache._impl.locator.ensure_cache_path()
    cache._cache_file.save(cache._index_key(signature, kernel.targetctx.codegen()), content)


TYPE_ANNOTATION = 6
"""Where numba's tuple of a compiled form holds the listing of its source with types, in which paths stand."""
