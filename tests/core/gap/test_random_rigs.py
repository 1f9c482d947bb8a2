# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs that once ended in a traceback, and the generator that found them."""

import pytest
from random_rigs import random_rig, read_and_diagnose
from rig_files import RIG, write

from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig


def test_a_rig_of_which_nothing_is_left_to_be_fitted(tmp_path):
    for name, content in random_rig(12).items():
        (tmp_path / name).write_bytes(content)
    assert read_and_diagnose(tmp_path) in ("explained", "no gap", "unexplained")


def test_a_strip_between_the_points_is_refused(tmp_path):
    strips = "strips = [[[-0.01, -0.006], [-0.0099, 0.006]]]\ncover = { size = [0.02, 0.012], pitch = 0.03 }"
    grid = next(line for line in RIG.splitlines() if line.startswith("grid"))
    with pytest.raises(FileError, match="smaller pitch"):
        read_rig(write(tmp_path, RIG.replace(grid, strips)))


def test_the_same_seed_gives_the_same_rig():
    assert random_rig(5) == random_rig(5) != random_rig(6)
