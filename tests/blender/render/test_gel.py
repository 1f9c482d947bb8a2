# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a baked gel show the surface that Blender shows. Markers and lamps are tested in tests/core/figures/."""

import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, ball, grid, keyframe, press, scene_of

from palpate.addon.render import figure_export
from palpate.addon.render.figure_request import FigureRequest
from palpate.addon.scene import mesh_arrays
from palpate.commands import main
from palpate.core.errors import SensorError
from palpate.core.figures import color_maps
from palpate.core.io.hidden_folder import LIST_NAME
from palpate.core.io.recording_npz import load_recording
from palpate.core.jobs import run_job

SIDE, ANGLE = 0.05, 50.0
"""Of the gel, m; of the lamps, degrees."""


@pytest.fixture(scope="module")
def gel_file(blender, tmp_path_factory):
    """A ball of 40 mm is pressed 3 mm into a gel and drawn aside by 4 mm; the command draws the images into a folder, plain."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene, folder = scene_of(6), tmp_path_factory.mktemp("gel")
    gel = grid("Gel", columns=16, rows=16, size=SIDE)
    target = ball(radius=0.04)
    for face in target.data.polygons:
        face.use_smooth = True
    divide = target.modifiers.new("Round", "SUBSURF")
    divide.levels = 2
    gel.palpate.role, target.palpate.role, gel.palpate.sigma0 = "SENSOR", "TARGET", 30.0
    keyframe(target, "location", {1: (0.006, -0.003, 0.042), 3: (0.006, -0.003, 0.036), 6: (0.01, -0.003, 0.036)})
    scene.frame_set(1)
    path, _ = baked_file(scene, folder)
    command = ["render", str(path), "--only", "gel", "--size", "450", "300", "--light-angle", str(ANGLE)]
    assert main([*command, "--no-markers", "--out", str(folder / "plain")]) == 0
    return path


@pytest.fixture
def pressed(scene, gel_file):
    bpy.ops.wm.open_mainfile(filepath=str(gel_file))
    recording = load_recording(gel_file.parent / "palpate-bake" / "Gel" / "recording.npz")
    return SimpleNamespace(folder=gel_file.parent, recording=recording)


def light(path):
    """The linear light of the three colours, (300, 300, 3)."""
    from matplotlib.image import imread

    picture = imread(path)
    assert picture.shape == (300, 300, 3)
    return color_maps.linear(picture)


def test_there_is_an_image_for_each_frame_or_for_those_that_are_named(pressed, tmp_path):
    every = {f"gel_Gel_{number:04d}.png" for number in range(1, 7)} | {LIST_NAME}
    assert {path.name for path in (pressed.folder / "plain").iterdir()} == every
    for options, frames in (({"frames": (2, 5)}, (2, 5)), ({"at_peak": True}, None)):
        request = FigureRequest(("gel",), size=(60, 40), **options)
        stages = []
        job = figure_export.make_figures(bpy.context.scene, tmp_path / str(frames), request)
        written = run_job(job, lambda step, stages=stages: stages.append((step.done, step.total)))
        total = [sensor.normal_force.sum(axis=1).argmax() + 1 for sensor in pressed.recording.sensors.values()]
        assert [path.name for path in written] == [f"gel_Gel_{number:04d}.png" for number in frames or total]
        assert stages[-1][0] <= stages[-1][1]


def test_three_colours_tell_the_normals_of_the_surface_that_blender_shows(pressed):
    """Median below 3 degrees where the ball presses, against the evaluated mesh of the indentation, faces being 0.8 mm wide."""
    bpy.context.scene.frame_set(6)
    mesh = bpy.data.objects["Gel"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert len(mesh.vertices) > 3000
    place = mesh_arrays.vertices(mesh)
    shown = np.array([vertex.normal for vertex in mesh.vertices])
    up, turn = math.radians(ANGLE), np.radians([90.0, 210.0, 330.0])
    lamps = np.column_stack([math.cos(up) * np.cos(turn), math.cos(up) * np.sin(turn), [math.sin(up)] * 3])
    picture = light(pressed.folder / "plain" / "gel_Gel_0006.png")
    row = np.clip(np.round(300 * (0.5 - place[:, 1] / SIDE) - 0.5), 0, 299).astype(int)
    column = np.clip(np.round(300 * (0.5 - place[:, 0] / SIDE) - 0.5), 0, 299).astype(int)
    found = np.linalg.solve(lamps, picture[row, column].T).T
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    error = np.degrees(np.arccos(np.clip((found * shown * (1.0, -1.0, 1.0)).sum(axis=1), -1.0, 1.0)))
    touched = place[:, 2] < -1e-4
    assert np.median(np.degrees(np.arccos(shown[touched, 2]))) > 10.0
    assert np.median(error[touched]) < 3.0
    assert np.percentile(error, 95) < 6.0


def test_a_sensor_without_rows_and_columns_is_refused(tmp_path):
    scene, pad, _ = press(frames=2)
    group = pad.vertex_groups.new(name="with a hole")
    group.add([vertex for vertex in range(84) if vertex != 40], 1.0, "REPLACE")
    pad.palpate.region, pad.palpate.vertex_group = "GROUP", group.name
    baked(scene, tmp_path)
    for sensors, words in (((), "No sensor of the bake has its texels in rows"), (("Pad",), "'Pad' form no rows and columns")):
        with pytest.raises(SensorError, match=words):
            run_job(figure_export.make_figures(scene, tmp_path / "out", FigureRequest(("gel",), sensors=sensors)))
    assert not (tmp_path / "out").exists()
