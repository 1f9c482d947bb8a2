# SPDX-License-Identifier: GPL-3.0-or-later
"""Is everything here that Palpate needs? Looked up without importing, because enabling the add-on must stay instant."""

from __future__ import annotations

import importlib.util
import os
import platform
import sys

NEEDED = ("numpy", "numba", "llvmlite", "trimesh")


def root_package() -> str:
    """Return the name under which Blender knows the extension: ``bl_ext.<repository>.palpate``, or ``palpate``."""
    return __package__.removesuffix(".addon.session")


def missing() -> list[str]:
    """Names of the modules that cannot be found."""
    return [name for name in NEEDED if not _can_be_found(name)]


def _can_be_found(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):  # a module without a spec, or a finder that refuses
        return False


def debug_info() -> str:
    """Return what a maintainer has to know about this installation, as plain text."""
    import bpy

    from ...core.io import exr_backend

    lost = missing()
    return "\n".join(
        [
            f"Palpate in {root_package()}",
            f"Blender {bpy.app.version_string} ({bpy.app.build_platform.decode(errors='replace')})",
            f"Python {sys.version.split()[0]} on {platform.platform()} ({platform.machine()})",
            f"missing: {', '.join(lost) or 'nothing'}",
            f"tactile images: {exr_backend.describe()}",
            *(f"{name}: {importlib.util.find_spec(name).origin}" for name in NEEDED if name not in lost),
        ]
    )


def prepare_numba() -> None:
    """Let numba keep what it compiles in the extension's user folder.

    Beside the source, where it would write by itself, an upgrade wipes it and a system-wide installation forbids it.
    Only before numba is imported has this an effect; a folder that the user has chosen is kept.
    """
    if "NUMBA_CACHE_DIR" in os.environ or "numba" in sys.modules:
        return
    package = root_package()
    if not package.startswith("bl_ext."):  # not installed as an extension: numba's own choice is right
        return
    import bpy

    os.environ["NUMBA_CACHE_DIR"] = bpy.utils.extension_path_user(package, path="numba", create=True)


def solver():
    """Return :mod:`.simulation`, which loads numba, compiled: at the first use ever that takes a minute.

    Beside a window :mod:`.first_use` has seen to that before.
    """
    prepare_numba()
    from ...core.solver import precompile, simulation

    precompile.compile_solver_with_notice()
    return simulation
