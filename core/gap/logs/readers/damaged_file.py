# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of libraries about damaged files, as one sentence.

Their readers meet bytes that nobody foresaw and raise whatever their code comes upon, so no list of errors is complete. Only
the library's own calls stand inside :func:`damage_said`: a fault of ours keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from ....errors import FileError

Item = TypeVar("Item")
SMALL_FILE = 2**26
"""Bytes. A library that finds too little memory for a file no larger follows a damaged length; chosen without an experiment."""


@contextmanager
def damage_said(path: Path, kind: str) -> Iterator[None]:
    """Turn what a library raises on a damaged file into one sentence.

    Parameters
    ----------
    path : Path
    kind : str
        What the file should be, as in "MCAP".

    Raises
    ------
    FileError
        The library raised an error. What the system says of files keeps its own sentence, and so does too little memory for a
        large file.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, (FileError, FileNotFoundError, PermissionError)):
            raise
        if isinstance(error, MemoryError) and not (path.is_file() and path.stat().st_size <= SMALL_FILE):
            raise
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise FileError(
            f"'{path.name}' could not be read as {kind} ({reason}): it is damaged or cut off, copy it again."
        ) from error


def read_by(items: Iterable[Item], path: Path, kind: str) -> Iterator[Item]:
    """Yield what a library reads; what it raises meanwhile is said by :func:`damage_said`, what the caller raises is not."""
    iterator = iter(items)
    while True:
        with damage_said(path, kind):
            try:
                item = next(iterator)
            except StopIteration:
                return
        yield item
