# SPDX-License-Identifier: GPL-3.0-or-later
"""The lock on a bake folder."""

import os

import pytest

from palpate.addon.bake.folder_lock import LOCK_FILE_NAME, FolderLock
from palpate.core.errors import FileError


def test_a_fifo_in_place_of_the_lock_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / LOCK_FILE_NAME)
    with pytest.raises(FileError, match="is a FIFO, not a file"):
        FolderLock(tmp_path)
