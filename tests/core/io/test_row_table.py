# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables that leave the memory when they become long: the same numbers, and one sentence where there is no room for them."""

import errno
import tempfile

import numpy as np
import pytest

from palpate.core.errors import FileError
from palpate.core.io import row_tables
from palpate.core.io.row_tables import motion_table


@pytest.mark.parametrize("limit", [1 << 22, 100])
@pytest.mark.parametrize("shape", [(), (3,), (5, 3)])
def test_rows_come_back(monkeypatch, limit, shape):
    monkeypatch.setattr(row_tables, "IN_MEMORY_BYTES", limit)
    rows = np.random.default_rng(5).normal(size=(50, *shape))
    table = motion_table(rows[0])
    for row in rows[1:]:
        table.append(row)
    found = table.rows()
    del table
    assert found.shape == rows.shape and found.tobytes() == rows.tobytes()
    assert found.flags.writeable == (limit > 100)


def test_a_full_temporary_folder_is_one_sentence(monkeypatch):
    class Full:
        def write(self, _content):
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "SpooledTemporaryFile", lambda *_, **_options: Full())
    with pytest.raises(
        FileError, match=r"^The motion of a long scene could not be kept in .*\(no space left on device\): free"
    ):
        motion_table(np.zeros(3))
