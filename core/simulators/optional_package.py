# SPDX-License-Identifier: GPL-3.0-or-later
"""Packages that only some files need."""

from __future__ import annotations

import importlib
from types import ModuleType

from ..errors import FileError


def optional_package(name: str, why: str, package: str | None = None) -> ModuleType:
    """Return a module, or raise FileError with the command that installs its package.

    Parameters
    ----------
    name : str
        Of the module.
    why : str
        What needs it, as a clause.
    package : str, optional
        What is installed. Default: the name of the module.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        wanted = package or name
        raise FileError(f"{why}, and the package {wanted} is missing: pip install {wanted}.") from error
