# SPDX-License-Identifier: GPL-3.0-or-later
"""An automatic picture shows the loaded texels, whole and in the colours of the colour bar, whatever the scene looks like."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked_file, ball, changes, cube, dump, grid, places_of, reopen, scene_of

from palpate.addon.render import camera_direction, figure_export, loaded_texels, render, render_setup, studio
from palpate.addon.render.figure_request import FigureRequest
from palpate.core.figures import color_maps
from palpate.core.jobs import run_job

SIZE = (96, 72)


@pytest.fixture(scope="module")
def wall_blend(blender, tmp_path_factory):
    """A pad whose texels face −x, a ball that presses on it from there, and a camera behind the pad, baked and saved."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene, pad = scene_of(3), grid(columns=12, rows=12)
    pad.rotation_euler = (0.0, -np.pi / 2, 0.0)
    target = ball(location=(-0.0085, 0.0, 0.0), radius=0.01)
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    material = bpy.data.materials.new("Own")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.02, 0.02, 0.02, 1.0)
    for obj in (pad, target):
        obj.data.materials.append(material)
    bpy.ops.object.camera_add(location=(0.5, 0.0, 0.1), rotation=(1.3, 0.0, np.pi / 2))
    scene.camera = bpy.context.object
    scene.render.engine, scene.cycles.samples = "CYCLES", 4
    return baked_file(scene, tmp_path_factory.mktemp("wall"))[0]


@pytest.fixture
def scene(scene, wall_blend):
    return reopen(wall_blend)


def loaded_at_3(scene):
    return loaded_texels.loaded_texels(scene, figure_export.read_scene_bake(scene), 3)


def test_the_camera_is_turned_to_the_loaded_texels(scene):
    before = dump()
    loaded = loaded_at_3(scene)
    assert len(loaded) >= 4 and loaded.normals[:, 0] == pytest.approx(np.full(len(loaded), -1.0), abs=1e-5)
    assert loaded.points[:, 0].max() > 5e-4  # they lie on the indented surface
    options = render_setup.RenderOptions(size=SIZE, see_through=True)
    with render_setup.render_setup(scene, [3], options, {3: loaded}):
        back = np.array(scene.camera.matrix_world)[:3, 2]
        assert (loaded.normals @ back).min() > camera_direction.FACING - 0.02
        places = places_of(scene, loaded.points)
        assert (places > 0.05).all() and (places < 0.95).all()
    with render_setup.render_setup(scene, [3], options):  # nothing is known of loads: as the scene's camera
        assert np.array(scene.camera.matrix_world)[:3, 2] @ np.array((1.0, 0.0, 0.0)) > 0.9
    assert [line for line in changes(before, dump()) if "Render Result" not in line] == []  # Blender's own


def test_a_camera_that_shows_the_texels_keeps_its_direction(scene):
    loaded = {3: loaded_at_3(scene)}
    view = camera_direction.best_view(scene, loaded, (75.0, 20.0), True)
    assert view is not None and np.cos(np.radians(view[0])) < -0.5
    for azimuth in (150.0, -160.0):
        assert camera_direction.best_view(scene, loaded, (azimuth, 30.0), True) is None
    assert camera_direction.view_of(camera_direction.direction_of((75.0, 20.0))) == pytest.approx((75.0, 20.0))


def test_a_direction_that_shows_things_larger_is_preferred(scene):
    """A pad that is seen equally well from two sides is seen from where a long handle is foreshortened."""
    loaded = {3: loaded_at_3(scene)}
    corners = render.bounding_box_corners([scene.objects["Pad"], scene.objects["Ball"]])
    for side in (-1.0, 1.0):
        # the handle goes to −x and to one side, so the picture is larger from where it points at the camera
        handle = corners + np.array([-0.3, side * 0.17, 0.0])
        view = camera_direction.best_view(scene, loaded, (90.0, 0.0), True, np.concatenate([corners, handle]))
        assert side * np.sin(np.radians(view[0])) > 0.0 > np.cos(np.radians(view[0]))


def test_what_stands_before_the_texels_blocks_the_sight_unless_it_is_a_target(scene):
    loaded = {3: loaded_at_3(scene)}
    bpy.ops.mesh.primitive_plane_add(size=0.2, location=(-0.03, 0.1, 0.0), rotation=(0.0, np.pi / 2, 0.0))
    screen = bpy.context.object  # from y = 0 to the left
    bpy.context.view_layer.update()
    blocked = camera_direction.best_view(scene, loaded, (0.0, 30.0), True)
    assert blocked is not None and blocked[0] < 0.0
    screen.location.y = -0.1
    bpy.context.view_layer.update()
    assert camera_direction.best_view(scene, loaded, (0.0, 30.0), True)[0] > 0.0


def test_what_touches_the_subjects_is_in_the_picture_and_a_backdrop_is_not(scene):
    housing = cube("Housing", (0.012, 0.0, 0.018), size=0.02)
    knob = cube("Knob", (0.012, 0.0, 0.030), size=0.004)
    knob.parent = housing
    knob.matrix_parent_inverse = housing.matrix_world.inverted()
    bpy.ops.mesh.primitive_plane_add(size=5.0, location=(0.0, 0.0, -0.06))
    floor = bpy.context.object
    with render_setup.render_setup(scene, [3], render_setup.RenderOptions(size=SIZE)):
        places = places_of(scene, render.bounding_box_corners([housing, knob]))
        assert floor.hide_render and not housing.hide_render
    assert (places > 0.0).all() and (places < 1.0).all()
    assert not floor.hide_render


