# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds from enabling to the first tactile image on a profile that has never seen Palpate, with and without machine code.

With ``--long`` each is measured three times. The figures are printed; no clock is asserted.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import build_zip
import provision_blender
import pytest


@pytest.mark.parametrize("with_code", [True, False], ids=["machine code", "compiled"])
def test_first_image(request, unseen_blender, blender_version, with_code):
    is_long = request.config.getoption("--long")
    if not with_code and not is_long:
        pytest.skip("takes minutes; --long measures it. The road first_use compiles the solver, too")
    name = "with-code" if with_code else "compiled"
    figures = []
    for i in range(3 if is_long else 1):
        blender = unseen_blender(f"{name}-{i}")
        python = provision_blender.DEBIAN[blender_version].python
        options = {"blender_range": ("4.2.0", None), "suffix": "-local", "with_machine_code": with_code}
        path = build_zip.build("linux-x64", python, blender.work, **options)
        if with_code and build_zip.MACHINE_CODE not in zipfile.ZipFile(path).namelist():
            pytest.skip(f"There is no Python {python} here that makes machine code.")
        blender.install(path, enable=False)
        road = Path(__file__).parent / "roads" / "first_image.py"
        figures.append(blender.play(road, blender.work / "road", timeout=1200)["values"])
        print(f"{name}, Blender {blender_version}, run {i + 1}: {figures[-1]}")
    assert len(figures[-1]) == 6
