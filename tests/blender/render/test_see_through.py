# SPDX-License-Identifier: GPL-3.0-or-later
"""An indenter does not hide the texels below it, and stays opaque elsewhere; the scene is left as it was."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, ball, changes, cube, dump, grid, places_of, reopen, scene_of
from mathutils import Vector

from palpate.addon.render import figure_export, loaded_texels, render, render_setup, see_through
from palpate.addon.render.figure_request import FigureRequest
from palpate.core.errors import SceneError
from palpate.core.jobs import run_job

SIZE = (96, 72)
VIEW = (-90.0, 35.0)
KINDS = {"opaque": {}, "glass": {"Transmission Weight": 1.0}}


@pytest.fixture(scope="module")
def ball_blend(blender, tmp_path_factory):
    """A ball on a pad of many texels, baked and saved."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene, pad = scene_of(3), grid(columns=24, rows=24)
    target = ball(location=(0.0, 0.0, 0.0125), radius=0.014, segments=64)
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 8, False
    return baked_file(scene, tmp_path_factory.mktemp("ball"))[0]


@pytest.fixture
def pressed(ball_blend):
    scene = reopen(ball_blend)
    return scene, scene.objects["Pad"], scene.objects["Ball"]


def picture_of(scene, folder, **options):
    from matplotlib.image import imread

    request = FigureRequest(("scene",), frames=(3,), size=SIZE, samples=8, view=VIEW, **options)
    run_job(figure_export.make_figures(scene, folder, request))
    return imread(folder / "scene_0003.png")


def loaded_pixels(scene, pad):
    """Return the loaded texels, rows and columns of the most loaded one and of the ball beside the arrow, and the weights."""
    bake = figure_export.read_scene_bake(scene)
    with render_setup.render_setup(scene, [3], FigureRequest(view=VIEW, size=SIZE)):
        scene.frame_set(3)
        loaded = loaded_texels.loaded_texels(scene, bake, 3)
        points = [loaded.points[loaded.forces.argmax()], (0.007, 0.0, 0.0125 + 0.0105)]
        places = places_of(scene, points)
        weights = see_through.clear_weights(scene, loaded, SIZE)
    columns, rows = (places * SIZE).astype(int).T
    return loaded, SIZE[1] - 1 - rows, columns, weights


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=(pytest.mark.slow, pytest.mark.long)[i > 0]("a picture by Cycles for each kind of material"))
        for i, kind in enumerate(KINDS)
    ],
)
def test_loaded_texels_are_seen_through_what_presses_on_them(pressed, tmp_path, kind):
    """The picture there is that of a scene without the target; at the target's top it is that of a scene with it."""
    scene, pad, target = pressed
    material = bpy.data.materials.new("Own")
    material.use_nodes = True
    for name, value in KINDS[kind].items():
        material.node_tree.nodes["Principled BSDF"].inputs[name].default_value = value
    target.data.materials.append(material)
    before = dump()
    clear = picture_of(scene, tmp_path / "clear")
    covered = picture_of(scene, tmp_path / "covered", see_through=False)
    assert [line for line in changes(before, dump()) if "Render Result" not in line] == []
    loaded, rows, columns, weights = loaded_pixels(scene, pad)
    assert len(loaded) > 9 and weights.max() == pytest.approx(see_through.CLEARNESS)
    # the colours of a heat map are not grey: what differs between red, green and blue is the map
    colourful = [np.ptp(shot[rows[0], columns[0], :3]) for shot in (clear, covered)]
    if kind == "glass":
        assert colourful[0] > 0.2
    else:
        assert colourful[0] > 0.2 > 2.0 * colourful[1]
    top = rows[1], columns[1]
    assert weights[top] == 0.0 and np.abs(clear[top] - covered[top]).max() < 0.02
    assert (np.abs(clear - covered).max(axis=2) > 0.02).sum() < 0.3 * clear.shape[0] * clear.shape[1]


