# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp and other engines, which are imported only when they are asked for."""

from __future__ import annotations

import importlib.metadata
import warnings
from types import ModuleType

from ...errors import PalpateError, ParameterError

OLDEST = 1, 19
"""Oldest version of Warp with which the translation was tried."""
FAST_FLOAT64 = 60, 70, 80, 90, 100
"""Compute capabilities whose cards compute float64 at half the speed of float32; all others at a thirty-second or less."""


def require_engine(module: str, package: str, oldest: tuple[int, int], who: str = "The plug-in") -> ModuleType:
    """Return the module of an engine; raise :class:`.PalpateError` where it is missing or too old.

    Parameters
    ----------
    module, package : str
        Its name in Python, and the one by which pip installs it.
    oldest : (int, int)
        Oldest version with which it was tried.
    who : str
        What needs it, for messages.
    """
    try:
        engine = importlib.import_module(module)
        version = importlib.metadata.version(package)
    except ImportError as error:  # PackageNotFoundError is one
        raise PalpateError(f"{who} needs {module}, which is not installed: run 'pip install {package}'.") from error
    numbers = tuple(int(part) for part in version.split(".")[:2] if part.isdigit())
    if numbers < oldest:
        wanted = ".".join(map(str, oldest))
        raise PalpateError(
            f"{module} is version {version}, and {who[0].lower()}{who[1:]} needs {wanted} or later: "
            f"run 'pip install --upgrade {package}'."
        )
    return engine


def require_warp() -> ModuleType:
    """Return Warp; raise :class:`.PalpateError` where it is missing or too old."""
    return require_engine("warp", "warp-lang", OLDEST, "A sensor on Warp")


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
