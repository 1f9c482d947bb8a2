# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender shows a tactile image as it was meant, and its own OpenEXR and ours live in one process."""

from __future__ import annotations

import subprocess
import sys

import bpy
import numpy as np
import pytest
from sample_bake import pictures_of, read_exr, tactile_frame

from palpate.core.geometry.grid_layout import GridLayout
from palpate.core.geometry.texture_maps import uv_layout
from palpate.core.io.tactile_exr import write_exr

ROWS, COLUMNS = 5, 7


@pytest.fixture(autouse=True)
def scene():
    """Return the scene of an empty file, without the add-on: a bake plays in any Blender."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def grid():
    """Return a grid layout, texels row by row."""
    row, column = np.indices((ROWS, COLUMNS)).reshape(2, -1)
    return GridLayout(ROWS, COLUMNS, row, column)


def assert_blender_reads_it(path, layout, frame):
    """Write a frame, and compare what Blender makes of it."""
    write_exr(path, layout, frame, {"unit": "kPa"})
    expected = pictures_of(layout, frame)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.array(image.pixels[:], np.float32).reshape(height, width, 4)  # the first row first
    assert image.type == "IMAGE" and image.is_float
    for i, name in enumerate("RGB"):
        np.testing.assert_array_equal(pixels[..., i], expected[name])
    assert (pixels[..., 3] == 1).all()
    bpy.data.images.remove(image)


def test_first_row_is_the_lowest_and_named_channels_do_not_disturb(tmp_path):
    frame = tactile_frame(ROWS * COLUMNS)
    assert_blender_reads_it(tmp_path / "a.exr", grid(), frame)
    position = np.array([[0, 0, 0], [1, 0, 0], [1.2, 1, 0], [0, 1, 0], [2, 2, 0]]) * 1.0
    layout, _ = uv_layout(position, np.tile([0, 0, 1.0], (5, 1)), np.array([[0, 1, 2], [0, 2, 3], [2, 4, 3]]))
    assert_blender_reads_it(tmp_path / "b.exr", layout, tactile_frame(5))


@pytest.mark.parametrize("first", ["OpenEXR", "bpy"])
def test_either_library_may_come_first(tmp_path, first):
    write_exr(tmp_path / "a.exr", grid(), tactile_frame(ROWS * COLUMNS), {})
    program = (
        f"import sys, {first}\nimport bpy, OpenEXR\n"
        "image = bpy.data.images.load(sys.argv[1])\n"
        "image.colorspace_settings.name = 'Non-Color'\n"
        "file = OpenEXR.File(sys.argv[1], separate_channels=True)\n"
        "assert image.pixels[0] == file.channels()['R'].pixels[-1, 0] != 0\n"
    )
    assert subprocess.run([sys.executable, "-c", program, str(tmp_path / "a.exr")]).returncode == 0


def test_both_libraries_work_after_a_render(tmp_path, scene):
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.render.resolution_x, scene.render.resolution_y = 32, 24
    scene.render.image_settings.file_format = "OPEN_EXR"
    for turn in range(2):
        assert_blender_reads_it(tmp_path / f"{turn}.exr", grid(), tactile_frame(ROWS * COLUMNS, turn))
        scene.render.filepath = str(tmp_path / f"render_{turn}.exr")
        bpy.ops.render.render(write_still=True)
        channels, _ = read_exr(tmp_path / f"render_{turn}.exr")
        assert channels["R"].shape == (24, 32)
