# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the sample .blend files from their scripts: ``python -m palpate.sample_blends.build_samples [FOLDER]``.

They are not baked: a bake lives in files of its own, beside wherever you put them.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import bpy

SAMPLES = ("demo", "fingertip", "grasp")
"""Modules of this folder with a function ``build(scene)``."""


def build_all(folder: Path) -> list[Path]:
    """Write one compressed .blend per sample into `folder`, and return their paths."""
    made = []
    for name in SAMPLES:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        importlib.import_module(f".{name}", __package__).build(bpy.context.scene)
        path = folder / f"{name}.blend"
        bpy.context.preferences.filepaths.save_version = 0
        bpy.ops.wm.save_as_mainfile(filepath=str(path.absolute()), compress=True)
        made.append(path)
    return made


if __name__ == "__main__":
    importlib.import_module(__package__.rpartition(".")[0]).register()
    for path in build_all(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent):
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
