# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of the operating system in our sentences."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import FileError


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
