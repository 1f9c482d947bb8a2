# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of text as logs: see :mod:`....io.text_table`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....errors import FileError
from ....io.text_table import MISSING, read_text_table
from ..log_table import FEWEST_ROWS, MOST_VALUES, LogFile, LogTable, require_size


def read_text(path: Path) -> LogFile:
    """Read a table of text; raise FileError if it is none."""
    found = read_text_table(path, MOST_VALUES)
    rows, columns = found.values.shape
    if rows < FEWEST_ROWS and found.names[0] != "column_1":  # without names it may be one of many frames
        raise FileError(f"'{path.name}' has {rows} lines of numbers: a log needs at least {FEWEST_ROWS} samples.")
    require_size(rows * columns, columns, path)
    notes, kept = list(found.notes), {}
    for name, values in zip(found.names, found.values.T, strict=True):
        if np.isnan(values).all():
            notes.append(f"'{path.name}': the column '{name}' holds no numbers and was left out.")
            continue
        text = [cell for _, cell in found.wrong.get(name, []) if cell.lower() not in MISSING]
        if text:
            notes.append(f"'{path.name}': {len(text)} cells of '{name}' are text and count as missing.")
        kept[name] = np.ascontiguousarray(values)
    units = {name: unit for name, unit in found.units.items() if name in kept}
    return LogFile(path, "table of text", (LogTable("", kept, units),), tuple(notes))
