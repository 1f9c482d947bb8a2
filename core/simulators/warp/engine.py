# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp, which is imported only when it is asked for."""

from __future__ import annotations

import importlib
from types import ModuleType

from ...errors import PalpateError

OLDEST = 1, 19
"""Oldest version of Warp with which the translation was tried."""


def require_warp() -> ModuleType:
    """Return Warp; raise :class:`.PalpateError` where it is missing or too old."""
    try:
        warp = importlib.import_module("warp")
        version = str(warp.__version__)
    except (ImportError, AttributeError) as error:
        raise PalpateError(
            "Kernels on Warp need the package warp-lang, which is not installed: run 'pip install warp-lang'."
        ) from error
    numbers = tuple(int(part) for part in version.split(".")[:2] if part.isdigit())
    if numbers < OLDEST:
        wanted = ".".join(map(str, OLDEST))
        raise PalpateError(
            f"Warp is version {version}, and kernels need {wanted} or later: run 'pip install --upgrade warp-lang'."
        )
    return warp
