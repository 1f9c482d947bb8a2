# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a log, whatever its format."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from ...errors import FileError, read_errors_said
from ...io.input_files import open_regular
from .log_table import LARGEST_FILE, LogFile
from .readers.array_files import read_hdf5, read_mat, read_npz
from .readers.mcap_log import read_mcap
from .readers.ros_bag import read_bag
from .readers.text_table import read_text

READERS: dict[str, Callable[[Path], LogFile]] = {
    ".csv": read_text,
    ".tsv": read_text,
    ".txt": read_text,
    ".dat": read_text,
    ".log": read_text,
    ".mcap": read_mcap,
    ".bag": read_bag,
    ".db3": read_bag,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".npz": read_npz,
    ".mat": read_mat,
}
"""Readers by the ending of the name."""


def read_log(path: str | os.PathLike) -> LogFile:
    """Read a log: a file, or the folder of a ROS 2 bag.

    Raises
    ------
    FileError
        There is no such file, it is none of the known formats, it is damaged, or too large.
    """
    path = Path(path)
    with read_errors_said(path):
        return read_bag(path) if path.is_dir() else _reader_of(path)(path)


def _reader_of(path: Path) -> Callable[[Path], LogFile]:
    """Return the reader of a file, by the ending of its name."""
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise FileError(f"'{path.name}' holds {size / 1e9:.1f} GB and at most {LARGEST_FILE / 1e9:.1f} GB are read: cut it.")
    with open_regular(path) as file:
        if not file.read(1):
            raise FileError(f"'{path.name}' is empty: copy it again.")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise FileError(f"'{path.name}' is no log that is known: give one of {', '.join(READERS)}, or the folder of a bag.")
    return reader
