# SPDX-License-Identifier: GPL-3.0-or-later
"""A baked .blend plays its heat maps, arrows and bodies in a Blender that has never heard of Palpate."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, cube, keyframe, press_and_drop, save, scene_with_readings

from palpate.addon.display import materials
from palpate.core import response
from palpate.core.figures import color_maps

FRAMES = (1, 7, 8)
SCRIPT = Path(__file__).with_name("without_addon.py")


def figure_style_from_above(scene, height=0.5, width=0.05):
    """A camera straight above the first pad, and no light but the heat map's own."""
    bpy.ops.object.camera_add(location=(0.0, 0.0, height), rotation=(0.0, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", width
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 4, False, 0
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.resolution_x = scene.render.resolution_y = 56
    scene.view_settings.view_transform = "Standard"
    scene.world = None


def watch(path, tmp_path, name, with_addon, frames=FRAMES):
    """Open a file in a Blender of its own and return what it saw."""
    report = tmp_path / f"{name}.json"
    command = [sys.executable, str(SCRIPT), str(path), str(report), str(int(with_addon)), *map(str, frames)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180)
    assert report.exists(), done.stdout + done.stderr
    return json.loads(report.read_text())


@pytest.fixture(scope="module")
def scene_file(blender, tmp_path_factory):
    """Return a baked file whose folder has moved, and its recording."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    home = tmp_path_factory.mktemp("scene")
    scene, pad, target, _, free = press_and_drop(frames=8)
    tip, plate = cube("Tip", (0.0, 0.1, 0.0), size=0.02), cube("Plate", (0.0, 0.1, 0.0275), size=0.04)
    tip.palpate.role, plate.palpate.role = "SENSOR", "TARGET"  # a tip's heat map goes by geometry nodes
    keyframe(plate, "location", {1: plate.location[:], 8: (0.0, 0.1, 0.032)})
    target.hide_render = free.hide_render = True  # see the pad and not the indenter
    figure_style_from_above(scene)
    folder = home / "project"
    folder.mkdir()
    recording = baked(scene, folder).recording
    for obj in scene.objects:
        if obj.name.startswith("Net Force"):
            obj.hide_render = True
    save(folder)
    folder.rename(home / "elsewhere")  # the paths are relative, so the folder can travel
    return home / "elsewhere" / "scene.blend", recording


@pytest.fixture(scope="module")
def without(scene_file):
    """Return what a Blender without the add-on sees."""
    path, _ = scene_file
    return watch(path, path.parent.parent, "without", False)


@pytest.mark.slow("starts Blender twice and renders")
def test_it_plays_without_the_addon(scene_file, without, tmp_path):
    path, recording = scene_file
    with_it = watch(path, tmp_path, "with", True)
    assert not without["has_addon"] and with_it["has_addon"]
    assert without["frames"] == with_it["frames"]

    arrows = [without["frames"][str(frame)]["arrows"]["Net Force Pad"] for frame in FRAMES]
    lengths = [np.linalg.norm(np.array(matrix)[:3, 2]) for matrix in arrows]
    forces = [np.linalg.norm(recording.sensors["Pad"].net_force[frame - 1]) for frame in FRAMES]
    assert forces[0] == 0.0 and forces[2] > forces[1] > 0.0
    assert np.array(lengths) / lengths[2] == pytest.approx(np.array(forces) / forces[2], abs=1e-5)

    for frame in FRAMES:
        shown = without["frames"][str(frame)]["tip"]
        assert shown == pytest.approx(recording.sensors["Tip"].normal_force[frame - 1], abs=1e-7)
    assert recording.sensors["Tip"].normal_force[0].max() > 0.0

    depths = [without["frames"][str(frame)]["depth"] for frame in FRAMES]
    deepest = recording.sensors["Pad"].depth.max(axis=1)
    assert depths == pytest.approx([deepest[frame - 1] for frame in FRAMES], rel=0.2, abs=1e-7)  # smooth over 3 by 3 texels

    cube_at = recording.body_names.index("Cube")
    for frame in FRAMES:
        matrix = np.array(without["frames"][str(frame)]["bodies"]["Cube"])
        assert matrix[:3, 3] == pytest.approx(recording.poses[frame - 1, cube_at, :3], abs=1e-6)


@pytest.mark.slow("starts Blender")
def test_another_quantity_plays_without_the_addon(tmp_path):
    """test_quantities.py compares what a bake stores of every quantity."""
    scene = scene_with_readings()
    scene.palpate.quantity = "READING"
    cube("Tip", (0.0, 0.1, 0.0), size=0.02)
    figure_style_from_above(scene)
    path, result = baked_file(scene, tmp_path)
    (tmp_path / "palpate-bake").rename(tmp_path / "lost")  # the values are in the .blend
    pad = next(sensor for sensor in result.scenario.sensors if sensor.name == "Pad")
    seen = watch(path, tmp_path, "reading", False)["frames"]
    for frame in FRAMES:
        shown = np.array(seen[str(frame)]["shown"]["palpate_reading"])[pad.texels.vertex]
        assert shown == pytest.approx(result.recording.at(frame).sensors["Pad"].reading, rel=1e-5)


@pytest.mark.long("starts Blender twice and renders")
def test_outside_of_the_bake_and_without_its_files_nothing_passes_for_a_force(scene_file, tmp_path):
    """Before the first frame, and where a folder was lost, the pad is magenta; after the last frame it holds the last."""
    path, _ = scene_file
    outside = watch(path, tmp_path, "outside", False, frames=(0, 8, 9))["frames"]
    assert np.array(outside["9"]["pixels"]) == pytest.approx(np.array(outside["8"]["pixels"]), abs=1e-6)
    alone = tmp_path / path.name
    shutil.copy(path, alone)
    lost = watch(alone, tmp_path, "lost", False, frames=(7,))["frames"]
    for shot in (outside["0"], lost["7"]):
        width, height = shot["size"]
        middle = np.array(shot["pixels"]).reshape(height, width, 4)[height // 2, width // 2]
        assert middle[0] > 0.5 and middle[1] < 0.05 and middle[2] > 0.5


def test_every_texel_has_the_colour_of_its_force(scene_file, without):
    """Seen from above in the dark, a pixel shows the share of the colour that glows of the texel under it."""
    _, recording = scene_file
    force = recording.sensors["Pad"].normal_force
    end = response.scale_limit(response.peak_force(recording))  # one scale for all
    for frame in FRAMES:
        shot = without["frames"][str(frame)]
        width, height = shot["size"]
        pixels = np.array(shot["pixels"]).reshape(height, width, 4)
        # the pad is 50 mm wide and fills the picture: 6 × 14 texels, those on the rim only half of their cell
        column = np.clip(np.round((np.arange(6) / 5) * width - 0.5), 1, width - 2).astype(int)
        row = np.clip(np.round((np.arange(14) / 13) * height - 0.5), 1, height - 2).astype(int)
        found = pixels[np.ix_(row, column)][..., :3].reshape(-1, 3)
        colors = color_maps.colors("VIRIDIS", force[frame - 1] / end)
        glow = materials.GLOW * color_maps.linear(colors)
        expected = np.where(glow <= 0.0031308, 12.92 * glow, 1.055 * glow ** (1 / 2.4) - 0.055)
        assert np.abs(found - expected).max() < 0.03, frame
    assert len({tuple(shot["pixels"]) for shot in without["frames"].values()}) == 3
