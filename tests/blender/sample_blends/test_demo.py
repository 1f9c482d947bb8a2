# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo and the sample files: what they promise to show."""

import re
from dataclasses import replace

import blender_scenes
import bpy
import numpy as np
import pytest

from palpate.addon.render import render
from palpate.commands import main
from palpate.core import response
from palpate.core.errors import SceneError
from palpate.core.io.recording_npz import load_recording
from palpate.core.solver import time_step_adviser
from palpate.core.solver.simulation import run
from palpate.sample_blends import build_samples, demo, scene_builder

# --- the scene


def test_the_cube_weighs_what_steel_weighs(scene):
    demo.build(scene)
    size = np.ptp(blender_scenes.evaluated_vertices(scene.objects[demo.CUBE]), axis=0) * scene.unit_settings.scale_length
    assert scene.objects[demo.CUBE].palpate.mass / size.prod() == pytest.approx(8000, rel=0.01)


@pytest.mark.parametrize(("rows", "columns"), [(14, 6), (2, 2), (3, 9)])
def test_pads_are_closed_and_flat_where_they_feel(rows, columns):
    vertices, faces, texels = scene_builder.pad_mesh(rows, columns, pitch=3.0, margin=3.0, thickness=6.0)
    edges = [(face[i - 1], face[i]) for face in faces for i in range(len(face))]
    assert len(set(edges)) == len(edges)  # no edge is walked twice in one direction …
    assert set(edges) == {(b, a) for a, b in edges}  # … and each once in the other: closed and oriented
    assert (vertices[texels, 2] == 0).all()
    around = [face for face in faces if set(face) & set(texels)]
    assert all((vertices[list(face), 2] == 0).all() for face in around)  # so every texel's normal is straight up
    a, b, c = (vertices[[face[i] for face in around]] for i in (0, 1, 2))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


# --- the command


def test_demo_prints_and_draws_what_it_promises(tmp_path, capfd):
    out = tmp_path / "demo"
    assert main(["demo", "--out", str(out), "--no-render"]) == 0
    words, err = capfd.readouterr()
    assert err == ""
    required, measured = (float(x) for x in re.search(r"required ([\d.]+) N, measured ([\d.]+) N", words).groups())
    assert required == pytest.approx(9.81, abs=1e-6)
    assert measured == pytest.approx(required, abs=5e-5)  # 9.8100: four digits behind the point
    for name in ("tactile-strip.png", "forces.png", "demo.blend"):
        assert (out / name).stat().st_size > 10_000 and str(out / name) in words
    assert not (out / "scene.png").exists()
    assert not (out / "demo.blend1").exists()
    assert (out / "demo.blend").stat().st_size < 1_000_000

    readings = load_recording(out / "palpate-bake" / demo.PAD_A / "recording.npz").sensors[demo.PAD_A]
    normal = readings.normal_force.sum(axis=1)
    shear = np.linalg.norm(readings.shear.sum(axis=1), axis=1)
    share = np.divide(shear, 0.435 * normal, out=np.zeros_like(shear), where=normal > 0.1)
    assert share[20] < 0.05  # pressed, not yet sliding
    assert share[30] < 0.5  # sliding, the bristles hold
    assert 0.9 < share[demo.PICTURE_FRAME - 1] < 1.05  # slips
    assert normal[0] == 0
    assert normal[-1] == 0  # lifted
    assert readings.depth.max() < 0.012  # nothing bottomed out

    # Opened again, the file has the cube where it came to rest, and heat maps on the images of the bake.
    scene = blender_scenes.reopen(out / "demo.blend")
    scene.frame_set(scene.frame_end)
    cube = scene.objects[demo.CUBE]
    sunk = demo.PAD_HEIGHT - (cube.matrix_world.translation.z - demo.CUBE_EDGE / 2)
    assert sunk == pytest.approx(9.81 / (1000 * 70) * 1000, rel=1e-3)  # mm: 70 texels of 1000 N/m carry it
    images = [image for image in bpy.data.images if image.source == "SEQUENCE"]
    assert len(images) == 2
    assert all(image.filepath.startswith("//palpate-bake") for image in images)


@pytest.mark.long("a picture by Cycles of the demo itself")
def test_demo_renders_heat_map_and_arrow(tmp_path):
    from matplotlib.image import imread

    assert main(["demo", "--out", str(tmp_path), "--size", "320", "180", "--samples", "2"]) == 0
    picture = imread(tmp_path / "scene.png")[:, :, :3]
    assert picture.shape == (180, 320, 3)
    left = picture[:, :250]  # without the column of tactile images
    red, green, blue = left[..., 0], left[..., 1], left[..., 2]
    assert ((red > 0.75) & (green > 0.35) & (green < 0.7) & (blue < 0.35)).sum() > 100  # the orange arrows
    assert ((red > 0.8) & (green > 0.7) & (blue > 0.45) & (red - blue > 0.15)).sum() > 100  # 0.14 N on the magma map


# --- the camera


