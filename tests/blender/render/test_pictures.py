# SPDX-License-Identifier: GPL-3.0-or-later
"""All figures of a baked scene in one go; the scene is afterwards what it was before."""

import os
import subprocess
import sys

import bpy
import numpy as np
import pytest
from blender_scenes import press_and_drop, save

from palpate.addon.bake.bake import bake
from palpate.addon.render import figure_export, render, render_setup, video
from palpate.addon.render.figure_request import FigureRequest
from palpate.commands import main
from palpate.core.io.hidden_folder import LIST_NAME
from palpate.core.jobs import run_job


@pytest.fixture
def baked(tmp_path):
    scene, *_ = press_and_drop(frames=4)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    path = save(tmp_path)
    run_job(bake(scene))
    save(tmp_path)
    return scene, path


def test_figures_of_another_bake_take_the_place_of_earlier_ones(baked, tmp_path):
    """Those of the same bake with other names stay."""
    scene, _ = baked
    out = tmp_path / "out"

    def drawn(frame):
        request = FigureRequest(("numbers",), frames=(frame,), sensors=("Pad",), formats=("svg",))
        run_job(figure_export.make_figures(scene, out, request))
        return sorted(path.name for path in out.glob("*.svg"))

    assert drawn(3) == ["numbers_Pad_0003.svg"]
    (out / "numbers mine.svg").write_text("mine")
    assert drawn(4) == ["numbers mine.svg", "numbers_Pad_0003.svg", "numbers_Pad_0004.svg"]
    scene.objects["Pad"].palpate.k *= 2.0
    run_job(bake(scene))
    assert drawn(2) == ["numbers mine.svg", "numbers_Pad_0002.svg"]


def test_the_video_has_a_picture_per_frame(baked, tmp_path):
    from matplotlib.image import imsave

    for i, grey in enumerate((0.1, 0.5, 0.9)):
        imsave(tmp_path / f"{i}.png", np.full((64, 96, 3), grey))
    path = video.encode_video([tmp_path / f"{i}.png" for i in range(3)], tmp_path / "out", 24.0)
    clip = bpy.data.movieclips.load(str(path))
    assert clip.frame_duration == 3 and tuple(clip.size) == (96, 64) and clip.fps == pytest.approx(24.0)
    assert [path.name for path in tmp_path.glob("*.mp4")] == ["out.mp4"]


def test_the_command(baked, tmp_path, capsys):
    _, path = baked
    words = ["render", str(path), "--out", str(tmp_path / "out"), "--only", "strip", "--only", "numbers", "--format", "pdf"]
    assert main([*words, "--sensor", "Pad", "--colour-map", "paper", "--quantity", "pressure", "--width", "single"]) == 0
    assert sorted(item.name for item in (tmp_path / "out").iterdir()) == [LIST_NAME, "numbers_Pad_0004.pdf", "strip.pdf"]
    assert main([*words, "--sensor", "Thumb"]) == 1
    assert "There is no sensor 'Thumb'" in capsys.readouterr().err


def test_a_transparent_picture_leaves_the_backdrop_out_but_not_what_carries_a_sensor(baked, tmp_path):
    scene, _ = baked
    bpy.ops.mesh.primitive_plane_add(size=30.0, location=(0.0, 0.0, -0.1))
    floor = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=3.0, location=(0.0, 0.0, -5.0))
    robot = bpy.context.object
    scene.objects["Pad"].parent = robot
    for transparent, hidden in ((False, set()), (True, {floor})):
        with render_setup.render_setup(scene, [1], render_setup.RenderOptions(transparent=transparent, own_light=True)):
            assert {obj for obj in scene.objects if obj.hide_render} == hidden
    assert not floor.hide_render


@pytest.mark.parametrize("size", [(160, 90), (90, 160)])
def test_the_picture_is_filled_whatever_its_shape(baked, size):
    scene, _ = baked
    with render_setup.render_setup(scene, [1, 4], render_setup.RenderOptions(view=(-60.0, 35.0), size=size)):
        points = render.bounding_box_corners(render_setup.subjects(scene))
        places = np.array([render.image_position(scene, point) for point in points])
        assert (scene.render.resolution_x, scene.render.resolution_y) == size
    assert (places > 0.0).all() and (places < 1.0).all() and np.ptp(places, axis=0).max() > 0.7


@pytest.mark.long("a Blender of its own without OpenGL")
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="hides Linux's EGL")
def test_without_opengl_it_is_one_sentence(baked, tmp_path):
    """Blender itself would end the process at once."""
    _, path = baked
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment["__EGL_VENDOR_LIBRARY_FILENAMES"] = str(tmp_path / "nowhere")
    words = ["render", str(path), "--out", str(tmp_path / "out"), "--only", "scene", "--size", "32", "24", "--samples", "1"]
    for engine, status in (("workbench", 1), ("cycles", 0)):
        run = subprocess.run(
            [sys.executable, "-m", "palpate.commands", *words, "--engine", engine],
            env=environment, capture_output=True, text=True, timeout=120,
        )  # fmt: skip
        assert run.returncode == status, run.stderr
        assert ("choose Cycles" in run.stderr) == (status == 1)


def test_what_moves_away_in_between_stays_in_the_picture(baked):
    scene, _ = baked
    ball = scene.objects["Ball"]
    for frame, height in ((1, 0.01), (2, 0.4), (4, 0.01)):
        ball.location.z = height
        ball.keyframe_insert("location", frame=frame)
    with render_setup.render_setup(scene, [1, 2, 3, 4], render_setup.RenderOptions(view=(-60.0, 35.0))):
        scene.frame_set(2)
        places = np.array([render.image_position(scene, point) for point in render.bounding_box_corners([ball])])
    assert (places > 0.0).all() and (places < 1.0).all()