def test_a_second_render_that_fails_leaves_the_scene_as_it_was(pressed, tmp_path, monkeypatch):
    scene, _, target = pressed
    before, calls, first = dump(), [], render.render_frame

    def fail(*arguments, **options):
        calls.append(target.hide_render)
        if len(calls) == 2:
            raise SceneError("the disk is full")
        return first(*arguments, **options)

    monkeypatch.setattr(render, "render_frame", fail)
    with pytest.raises(SceneError, match="disk"):
        picture_of(scene, tmp_path / "out", own_light=True)  # studio light begins with a small render of its own
    assert calls == [False, True] and not target.hide_render and not scene.render.use_border
    assert [line for line in changes(before, dump()) if "Render Result" not in line] == []
    assert not list((tmp_path / "out").glob("scene*"))


def test_one_render_where_nothing_is_covered(pressed, tmp_path, monkeypatch):
    """From below nothing is between the camera and the pad, whose texels face the other way."""
    scene, *_ = pressed
    calls, first = [], render.render_frame
    monkeypatch.setattr(render, "render_frame", lambda *words, **options: calls.append(1) or first(*words, **options))
    request = FigureRequest(("scene",), frames=(3,), size=(32, 24), samples=1, view=(-90.0, -40.0), own_light=True)
    run_job(figure_export.make_figures(scene, tmp_path / "out", request))
    assert len(calls) == 1


def test_an_arrow_is_seen_through_the_target_in_one_piece(pressed):
    """The target is clear along the whole arrow, and in less than two fifths of the picture."""
    scene, pad, *_ = pressed
    weights = loaded_pixels(scene, pad)[3]
    arrow = scene.objects["Net Force Pad"]
    with render_setup.render_setup(scene, [3], FigureRequest(view=VIEW, size=SIZE)):
        scene.frame_set(3)
        matrix = arrow.matrix_world
        spots = places_of(scene, [matrix @ Vector((0.0, 0.0, height)) for height in np.linspace(0.1, 0.9, 20)])
    along = [weights[SIZE[1] - 1 - int(y * SIZE[1]), int(x * SIZE[0])] for x, y in spots]
    assert min(along) == pytest.approx(see_through.CLEARNESS)
    assert (weights > 0.0).mean() < 0.4


@pytest.mark.long("a map for every pixel of a picture")
def test_a_map_has_no_hole_between_two_places_of_contact(tmp_path):
    """A bar with two feet is seen through between its feet, too, and stays opaque where it stands over the pad's edge."""
    scene, pad = scene_of(3), grid(columns=12, rows=24)
    target = cube("Bar", (0.0, 0.0, 0.011), size=1.0)
    target.scale = (0.05, 0.2, 0.012)
    for side in (-1.0, 1.0):
        foot = cube("Foot", (0.0, side * 0.018, 0.0048), size=1.0)
        foot.scale = (0.02, 0.006, 0.011)
        foot.palpate.role = "TARGET"
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    baked(scene, tmp_path)
    found = figure_export.read_scene_bake(scene)
    with render_setup.render_setup(scene, [3], FigureRequest(view=(-90.0, 60.0), size=SIZE)):
        scene.frame_set(3)
        loaded = loaded_texels.loaded_texels(scene, found, 3)
        weights = see_through.clear_weights(scene, loaded, SIZE)

        def weight_at(point):
            x, y = render.image_position(scene, point)
            return weights[SIZE[1] - 1 - int(y * SIZE[1]), int(x * SIZE[0])]

        assert np.abs(loaded.points[:, 1]).min() > 0.01  # nothing is loaded in the middle
        assert weight_at((0.0, 0.0, 0.0)) == pytest.approx(see_through.CLEARNESS)
        edge = np.abs(np.array(pad.dimensions)[:2]).max() / 2
        assert weight_at((0.0, edge + 0.012, 0.017)) == 0.0  # behind the bar there is no pad
