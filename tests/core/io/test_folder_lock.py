# SPDX-License-Identifier: GPL-3.0-or-later
"""The lock on a bake folder."""

import os

import pytest

from palpate.core.errors import FileError
from palpate.core.io.folder_lock import FolderLock
from palpate.core.io.private_folder import LOCK_NAME, make_private_folder


def test_a_fifo_in_place_of_the_lock_is_refused_at_once(tmp_path):
    os.mkfifo(make_private_folder(tmp_path) / LOCK_NAME)
    with pytest.raises(FileError, match="is a FIFO, not a file"):
        FolderLock(tmp_path)
