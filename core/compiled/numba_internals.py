# SPDX-License-Identifier: GPL-3.0-or-later
"""What Palpate uses of numba and LLVM beyond their documented interface. No other module imports such parts.

A release of numba may change them. Where one of them is missing, or numba itself is, or ``PALPATE_NUMBA=0`` is set, nothing is
compiled: all kernels then run as plain Python, with the same numbers to rounding, only slowly.
"""

from __future__ import annotations

import os
from typing import Any

COMPILED = False
"""Whether kernels are compiled."""
REASON = "PALPATE_NUMBA is 0"
"""Why nothing is compiled; empty otherwise."""

if os.environ.get("PALPATE_NUMBA", "1") != "0":
    try:
        import numba as _numba
        from llvmlite import ir
        from numba import carray, typeof, types
        from numba.core import cgutils
        from numba.core.cgutils import get_or_insert_function
        from numba.core.cpu import CPUTargetOptions
        from numba.core.datamodel import models
        from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
        from numba.core.typing.templates import AttributeTemplate, infer_getattr
        from numba.extending import NativeValue, intrinsic, register_model, typeof_impl, unbox

        numba: Any = _numba
        COMPILED, REASON = True, ""
    except (ImportError, AttributeError) as error:
        REASON = str(error)

if not COMPILED:
    numba = ir = carray = typeof = types = CPUTargetOptions = cgutils = None
    get_or_insert_function = models = impl_ret_borrowed = None
    lower_getattr_generic = AttributeTemplate = infer_getattr = None
    NativeValue = intrinsic = register_model = typeof_impl = unbox = None


def known_options(**options: bool) -> dict[str, bool]:
    """Return those options of ``numba.njit`` that this release of numba knows; the others only make kernels faster."""
    return {name: value for name, value in options.items() if hasattr(CPUTargetOptions, name)}
