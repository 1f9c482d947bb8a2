# SPDX-License-Identifier: GPL-3.0-or-later
"""``@kernel``: compiled by numba where numba is, plain Python where it is not.

``PALPATE_NUMBA=0`` switches compilation off; the numbers are the same to rounding (a test holds them to 1e-12). Nothing here
lets the compiler reorder arithmetic: no fastmath, because "same seed, same bits" is worth more than a few per cent.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

COMPILED = False

if os.environ.get("PALPATE_NUMBA", "1") != "0":
    try:
        import numba

        COMPILED = True
    except ImportError:
        COMPILED = False


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` for the types it is first called with, and keep the result in numba's cache."""
    if not COMPILED:
        return function
    compiled: Callable[..., Any] = numba.njit(cache=True, fastmath=False, error_model="numpy", nogil=True)(function)
    return compiled