@pytest.mark.parametrize("size", [(1280, 720), (500, 800)])
@pytest.mark.parametrize("region", [(0.05, 0.05, 0.95, 0.95), (0.1, 0.2, 0.6, 0.9)])
def test_the_camera_frames_everything_and_no_more(scene, size, region):
    demo.build(scene)
    scene.render.resolution_x, scene.render.resolution_y = size
    points = render.bounding_box_corners([scene.objects[name] for name in (demo.BALL, demo.CUBE, demo.PAD_A)])
    render.fit_camera(scene, points, region)
    places = blender_scenes.places_of(scene, points)
    left, bottom, right, top = region
    assert (places >= np.array([left, bottom]) - 1e-4).all()
    assert (places <= np.array([right, top]) + 1e-4).all()
    fills_width = np.ptp(places[:, 0]) == pytest.approx(right - left, abs=1e-3)
    fills_height = np.ptp(places[:, 1]) == pytest.approx(top - bottom, abs=1e-3)
    assert fills_width or fills_height


def test_positions_on_the_picture_are_blenders(scene):
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    demo.build(scene)
    scene.camera.data.shift_x = 0.0
    for point in ((0.0, 0.0, 20.0), (30.0, -10.0, 50.0), (-50.0, 5.0, 0.0)):
        expected = world_to_camera_view(scene, scene.camera, Vector(point))
        assert render.image_position(scene, point) == pytest.approx((expected.x, expected.y), abs=1e-5)


def test_a_scene_without_camera_says_so(scene, tmp_path):
    with pytest.raises(SceneError, match="no perspective camera"):
        render.render_frame(scene, tmp_path / "a.png", 1)
    assert list(tmp_path.iterdir()) == []


# --- the committed files


def described(scene):
    """What a sample is made of, in plain numbers, and what it says of itself."""
    found = {"Read me": bpy.data.texts["Read me"].as_string()}
    for obj in scene.objects:
        settings = {}
        if obj.palpate.role != "NONE":
            settings = blender_scenes.settings(obj.palpate, uids=False)
        shape = blender_scenes.evaluated_vertices(obj).round(4).tolist() if obj.type == "MESH" else None
        found[obj.name] = (settings, shape)
    for frame in range(scene.frame_start, scene.frame_end + 1, 7):
        scene.frame_set(frame)
        for obj in scene.objects:
            found[obj.name, frame] = np.array(obj.matrix_world).round(4).tolist()
    return found


LARGE = [pytest.mark.long("the two scenes that take longest to build")]


@pytest.mark.slow("builds each sample scene again")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=LARGE if name in ("hand", "geometries") else ()) for name in build_samples.SAMPLES]
)
def test_samples_are_what_their_scripts_build(name, repository, tmp_path):
    path = repository / "sample_blends" / f"{name}.blend"
    assert path.stat().st_size < 1_000_000
    committed = described(blender_scenes.reopen(path))
    assert described(blender_scenes.reopen(build_samples.build_one(name, tmp_path))) == committed


@pytest.mark.slow("bakes each sample scene")
@pytest.mark.parametrize("name", build_samples.SAMPLES)
def test_samples_open_to_a_picture_and_bake(name, repository, tmp_path):
    """In the camera's view with materials, at a frame past the first, with a sensor active and its tab shown."""
    bpy.ops.wm.open_mainfile(filepath=str(repository / "sample_blends" / f"{name}.blend"), load_ui=True)
    scene, active = bpy.context.scene, bpy.context.view_layer.objects.active
    assert active.palpate.role == "SENSOR" and active.select_get()
    assert scene.frame_start < scene.frame_current <= scene.frame_end
    spaces = [area.spaces.active for screen in bpy.data.screens for area in screen.areas]
    views = [space for space in spaces if space.type == "VIEW_3D"]
    assert {view.region_3d.view_perspective for view in views} == {"CAMERA"}
    assert {view.shading.type for view in views} == {"MATERIAL"}
    backdrop = max(scene.objects["Backdrop"].dimensions)
    assert min(view.clip_end for view in views) > 2 * backdrop  # so that Home shows it all
    assert {space.context for space in spaces if space.type == "PROPERTIES"} == {"PHYSICS"}
    seen = scene.camera.matrix_world.inverted() @ active.matrix_world.translation
    assert seen.z < 0
    scene.palpate.folder = str(tmp_path / "bake")
    recording = blender_scenes.baked(scene).recording
    assert recording.warnings == ()
    assert response.peak_force(recording) > 0.01
    for sensor in recording.sensors.values():
        assert sensor.contact.any()
        assert np.isfinite(sensor.normal_force).all()


@pytest.mark.long("steps of 0.02 to 0.04 ms")
def test_what_the_recommended_step_buys_is_as_the_panel_says(repository):
    scenario = blender_scenes.scenario_of(blender_scenes.reopen(repository / "sample_blends" / "grasp_bottle.blend"))
    advice = time_step_adviser.advise(scenario)
    assert 10.0 < scenario.dt / advice.dt < 25.0
    set_, fine = run(scenario), run(replace(scenario, dt=None))
    for sensor, expected in fine.sensors.items():
        force, found = expected.normal_force, set_.sensors[sensor].normal_force
        assert np.abs(found.sum(axis=1) - force.sum(axis=1)).max() < time_step_adviser.SUM_ERROR * force.sum(axis=1).max()
        assert np.abs(found - force).max() < time_step_adviser.TEXEL_ERROR * force.max()
    words = time_step_adviser.benefit(scenario.dt, advice)
    assert "sums of forces changed by 0.2%, texels by 2% at most" in words
    assert time_step_adviser.benefit(advice.dt, advice) == ""
