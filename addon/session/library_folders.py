# SPDX-License-Identifier: GPL-3.0-or-later
"""Where matplotlib keeps its list of fonts: in the extension's user folder, since an extension may write nowhere else.

By default it makes folders in the user's home. numba's folder is chosen by :mod:`.dependencies`.
"""

from __future__ import annotations

import os
import sys

from .dependencies import root_package

VARIABLE = "MPLCONFIGDIR"
_chosen: str | None = None


def register() -> None:
    """Name the folder, unless somebody has named one, matplotlib is loaded already, or Palpate is no extension here."""
    global _chosen
    package = root_package()
    if VARIABLE in os.environ or "matplotlib" in sys.modules or not package.startswith("bl_ext."):
        return
    import bpy

    _chosen = os.environ[VARIABLE] = bpy.utils.extension_path_user(package, path="matplotlib")


def unregister() -> None:
    """Forget the folder, if it is still the one that was named."""
    global _chosen
    if _chosen is not None and os.environ.get(VARIABLE) == _chosen:
        del os.environ[VARIABLE]
    _chosen = None
