# SPDX-License-Identifier: GPL-3.0-or-later
"""Add Probe: something that presses on a new sensor, as deep as it says, wherever the sensor is."""

import bpy
import numpy as np
import pytest
from blender_scenes import grid, pad_sensor, refusal, scenario_of, scene_of

from palpate.core.solver.simulation import run


@pytest.mark.parametrize("shape", ["BALL", "BOX", "ROD"])
def test_it_presses_as_deep_as_it_says_and_goes(shape):
    scene, pad = scene_of(41), pad_sensor(columns=15, rows=15)
    pad.location, pad.rotation_euler = (0.1, -0.2, 0.3), (0.5, 1.0, -0.7)
    assert bpy.ops.palpate.probe_add(shape=shape, size=0.01, depth=0.002) == {"FINISHED"}
    assert bpy.context.object == pad  # the sensor stays active, so that its panel shows what it feels
    assert bpy.data.objects["Probe"].palpate.role == "TARGET"
    felt = run(scenario_of(scene)).sensors["Pad"]
    assert felt.depth.max() == pytest.approx(0.002, rel=0.01)
    assert felt.contact.any(axis=1).sum() > 15
    assert not felt.contact[0].any() and not felt.contact[-1].any()
    deepest = felt.depth.max(axis=1).argmax()
    assert np.linalg.norm(felt.centre_of_pressure[deepest]) < 0.003


def test_it_touches_within_two_frames_of_the_usual_range(scene):
    """So that the first image does not wait for an approach."""
    assert (scene.frame_start, scene.frame_end) == (1, 250)
    pad_sensor(columns=5, rows=5)
    bpy.ops.palpate.probe_add()
    scene.frame_end = 4
    felt = run(scenario_of(scene)).sensors["Pad"]
    assert not felt.contact[0].any() and felt.contact[2].any()


def test_bumps_beside_the_middle_are_not_pressed_from_the_start():
    """It first touches what is highest under it, and goes as deep as it says from there."""
    scene, pad = scene_of(41), grid(columns=15, rows=15)
    for vertex in pad.data.vertices:
        vertex.co.z += 0.01 * (vertex.co.xy.length > 0.012)
    pad.rotation_euler = (0.5, 1.0, -0.7)
    bpy.ops.palpate.sensor_add()
    pad.palpate.max_penetration = 0.004
    assert bpy.ops.palpate.probe_add(shape="BOX", size=0.02, depth=0.001) == {"FINISHED"}
    felt = run(scenario_of(scene)).sensors["Pad"]
    assert not felt.contact[0].any()
    assert felt.depth.max() == pytest.approx(0.001, rel=0.2)  # along normals that lean


def test_it_goes_where_the_sensor_is(tmp_path):
    """Into the sensor's collection; also for a sensor that is linked, which it does not change."""
    pad = grid()
    home = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(home)
    bpy.context.scene.collection.objects.unlink(pad)
    home.objects.link(pad)
    bpy.context.view_layer.objects.active = pad
    bpy.ops.palpate.sensor_add()
    bpy.ops.palpate.probe_add()
    assert bpy.data.objects["Probe"].users_collection[0] == home
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Pad"]
    linked = wanted.objects[0]
    bpy.context.scene.collection.objects.link(linked)
    bpy.context.view_layer.objects.active = linked
    assert bpy.ops.palpate.probe_add() == {"FINISHED"}
    assert bpy.ops.palpate.sensor_toml_export(filepath=str(tmp_path / "sensor.toml")) == {"FINISHED"}
    assert not bpy.ops.palpate.weight_paint.poll()


def test_without_a_sensor_there_is_no_probe():
    grid()
    assert not bpy.ops.palpate.probe_add.poll()
    bpy.ops.palpate.sensor_add()
    bpy.context.object.palpate.region = "GROUP"
    assert "no vertex group" in refusal(bpy.ops.palpate.probe_add)
