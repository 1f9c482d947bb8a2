# SPDX-License-Identifier: GPL-3.0-or-later
"""The engines that plug-ins belong to, which are imported only on demand."""

from __future__ import annotations

import importlib.metadata
from types import ModuleType

from ..core.errors import PalpateError


def require_engine(module: str, package: str, oldest: tuple[int, int]) -> ModuleType:
    """Return the module of an engine; raise :class:`.PalpateError` where it is missing or too old.

    Parameters
    ----------
    module, package : str
        Its name in Python, and the one by which pip installs it.
    oldest : (int, int)
        Oldest version with which the plug-in was tried.
    """
    try:
        engine = importlib.import_module(module)
        version = importlib.metadata.version(package)
    except ImportError as error:  # PackageNotFoundError is one
        raise PalpateError(f"The plug-in needs {module}, which is not installed: run 'pip install {package}'.") from error
    numbers = tuple(int(part) for part in version.split(".")[:2] if part.isdigit())
    if numbers < oldest:
        wanted = ".".join(map(str, oldest))
        raise PalpateError(
            f"{module} is version {version}, and the plug-in needs {wanted} or later: run 'pip install --upgrade {package}'."
        )
    return engine
