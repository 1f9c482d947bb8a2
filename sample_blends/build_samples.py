# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the sample .blend files from their scripts: ``python -m palpate.sample_blends.build_samples [FOLDER]``.

The files are not baked, because a bake is stored in a folder beside the .blend.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import bpy

_NAMES = ("demo", "fingertip", "grasp", "geometries", "weighing", "tilt", "pick_and_place", "hand", "gel")
_GRASPED = ("sphere", "box", "cylinder", "bottle")
SAMPLES = {**{name: (name, ()) for name in _NAMES}, **{f"grasp_{kind}": ("grasps", (kind,)) for kind in _GRASPED}}
"""Name of the file → module of this package, and further arguments of its function ``build(scene, …)``."""


def build_one(name: str, folder: Path) -> Path:
    """Write one sample as a compressed .blend into `folder`, and return its path."""
    module, more = SAMPLES[name]
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    importlib.import_module(f".{module}", __package__).build(bpy.context.scene, *more)
    path = folder / f"{name}.blend"
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(path.absolute()), compress=True)
    return path


if __name__ == "__main__":
    importlib.import_module(__package__.rpartition(".")[0]).register()
    for sample in SAMPLES:
        path = build_one(sample, Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
