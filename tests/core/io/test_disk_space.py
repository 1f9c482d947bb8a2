# SPDX-License-Identifier: GPL-3.0-or-later
"""Space on the disk is asked for before work begins."""

import pytest

from palpate.core.errors import FileError
from palpate.core.io.file_writing import BLOCK, bake_bytes, recording_bytes, require_space
from palpate.core.io.row_tables import row_type


def test_the_estimate_of_a_recording_is_the_size_of_its_rows():
    """Apart from the bytes with which a row is filled up."""
    kind = row_type(2, {"a": 9, "b": 16}, {})
    assert 1000 * kind.itemsize == pytest.approx(recording_bytes(1000, 2, [9, 16]), rel=0.01)


def test_the_estimate_of_a_bake_holds_recordings_and_images():
    alone = bake_bytes(10, 2, [84], [])
    assert alone == 2 * recording_bytes(10, 2, [84])
    assert bake_bytes(10, 2, [84], [84]) == pytest.approx(alone + 20 * BLOCK, rel=0.02)
    assert bake_bytes(2, 2, [84], [10**6]) > 2 * 28e6


def test_a_disk_that_is_too_small_is_named(tmp_path):
    require_space(tmp_path / "not" / "yet", 1.0, "The bake")
    with pytest.raises(FileError, match=r"^The bake needs up to 1\d+ MB and the disk of '.*yet' has \d+ MB left: free"):
        require_space(tmp_path / "not" / "yet", 1e24, "The bake")
