# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds from enabling to the first tactile image on a profile that has never seen Palpate.

The zip carries machine code where this machine has the Python to make it; elsewhere the solver is compiled, and the figures
say so. With ``--long`` three runs with machine code and three without are measured. No clock is asserted.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import build_zip
import provision_blender
import pytest

ROAD = Path(__file__).parent / "roads" / "first_image.py"
FIGURES = 6


def test_first_image(request, unseen_blender, build_local_zip, blender_version, capsys):
    is_long = request.config.getoption("--long")
    for with_code in (True, False) if is_long else (True,):
        for run in range(3 if is_long else 1):
            blender = unseen_blender(f"{'with-code' if with_code else 'compiled'}-{run}")
            python = provision_blender.DEBIAN[blender_version].python
            path = build_local_zip(blender.work, with_code)
            with zipfile.ZipFile(path) as archive:
                carries_code = build_zip.MACHINE_CODE in archive.namelist()
            if is_long and carries_code != with_code:
                pytest.fail(f"Machine code cannot be measured: install Python {python}, which makes it.", pytrace=False)
            blender.install(path, enable=False)
            figures = blender.play(ROAD, blender.work / "road", timeout=1800)["values"]
            assert len(figures) == FIGURES
            with capsys.disabled():
                why = f", since no Python {python} here makes machine code" if with_code else ""
                solver = "machine code" if carries_code else f"compiled{why}"
                print(f"\nfirst image, Blender {blender_version}, {solver}: {figures}")
