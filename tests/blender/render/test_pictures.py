# SPDX-License-Identifier: GPL-3.0-or-later
"""All figures of a baked scene in one go; the scene is afterwards what it was before."""

import os
import subprocess
import sys
from dataclasses import replace

import bpy
import numpy as np
import pytest
from blender_scenes import changes, dump, press_and_drop, save

from palpate.addon.bake.bake import bake
from palpate.addon.render import figure_export, render, render_setup, video
from palpate.addon.render.figure_request import FigureRequest
from palpate.commands import main
from palpate.core.errors import FileError, ParameterError, SceneError
from palpate.core.figures.figure_style import FigureStyle
from palpate.core.io.file_writing import atomic_write
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


def image(path):
    from matplotlib.image import imread

    return imread(path)


def test_figures_take_the_place_of_earlier_ones(baked, tmp_path, monkeypatch):
    """Those of the same bake with other names stay."""
    scene, _ = baked
    age = "old"

    def write(path, *_, **__):
        with atomic_write(path) as temporary:
            temporary.write_text(age)

    for name in ("tactile_strip", "time_curves", "texel_numbers"):
        monkeypatch.setattr(figure_export, name, write)

    def draw(folder, frame=3):
        run_job(
            figure_export.make_figures(scene, folder, FigureRequest(("curves", "numbers"), frames=(frame,), formats=("png",)))
        )

    def ages(folder):
        return {path.name: path.read_text() for path in folder.iterdir() if path.is_file() and path.name[0] != "."}

    out = tmp_path / "out"
    draw(out)
    (out / "curves mine.png").write_text("mine")
    age = "new"
    draw(out)
    assert len(ages(out)) > 2 and set(ages(out).values()) == {"new", "mine"}
    draw(out, 4)
    assert {f"numbers_Pad_000{frame}.png" for frame in (3, 4)} < set(ages(out))
    made = figure_export.read_scene_bake(scene)
    another = replace(made, manifests={name: replace(one, bake_id="another") for name, one in made.manifests.items()})
    monkeypatch.setattr(figure_export, "read_scene_bake", lambda _: another)
    draw(out, 2)
    assert {name for name in ages(out) if "Pad" in name} == {"numbers_Pad_0002.png", "numbers_Pad_2_0002.png"}


def test_the_video_has_a_picture_per_frame(baked, tmp_path):
    from matplotlib.image import imsave

    for i, grey in enumerate((0.1, 0.5, 0.9)):
        imsave(tmp_path / f"{i}.png", np.full((64, 96, 3), grey))
    path = video.encode_video([tmp_path / f"{i}.png" for i in range(3)], tmp_path / "out", 24.0)
    clip = bpy.data.movieclips.load(str(path))
    assert clip.frame_duration == 3 and tuple(clip.size) == (96, 64) and clip.fps == pytest.approx(24.0)
    assert [path.name for path in tmp_path.glob("*.mp4")] == ["out.mp4"]


def test_all_that_matters_is_in_the_picture_and_lit(baked, tmp_path):
    scene, _ = baked
    with render_setup.render_setup(scene, [1, 4], render_setup.RenderOptions(view=(-60.0, 35.0), transparent=True)):
        points = render.bounding_box_corners(render_setup.subjects(scene))
        places = np.array([render.image_position(scene, point) for point in points])
        render.render_frame(scene, tmp_path / "a.png", 4, samples=4, size=(96, 64))
    assert (places > 0.0).all() and (places < 1.0).all()
    picture = image(tmp_path / "a.png")
    assert picture.shape[2] == 4 and (picture[..., 3] == 0.0).any()  # no background
    covered = picture[..., 3] > 0.9
    assert covered.any() and picture[covered][:, :3].mean() > 0.1


def test_a_scene_that_is_not_baked_and_a_frame_that_is_not_are_one_sentence(baked, tmp_path):
    scene, _ = baked
    with pytest.raises(FileError, match="from 1 to 4"):
        run_job(figure_export.make_figures(scene, tmp_path / "out", FigureRequest(frames=(9,))))
    bpy.ops.palpate.bake_clear()
    with pytest.raises(SceneError, match="is not baked"):
        run_job(figure_export.make_figures(scene, tmp_path / "out", FigureRequest()))
    with pytest.raises(ParameterError, match="choose from"):
        FigureRequest(kinds=("hologram",))


def test_an_error_in_the_middle_puts_the_scene_back(baked):
    scene, _ = baked
    before = dump()
    with (
        pytest.raises(RuntimeError),
        render_setup.render_setup(scene, [1], render_setup.RenderOptions(engine="workbench", transparent=True)),
    ):
        raise RuntimeError
    assert changes(before, dump()) == [] and scene.camera is None and scene.render.engine == "CYCLES"


def test_the_command(baked, tmp_path, capsys):
    _, path = baked
    words = ["render", str(path), "--out", str(tmp_path / "out"), "--only", "strip", "--only", "numbers", "--format", "pdf"]
    assert main([*words, "--sensor", "Pad", "--colour-map", "paper", "--quantity", "pressure", "--width", "single"]) == 0
    assert sorted(item.name for item in (tmp_path / "out").iterdir()) == [LIST_NAME, "numbers_Pad_0004.pdf", "strip.pdf"]
    assert main([*words, "--sensor", "Thumb"]) == 1
    assert "There is no sensor 'Thumb'" in capsys.readouterr().err


def test_workbench_shows_the_heat_map_and_leaves_meshes_alone(baked, tmp_path):
    """Where most force is, the picture has the colour of the map's upper end, seen through the glass ball that presses."""
    scene, _ = baked
    pad, ball = scene.objects["Pad"], scene.objects["Ball"]
    glass = bpy.data.materials.new("Glass")
    glass.use_nodes = True
    glass.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
    ball.data.materials.append(glass)
    before, meshes = dump(), len(bpy.data.meshes)
    request = FigureRequest(
        ("scene",),
        FigureStyle(colour_map="MAGMA"),
        frames=(4,),
        sensors=("Pad",),
        size=(200, 160),
        engine="workbench",
        view=(-90, 89),
    )
    run_job(figure_export.make_figures(scene, tmp_path / "out", request))
    picture = image(tmp_path / "out" / "scene_0004.png")[..., :3]
    assert np.ptp(picture, axis=2).max() > 0.4  # the purples and oranges of magma, on grey
    assert [line for line in changes(before, dump()) if "Render Result" not in line] == []
    assert len(bpy.data.meshes) == meshes
    assert pad.data.color_attributes.find("Palpate Colour") < 0


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
    for engine, status in (("workbench", 1), ("eevee", 1), ("cycles", 0)):
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
