# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp, which is imported only when it is asked for."""

from __future__ import annotations

import importlib
import warnings
from types import ModuleType

from ...errors import PalpateError, ParameterError

OLDEST = 1, 19
"""Oldest version of Warp with which the translation was tried."""
FAST_FLOAT64 = 60, 70, 80, 90, 100
"""Compute capabilities whose cards compute float64 at half the speed of float32; all others at a thirty-second or less."""


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


def require_device(warp: ModuleType, name: str, single: bool) -> str:
    """Return the name of a device; raise :class:`.ParameterError` where it is not there, and warn where float64 is slow."""
    known = [str(one) for one in warp.get_devices()]
    if name not in known:
        driver = warp.get_cuda_driver_version()
        if name.startswith("cuda") and driver is not None and not warp.is_cuda_available():
            raise ParameterError(
                f"The NVIDIA driver is for CUDA {'.'.join(map(str, driver))}, which is too old for Warp {warp.__version__}: "
                "update the driver, or take the device cpu."
            )
        raise ParameterError(f"Warp has no device '{name}' here: take one of {', '.join(known)}.")
    device = warp.get_device(name)
    if device.is_cuda and not single and device.arch not in FAST_FLOAT64:
        warnings.warn(f"'{device.name}' is slow in float64: single=True is faster there, and less exact.", stacklevel=3)
    return name
