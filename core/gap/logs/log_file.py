# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a log, whatever its format."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...errors import FileError, counted, read_errors_said
from ...io.input_files import open_regular
from ...io.text_table import MISSING, read_text_table
from .log_table import LARGEST_FILE, LogFile, LogTable, require_size
from .readers.array_files import read_hdf5, read_mat, read_npz
from .readers.bags import read_bag, read_mcap


def read_text(path: Path) -> LogFile:
    """Read a table of text; raise FileError if it is none."""
    found = read_text_table(path)
    rows, columns = found.values.shape
    require_size(rows * columns, columns, path)
    notes, kept, text = list(found.notes), {}, 0
    for name, values in zip(found.names, found.values.T, strict=True):
        if np.isnan(values).all():
            notes.append(f"'{path.name}': the column '{name}' holds no numbers and was left out.")
            continue
        text += sum(cell.lower() not in MISSING for _, cell in found.wrong.get(name, []))
        kept[name] = np.ascontiguousarray(values)
    notes += [f"'{path.name}': {counted(text, 'cell')} with text count as missing."] if text else []
    units = {name: unit for name, unit in found.units.items() if name in kept}
    return LogFile(path, (LogTable("", kept, units),), tuple(notes))


READERS: dict[str, Callable[[Path], LogFile]] = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".log"), read_text),
    ".mcap": read_mcap,
    **dict.fromkeys((".bag", ".db3"), read_bag),
    **dict.fromkeys((".h5", ".hdf5"), read_hdf5),
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
    if any("\ud800" <= letter <= "\udfff" for letter in path.name):  # bytes that are none, which TOML cannot hold
        raise FileError(f"The name of the log {path.name!r} is not UTF-8: rename it.")
    with read_errors_said(path):
        if path.is_dir():
            return read_bag(path)
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise FileError(
                f"'{path.name}' holds {size / 1e9:.1f} GB and at most {LARGEST_FILE / 1e9:.1f} GB are read: cut it."
            )
        with open_regular(path) as file:
            if not file.read(1):
                raise FileError(f"'{path.name}' is empty: copy it again.")
        reader = READERS.get(path.suffix.lower())
        if reader is None:
            raise FileError(f"'{path.name}' is no log that is known: give one of {', '.join(READERS)}, or the folder of a bag.")
        return reader(path)
