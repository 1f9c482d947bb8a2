# SPDX-License-Identifier: GPL-3.0-or-later
"""A list of files with their SHA-256, a line for each, which only grows at its end (:class:`.GrowingFile`).

It is written in the format of ``sha256sum``, so ``sha256sum -c images.sha256`` checks a folder without Palpate.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from ..errors import FileError, os_error_reason
from .regular_file import open_regular

_LINE = re.compile(rb"([0-9a-f]{64})  ([!-~]{1,200})\n")
_LONGEST_LINE = 300


def checksum_line(name: str, sha256: str) -> bytes:
    """Return the line of one file."""
    return f"{sha256}  {name}\n".encode("ascii")


def read_checksums(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and the SHA-256 of each file of a list.

    Raises
    ------
    FileError
        The list is missing, cannot be read, or is something else.
    """
    try:
        with open_regular(path) as file:
            while line := file.readline(_LONGEST_LINE):
                found = _LINE.fullmatch(line)
                if found is None:
                    raise FileError(f"'{path}' is damaged (a line is not a SHA-256 with a name): bake again.")
                yield found[2].decode("ascii"), found[1].decode("ascii")
    except FileNotFoundError:
        raise FileError(f"'{path}' is missing from the bake: bake again.") from None
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error
