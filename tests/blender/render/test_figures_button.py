# SPDX-License-Identifier: GPL-3.0-or-later
"""One button makes what `palpate render` and `palpate export` make, with the same choices."""

import argparse

import bpy
import pytest
from blender_scenes import baked, changes, dump, press, refusal

from palpate.addon.render import figure_export, figure_request
from palpate.commands import render
from palpate.core.errors import ParameterError
from palpate.core.figures import texel_numbers
from palpate.core.io.hidden_folder import LIST_NAME
from palpate.core.jobs import run_job


@pytest.fixture
def pressed(scene, tmp_path):
    press(frames=4)
    baked(scene, tmp_path)
    return scene


@pytest.mark.long("makes figures of every kind, and a video")
def test_everything_that_is_chosen_is_made(pressed, tmp_path):
    own, place = pressed.palpate.figures, tmp_path / "figures"
    own.kinds, own.exports = {"SCENE", "STRIP", "CURVES", "NUMBERS", "VIDEO", "GEL"}, {"CSV", "NPZ", "PNG"}
    own.formats, own.frames, own.width = {"PNG", "PDF"}, "2-3, 4", "SINGLE"
    own.engine, own.size, own.transparent = "WORKBENCH", (160, 120), True
    before = dump()
    assert bpy.ops.palpate.figures_make() == {"FINISHED"}
    assert [line for line in changes(before, dump()) if "Render Result" not in line] == []  # Blender's own
    names = {path.name for path in place.iterdir()}
    expected = {f"{kind}.{ending}" for kind in ("strip", "curves") for ending in ("png", "pdf")}
    expected |= {f"numbers_Pad_{number:04d}.{ending}" for number in (2, 3, 4) for ending in ("png", "pdf")}
    kinds = ("scene", "scene_and_touch", "gel_Pad")
    expected |= {f"{kind}_{number:04d}.png" for kind in kinds for number in (2, 3, 4)}
    assert names == expected | {"video.mp4", "data_csv", "data_npz", "data_png", LIST_NAME}
    assert (place / "data_csv" / "Pad" / "normal_force.csv").is_file()
    assert (place / "video.mp4").stat().st_size > 1000
    picture = bpy.data.images.load(str(place / "scene_0004.png"))
    assert tuple(picture.size) == (160, 120) and picture.channels == 4


def test_the_window_offers_what_the_command_offers():
    parser = argparse.ArgumentParser()
    render.add_arguments(parser)
    here = {
        "out": "folder", "only": "kinds", "sensor": "sensors", "frame": "frames", "format": "formats", "own_camera": "camera",
        "peak": "frames", "opaque_targets": "see_through",
    }  # fmt: skip
    display = {"colour_map": "color_map", "quantity": "quantity", "limit": "range_max", "lowest": "range_min_reading"}
    scene = bpy.context.scene.palpate
    for action in parser._actions:
        if action.dest in ("help", "scene", "bake", "scripts", "time_limit", "memory_limit"):  # of a run without a window
            continue
        owner = scene if action.dest in display else scene.figures
        name = display.get(action.dest) or here.get(action.dest, action.dest)
        assert name in owner.bl_rna.properties, action.dest
        for choice in action.choices or ():
            known = owner.bl_rna.properties[name].enum_items.keys()
            assert choice.upper() in known, (action.dest, choice)


def test_what_cannot_be_made_is_one_sentence(pressed):
    own = pressed.palpate.figures
    own.frames = "12, x"
    assert "'x' in Figures › Frames is not a frame" in refusal(bpy.ops.palpate.figures_make)
    own.frames = "99"
    assert "Frame 99 is not in the bake" in refusal(bpy.ops.palpate.figures_make)
    own.frames, own.sensors = "", "ACTIVE"
    bpy.context.view_layer.objects.active = bpy.data.objects["Ball"]
    assert "The active object is not a sensor" in refusal(bpy.ops.palpate.figures_make)
    own.sensors, own.kinds = "ALL", set()
    assert "Nothing is chosen" in refusal(bpy.ops.palpate.figures_make)
    bpy.ops.palpate.bake_clear()
    assert not bpy.ops.palpate.figures_make.poll()


def test_numbers_that_are_left_out_are_named(pressed, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(texel_numbers, "_MOST", 1)
    request, warnings = figure_request.FigureRequest(("numbers", "curves"), formats=("png",)), []
    made = run_job(figure_export.make_figures(pressed, tmp_path / "figures", request, warnings.append))
    assert [path.name for path in made] == ["curves.png"]
    assert len(warnings) == 1 and "numbers could not be read (at most 1): export them as CSV" in warnings[0]
    pressed.palpate.figures.kinds = {"NUMBERS"}
    bpy.ops.palpate.figures_make()
    assert "export them as CSV" in capsys.readouterr().out


def test_words_for_frames():
    assert figure_request.frames_of("") == ()
    assert figure_request.frames_of("5 3, 7-9; 8") == (5, 3, 7, 8, 9)
    assert figure_request.frames_of("-2-1") == (-2, -1, 0, 1)
    with pytest.raises(ParameterError, match="1.5"):
        figure_request.frames_of("1.5")


def test_the_bar_goes_on_with_every_file_that_is_drawn_and_written(pressed, tmp_path):
    """All drawings were one step, and each export another, during which the window stood still."""
    request = figure_request.FigureRequest(("strip", "curves", "numbers"), formats=("png", "pdf"), exports=("csv", "npz"))
    steps = []
    job = figure_export.make_figures(pressed, tmp_path / "figures", request)
    run_job(job, lambda step: steps.append((step.stage, step.share)))
    stages, shares = [stage for stage, _ in steps], [share for _, share in steps]
    assert [stages.count(f"Drawing {what}") for what in ("the strip", "curves", "numbers")] == [2, 2, 2]
    assert shares == sorted(shares) and shares[-1] <= 1.0 and len(set(shares)) >= 8
