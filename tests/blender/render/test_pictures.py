# SPDX-License-Identifier: GPL-3.0-or-later
"""All figures of a baked scene in one go; the scene is afterwards what it was before."""

import os
import sys

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, keyframe, places_of, press_and_drop
from processes import palpate

from palpate.addon.render import figure_export, render, render_setup, video
from palpate.addon.render.figure_request import FigureRequest
from palpate.commands import main
from palpate.core.io.hidden_folder import LIST_NAME
from palpate.core.jobs import run_job


@pytest.fixture
def pressed(scene, tmp_path):
    press_and_drop(frames=4)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    baked_file(scene, tmp_path)
    return scene


def test_figures_of_another_bake_take_the_place_of_earlier_ones(pressed, tmp_path):
    """Those of the same bake with other names stay."""
    out = tmp_path / "out"

    def drawn(frame):
        request = FigureRequest(("numbers",), frames=(frame,), sensors=("Pad",), formats=("svg",))
        run_job(figure_export.make_figures(pressed, out, request))
        return sorted(path.name for path in out.glob("*.svg"))

    assert drawn(3) == ["numbers_Pad_0003.svg"]
    (out / "numbers mine.svg").write_text("mine")
    assert drawn(4) == ["numbers mine.svg", "numbers_Pad_0003.svg", "numbers_Pad_0004.svg"]
    pressed.objects["Pad"].palpate.k *= 2.0
    baked(pressed)
    assert drawn(2) == ["numbers mine.svg", "numbers_Pad_0002.svg"]


def test_the_video_has_a_picture_per_frame(tmp_path):
    from matplotlib.image import imsave

    for i, grey in enumerate((0.1, 0.5, 0.9)):
        imsave(tmp_path / f"{i}.png", np.full((64, 96, 3), grey))
    path = video.encode_video([tmp_path / f"{i}.png" for i in range(3)], tmp_path / "out", 24.0)
    clip = bpy.data.movieclips.load(str(path))
    assert clip.frame_duration == 3 and tuple(clip.size) == (96, 64) and clip.fps == pytest.approx(24.0)
    assert [path.name for path in tmp_path.glob("*.mp4")] == ["out.mp4"]


def test_the_command(pressed, tmp_path, refused):
    words = ["render", str(tmp_path / "scene.blend"), "--out", str(tmp_path / "out"), "--format", "pdf"]
    words += ["--only", "strip", "--only", "numbers"]
    assert main([*words, "--sensor", "Pad", "--colour-map", "paper", "--quantity", "pressure", "--width", "single"]) == 0
    assert sorted(item.name for item in (tmp_path / "out").iterdir()) == [LIST_NAME, "numbers_Pad_0004.pdf", "strip.pdf"]
    assert "There is no sensor 'Thumb'" in refused(*words, "--sensor", "Thumb")


def test_a_transparent_picture_leaves_the_backdrop_out_but_not_what_carries_a_sensor(pressed):
    bpy.ops.mesh.primitive_plane_add(size=30.0, location=(0.0, 0.0, -0.1))
    floor = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=3.0, location=(0.0, 0.0, -5.0))
    robot = bpy.context.object
    pressed.objects["Pad"].parent = robot
    for transparent, hidden in ((False, set()), (True, {floor})):
        with render_setup.render_setup(pressed, [1], render_setup.RenderOptions(transparent=transparent, own_light=True)):
            assert {obj for obj in pressed.objects if obj.hide_render} == hidden
    assert not floor.hide_render


@pytest.mark.parametrize("size", [(160, 90), (90, 160)])
def test_the_picture_is_filled_whatever_its_shape(pressed, size):
    with render_setup.render_setup(pressed, [1, 4], render_setup.RenderOptions(view=(-60.0, 35.0), size=size)):
        places = places_of(pressed, render.bounding_box_corners(render_setup.subjects(pressed)))
        assert (pressed.render.resolution_x, pressed.render.resolution_y) == size
    assert (places > 0.0).all() and (places < 1.0).all() and np.ptp(places, axis=0).max() > 0.7


@pytest.mark.long("a Blender of its own without OpenGL")
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="hides Linux's EGL")
def test_without_opengl_it_is_one_sentence(pressed, tmp_path):
    """Blender itself would end the process at once."""
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment["__EGL_VENDOR_LIBRARY_FILENAMES"] = str(tmp_path / "nowhere")
    words = ["render", tmp_path / "scene.blend", "--out", tmp_path / "out", "--only", "scene", "--size", "32", "24"]
    for engine, status in (("workbench", 1), ("cycles", 0)):
        run = palpate(*words, "--samples", "1", "--engine", engine, env=environment)
        assert run.returncode == status, run.stderr
        assert ("choose Cycles" in run.stderr) == (status == 1)


def test_a_render_keeps_the_scene_between_two_frames(scene, tmp_path):
    bpy.ops.object.camera_add(location=(0.0, 0.0, 1.0))
    scene.camera, scene.render.engine, scene.cycles.use_denoising = bpy.context.object, "CYCLES", False
    scene.frame_set(3, subframe=0.5)
    render.render_frame(scene, tmp_path / "a.png", 1, samples=1, size=(16, 12))
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.5)


def test_what_moves_away_in_between_stays_in_the_picture(pressed):
    ball = pressed.objects["Ball"]
    x, y, _ = ball.location
    keyframe(ball, "location", {1: (x, y, 0.01), 2: (x, y, 0.4), 4: (x, y, 0.01)})
    with render_setup.render_setup(pressed, [1, 2, 3, 4], render_setup.RenderOptions(view=(-60.0, 35.0))):
        pressed.frame_set(2)
        places = places_of(pressed, render.bounding_box_corners([ball]))
    assert (places > 0.0).all() and (places < 1.0).all()