def test_a_large_housing_is_cropped_so_that_the_pad_stays_large(scene):
    options = render_setup.RenderOptions(size=SIZE, view=(180.0, 20.0))
    central = render.bounding_box_corners([scene.objects["Pad"], scene.objects["Ball"]])

    def height() -> float:
        with render_setup.render_setup(scene, [3], options):
            places = places_of(scene, central)
            assert (places > 0.0).all() and (places < 1.0).all()
            return np.ptp(places[:, 1])

    alone = height()
    housing = cube("Housing", (0.012, 0.0, 0.073), size=0.09)
    assert alone / (render_setup.MOST_ROOM + 0.1) < height() < 0.95 * alone
    with render_setup.render_setup(scene, [3], options):
        tops = render.bounding_box_corners([housing])[:, 2].max()
        assert render.image_position(scene, (0.012, 0.0, tops))[1] > 1.0


def test_a_pad_that_nothing_touches_takes_no_room(scene):
    options = render_setup.RenderOptions(size=SIZE, view=(180.0, 20.0))
    with render_setup.render_setup(scene, [3], options):
        before = np.array(scene.camera.matrix_world)
    table = cube("Table", (0.0, 0.0, -0.09), size=0.06)
    table.palpate.role = "PAD"
    with render_setup.render_setup(scene, [3], options):
        assert np.array(scene.camera.matrix_world) == pytest.approx(before, abs=1e-6)
    table.location.z = -0.056
    with render_setup.render_setup(scene, [3], options):
        assert not np.allclose(np.array(scene.camera.matrix_world), before, atol=1e-3)


@pytest.mark.slow("two pictures by Cycles, at 4 samples")
def test_the_subject_stands_out_from_the_background(scene, tmp_path):
    """The scene's own lamp is far too bright and its world green; with own light both count."""
    from matplotlib.image import imread

    bpy.ops.object.light_add(type="SUN")
    bpy.context.object.data.energy = 1000.0
    scene.world = bpy.data.worlds.new("Green")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.0, 1.0, 0.0, 1.0)
    before, corner = dump(), {}
    for own_light in (False, True):
        request = FigureRequest(("scene",), frames=(3,), size=SIZE, samples=4, view=(160.0, 20.0), own_light=own_light)
        run_job(figure_export.make_figures(scene, tmp_path / f"{own_light}", request))
        corner[own_light] = imread(tmp_path / f"{own_light}" / "scene_0003.png")[2, 2, :3]
    expected = 1.055 * studio.LIGHT_BACKGROUND ** (1 / 2.4) - 0.055
    assert corner[False] == pytest.approx(np.full(3, expected), abs=0.05)
    assert corner[True][1] > 0.9 > 0.1 > corner[True][0]
    assert [line for line in changes(before, dump()) if "Render Result" not in line] == []


def test_without_denoiser_there_are_more_samples_and_it_is_said(scene, tmp_path, monkeypatch):
    scene.cycles.use_denoising = False
    samples = []
    monkeypatch.setattr(render, "run_render", lambda scene, file, **_: samples.append(_settings(scene)) or file.touch())
    monkeypatch.setattr(figure_export, "side_by_side", lambda source, path, *_: path.touch())
    stages = []
    request = FigureRequest(("scene",), frames=(3,), size=SIZE, see_through=False, own_light=True)
    for can in (True, False):
        monkeypatch.setattr(render, "can_denoise", lambda can=can: can)
        run_job(figure_export.make_figures(scene, tmp_path / f"{can}", request), lambda step: stages.append(step.stage))
    assert samples == [(True, 4), (False, 16)]
    assert "Rendering (4 × samples: no denoiser here)" in stages and "Rendering" in stages


def _settings(scene):
    return scene.cycles.use_denoising, scene.cycles.samples


@pytest.mark.parametrize(  # EEVEE takes Mesa minutes, for its shaders
    "engine", [pytest.param("cycles", marks=pytest.mark.long("a picture by Cycles at 16 samples")), "workbench"]
)
def test_colours_are_those_of_the_colour_bar(scene, tmp_path, engine):
    """Every loaded texel that is seen has the colour of its force, in light that shows its shape, too."""
    from matplotlib.image import imread

    if engine != "cycles" and not render.has_opengl():
        pytest.skip("Workbench needs OpenGL, which this machine has not")
    scene.view_settings.view_transform = "AgX"  # as in every new file
    scene.view_settings.exposure = 0.5
    scene.palpate.color_map = "MAGMA"
    size = (320, 240)
    request = FigureRequest(("scene",), frames=(3,), size=size, samples=16, engine=engine, see_through=True, view=(180.0, 20.0))
    run_job(figure_export.make_figures(scene, tmp_path / "out", request))
    picture = imread(tmp_path / "out" / "scene_0003.png")
    found = figure_export.read_scene_bake(scene)
    texels, readings = found.texels["Pad"], found.recording.at(3).sensors["Pad"]
    scale = request.style.scale(found.recording, found.texels)
    values = scale.values(readings, texels) / scale.high
    scene.frame_set(3)
    matrix = np.array(scene.objects["Pad"].matrix_world)
    free = readings.normal_force == 0.0
    with render_setup.render_setup(scene, [3], request, {}):
        places = places_of(scene, texels.position @ matrix[:3, :3].T + matrix[:3, 3])
    columns, rows = (places * size).astype(int).T
    seen = picture[size[1] - 1 - rows, columns, :3]
    expected = color_maps.colors("VIRIDIS", values)
    radius = np.linalg.norm(texels.position - texels.position.mean(axis=0), axis=1)
    clear = (free & (radius > 0.019)) & (np.abs(texels.position).max(axis=1) < 0.0249)  # beside the ball and its shadow
    assert clear.sum() >= 20
    assert np.median(np.abs(seen - expected)[clear]) < 0.04
    touched = ~free & (radius < 0.004)
    assert touched.any() and np.median(np.abs(seen - expected)[touched]) < 0.2  # through the ball's faint image
