# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors a user can cause, the warnings that do not stop the work, and what their sentences share.

Every message is one sentence that says what is wrong, where, and what to do about it. Drivers (operators, command line) show
``str(error)`` and nothing else; anything that is not a :class:`PalpateError` is our fault and shows its traceback.
"""

from __future__ import annotations

import difflib
import importlib
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from types import ModuleType


class PalpateError(Exception):
    """Base of all errors that the user can put right."""


class MeshError(PalpateError):
    """A mesh that no forces can be computed on (NaN vertices, no faces, no area)."""


class SensorError(PalpateError):
    """A sensor that cannot be built from its region or its parameters."""


class RegionError(SensorError):
    """A region that is gone, is empty or spans no face."""


class ImageError(SensorError):
    """A UV map that cannot lay out a tactile image."""


class PaintedError(SensorError):
    """A painted multiplier that is gone or holds what cannot be a factor."""


class ParameterError(PalpateError):
    """A number outside the range in which the model means anything."""


class EffectError(ParameterError):
    """An effect that the library does not have, or a parameter of one that means nothing."""


class ArgumentError(ParameterError):
    """An argument of a function for scripts that has a wrong type, shape or value; the message names the argument."""


class SceneError(PalpateError):
    """A scene that does not add up to a simulation (nothing to touch, reversed frame range, zero scale)."""


class FileError(PalpateError):
    """A file or folder that cannot be read, written or understood."""


class Cancelled(PalpateError):
    """The user stopped the work; what was finished is kept."""


@contextmanager
def read_errors_said(path: str | os.PathLike, what: str = "file") -> Iterator[None]:
    """Say in one sentence why the system does not open or read a file.

    Raises
    ------
    FileError
        There is no such file, it cannot be read, or its name has a NUL, which the name of no file has.
    """
    if "\0" in str(path):
        raise FileError(f"{str(path)!r} cannot be the name of a file: check it.")
    try:
        yield
    except FileNotFoundError as error:
        raise FileError(f"There is no {what} '{path}': check its name and folder.") from error
    except OSError as error:
        raise FileError(
            f"The {what} '{path}' could not be read ({os_error_reason(error)}): check its name and permissions."
        ) from error


def os_error_reason(error: OSError) -> str:
    """Return the operating system's words for an error, in lower case, as they stand inside our sentences."""
    return (error.strerror or str(error) or type(error).__name__).lower()


def imported(module: str, who: str, how: str = "") -> ModuleType:
    """Return an optional module; raise :class:`PalpateError` where it is missing.

    Parameters
    ----------
    module : str
    who : str
        What needs it, as "HDF5".
    how : str
        How to get it. Default: ``run 'pip install MODULE'``.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        advice = how or f"run 'pip install {module}'"
        raise PalpateError(f"{who} needs the package {error.name or module}, which is not installed: {advice}.") from error


def counted(number: int, noun: str) -> str:
    """Return a number with its noun in the singular or the plural, as "1 texel" or "1,024 texels"."""
    return f"{number:,} {noun}" + ("" if number == 1 else "s")


def did_you_mean(word: str, known: Iterable[str], otherwise: str, cutoff: float = 0.6) -> str:
    """Return the known word that is most like a wrong one as a question, or other advice if none is."""
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return f"did you mean '{near[0]}'?" if near else otherwise


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return a hint at the known name that is most similar to a wrong one, in brackets, or nothing."""
    near = did_you_mean(name, known, "")
    return f" ({near})" if near else ""
