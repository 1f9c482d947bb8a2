# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of text as logs: see :mod:`....io.text_table`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....errors import counted
from ....io.text_table import MISSING, read_text_table
from ..log_table import MOST_VALUES, LogFile, LogTable, require_size


def read_text(path: Path) -> LogFile:
    """Read a table of text; raise FileError if it is none."""
    found = read_text_table(path, MOST_VALUES)
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
    return LogFile(path, "table of text", (LogTable("", kept, units),), tuple(notes))
