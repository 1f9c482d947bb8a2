# SPDX-License-Identifier: GPL-3.0-or-later
"""TOML files: reading one, and the names and numbers in it that may be anything."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from ..errors import FileError
from .regular_file import read_bounded

LARGEST_FILE = 16 * 2**20
"""Bytes; people write these files, and a rig or a sensor has some kilobytes."""
LONGEST_NAME = 255
"""Characters of a name in a file."""


def read_toml(path: str | os.PathLike, what: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : path
    what : str
        What the file describes, for messages, as in "rig".

    Raises
    ------
    FileError
        There is no such file, it cannot be read, or it is not TOML.
    """
    name = Path(path).name
    content = read_bounded(path, LARGEST_FILE, what, f"a {what} has some kilobytes, give another file")
    try:
        return tomllib.loads(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise FileError(f"'{name}' is not a text file in UTF-8: choose a {what}'s .toml.") from error
    except RecursionError as error:
        raise FileError(f"'{name}' nests its tables or lists too deeply: a {what} needs two levels.") from error
    except ValueError as error:  # TOMLDecodeError, or a number of thousands of digits
        raise FileError(f"'{name}' is not TOML ({error}): mend that line.") from error


def checked_name(name: Any, where: str) -> str:
    """Return a name that a file gives.

    Raises
    ------
    FileError
        It is no text, or a text that cannot be a name; `where` says of which file.
    """
    if not isinstance(name, str) or not name.strip():
        raise FileError(f"The name in {where} is {name!r:.60}: write a text.")
    if len(name) > LONGEST_NAME:
        raise FileError(f"The name in {where} has {len(name)} characters: give it at most {LONGEST_NAME}.")
    if not name.isprintable():
        raise FileError(f"The name in {where} is {name!r:.60}, which has control characters: write it without them.")
    return name


def is_number(value: Any) -> bool:
    """Return whether a value of a file is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1.7e308
