# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice between the OpenEXR library and Palpate's own codec for reading images, made once per process.

The library is used wherever it can be loaded safely. In some Blenders it cannot: Blender carries the same library, and when the
dynamic linker mixes the symbols of the two, the first file written ends in a segmentation fault (seen in Debian's Blender 4.3).
Inside Blender the library is therefore loaded only after a check in a process of its own has passed. The add-on installs that
check with :func:`set_safety_check`.
"""

from __future__ import annotations

import importlib.util
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

from . import exr_codec, exr_library

LIBRARY = "OpenEXR"
"""Name of the package on PyPI and of its module."""
HOST = "bpy"
"""Module whose presence means that this process holds Blender, and with it another copy of the library."""


@dataclass(frozen=True)
class Backend:
    """What reads images in this process.

    Attributes
    ----------
    module : module
        :mod:`.exr_library` or :mod:`.exr_codec`, which have the same ``read``.
    reason : str
        Why it was chosen, for people.
    """

    module: ModuleType
    reason: str

    def __str__(self) -> str:
        name = f"the {LIBRARY} library" if self.module is exr_library else "Palpate's own codec"
        return f"{name} ({self.reason})"


_lock = threading.Lock()
_chosen: Backend | None = None
_is_safe: Callable[[], bool] | None = None


def set_safety_check(check: Callable[[], bool] | None) -> None:
    """Install the function that tells whether the library can be loaded into this process; None removes it.

    Parameters
    ----------
    check : callable
        Called at most once, when the first image is read, from any thread.
    """
    global _chosen, _is_safe
    with _lock:
        _chosen, _is_safe = None, check


def backend() -> Backend:
    """Return what reads images in this process; the first call decides and may wait for the safety check."""
    global _chosen
    with _lock:
        if _chosen is None:
            _chosen = _choose()
        return _chosen


def describe() -> str:
    """Return in words which backend is at work, without making the choice."""
    return str(_chosen) if _chosen is not None else "not used yet in this session"


def _choose() -> Backend:
    if LIBRARY not in sys.modules and importlib.util.find_spec(LIBRARY) is None:
        return Backend(exr_codec, f"{LIBRARY} is not installed")
    if _is_safe is None:
        if HOST in sys.modules:
            return Backend(exr_codec, f"{LIBRARY} is checked beside Blender only while the add-on is enabled")
        return Backend(exr_library, "no Blender in this process")
    if _is_safe():
        return Backend(exr_library, "checked in a process of its own")
    return Backend(exr_codec, f"{LIBRARY} does not work beside this Blender's own copy")
