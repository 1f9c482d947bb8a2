# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of the packages that Palpate needs are installed, and where they keep files: an extension may write nowhere else.

Modules are looked up without importing them, because enabling the add-on must stay instant.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import sys

REQUIRED_MODULES = ("numpy", "numba", "llvmlite", "trimesh", "filelock")
"""Modules without which playing and baking are impossible. Figures, reports and the gap analysis need more packages, which
pyproject.toml lists; they are imported where they are used."""


def root_package() -> str:
    """Return the name under which Blender knows the extension: ``bl_ext.<repository>.palpate``, or ``palpate``."""
    return __package__.removesuffix(".addon.session")


def missing_modules() -> list[str]:
    """Return the names of the needed modules that cannot be found."""
    return [name for name in REQUIRED_MODULES if not _can_be_found(name)]


def _can_be_found(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):  # a module without a spec, or a finder that refuses
        return False


def debug_info() -> str:
    """Return versions and paths of this installation for a maintainer, as plain text."""
    import bpy

    from ...core.io import tactile_exr

    missing = missing_modules()
    return "\n".join(
        [
            f"Palpate in {root_package()}",
            f"Blender {bpy.app.version_string} ({bpy.app.build_platform.decode(errors='replace')})",
            f"Python {sys.version.split()[0]} on {platform.platform()} ({platform.machine()})",
            f"missing: {', '.join(missing) or 'nothing'}",
            f"tactile images: by {tactile_exr.library()}",
            *(f"{name}: {importlib.util.find_spec(name).origin}" for name in REQUIRED_MODULES if name not in missing),
        ]
    )


def choose_numba_cache() -> None:
    """Make numba keep its compiled code in the extension's user folder.

    By default numba writes beside the source. There an upgrade deletes the code, and a system-wide installation forbids
    writing. This has an effect only before numba is imported. A folder that the user has chosen stays.
    """
    if "NUMBA_CACHE_DIR" in os.environ or "numba" in sys.modules:
        return
    package = root_package()
    if not package.startswith("bl_ext."):  # not installed as an extension: keep numba's default
        return
    import bpy

    os.environ["NUMBA_CACHE_DIR"] = bpy.utils.extension_path_user(package, path="numba", create=True)


_FONTS = "MPLCONFIGDIR"
_fonts_folder: str | None = None


def register() -> None:
    """Name the folder in which matplotlib keeps its list of fonts, which by default lies in the user's home.

    Nothing is done if somebody has named one, matplotlib is loaded already, or Palpate is no extension here.
    """
    global _fonts_folder
    package = root_package()
    if _FONTS in os.environ or "matplotlib" in sys.modules or not package.startswith("bl_ext."):
        return
    import bpy

    _fonts_folder = os.environ[_FONTS] = bpy.utils.extension_path_user(package, path="matplotlib")


def unregister() -> None:
    """Forget the folder, if it is still the one that was named."""
    global _fonts_folder
    if _fonts_folder is not None and os.environ.get(_FONTS) == _fonts_folder:
        del os.environ[_FONTS]
    _fonts_folder = None
