# SPDX-License-Identifier: GPL-3.0-or-later
"""Space on the disk is asked for before work begins."""

import pytest

from palpate.core.errors import FileError
from palpate.core.io.file_writing import require_space


def test_a_disk_that_is_too_small_is_named(tmp_path):
    require_space(tmp_path / "not" / "yet", 1.0, "The bake")
    with pytest.raises(FileError, match=r"^The bake needs up to 1\d+ MB and the disk of '.*yet' has \d+ MB left: free"):
        require_space(tmp_path / "not" / "yet", 1e24, "The bake")
