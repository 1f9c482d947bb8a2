# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys, armatures, modifiers and animated scale: what deforms in Blender presses as it looks, baked and played."""

import math

import bpy
import numpy as np
import pytest
from blender_scenes import keyframe, press, press_and_drop, reading_of, scenario_of, surface

from palpate.addon.scene import mesh_arrays, participants
from palpate.addon.session import transforms
from palpate.core.errors import SceneError


def world_of(scenario, values, body, frame):
    motion = scenario.bodies[body].motion
    return values @ transforms.rotation(motion.quaternions[frame]).T + motion.positions[frame]


def grow(target, frames):
    """A shape key that makes the ball half as large again."""
    target.shape_key_add(name="Basis")
    key = target.shape_key_add(name="Larger")
    for point in key.data:
        point.co *= 1.5
    keyframe(key, "value", {1: 0.0, frames: 1.0})


def wave(target, _frames):
    modifier = target.modifiers.new("Wave", "WAVE")
    modifier.height, modifier.width, modifier.narrowness = 0.002, 0.01, 100.0


def scale(target, frames):
    keyframe(target, "scale", {1: (1.0, 1.0, 1.0), frames: (1.2, 0.9, 1.4)})


def armature(target, frames):
    """A bone that moves the ball by 1 mm and turns it."""
    bpy.ops.object.armature_add(location=target.location)
    rig = bpy.context.object
    modifier = target.modifiers.new("Rig", "ARMATURE")
    modifier.object = rig
    group = target.vertex_groups.new(name="Bone")
    group.add(range(len(target.data.vertices) // 2), 1.0, "REPLACE")
    bone = rig.pose.bones[0]
    bone.rotation_mode = "XYZ"
    keyframe(bone, "rotation_euler", {1: (0.0, 0.0, 0.0), frames: (0.0, 0.3, 0.0)})


@pytest.mark.parametrize("how", [grow, wave, scale, armature])
def test_targets_are_sampled_as_they_look(how):
    scene, _, target = press(frames=6)
    how(target, 6)
    scene.frame_set(1)
    scenario = scenario_of(scene)
    values = scenario.targets[0].deformation.values
    assert len(values) == 6
    for frame in (1, 3, 6):
        scene.frame_set(frame)
        world = world_of(scenario, values[frame - 1], scenario.targets[0].body, frame - 1)
        np.testing.assert_allclose(world, surface(target), atol=2e-8)
    assert np.abs(values[-1] - values[0]).max() > 1e-4


@pytest.mark.parametrize("how", [grow, wave, armature])
def test_looks_are_the_fingerprints_of_every_frame(how):
    scene, pad, target = press(frames=6)
    pad.vertex_groups.new(name="Part").add(range(40), 1.0, "REPLACE")
    pad.palpate.region, pad.palpate.vertex_group = "GROUP", "Part"
    pad.modifiers.new("Bend", "SIMPLE_DEFORM").angle = math.radians(10)
    how(target, 4)  # and stays as it is at frames 5 and 6
    scene.frame_set(1)
    reading = reading_of(scene)
    expected = {"Pad": [], "Ball": []}
    for frame in range(1, 7):
        scene.frame_set(frame)
        for name, found in expected.items():
            found.append(mesh_arrays.evaluated_fingerprint(scene.objects[name], participants.depsgraph_of(scene)))
    assert reading.mesh_fingerprints == expected
    assert len(set(expected["Ball"][:4])) > 2 and len(set(expected["Pad"])) == 1


def test_what_does_not_change_is_rigid():
    scene, pad, target = press(frames=4)
    target.modifiers.new("More", "SUBSURF")
    target.shape_key_add(name="Basis")
    pad.modifiers.new("Bend", "SIMPLE_DEFORM").angle = math.radians(10)
    scenario = scenario_of(scene)
    assert scenario.targets[0].deformation is None
    assert scenario.sensors[0].deformation is None


def test_a_bending_sensor_carries_its_texels():
    scene, pad, _ = press(frames=5)
    pad.shape_key_add(name="Basis")
    key = pad.shape_key_add(name="Bent")
    for point in key.data:
        point.co.z = -10.0 * point.co.x**2
    keyframe(key, "value", {1: 0.0, 5: 1.0})
    scene.frame_set(1)
    sensor = scenario_of(scene).sensors[0]
    frames = sensor.deformation.values
    scene.frame_set(5)
    np.testing.assert_allclose(frames[-1][:, :3], surface(pad)[sensor.texels.vertex], atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(frames[-1][:, 3:6], axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.einsum("ij,ij->i", frames[-1][:, 3:6], frames[-1][:, 6:9]), 0.0, atol=1e-9)
    # The x axes go on pointing along the rows of the grid.
    row = np.argsort(sensor.texels.layout.column[sensor.texels.layout.row == 3])
    line = frames[-1][sensor.texels.layout.row == 3][row]
    steps = np.diff(line[:, :3], axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", steps, line[:-1, 6:9]).min() > 0.97  # a chord against the tangent at its end
    assert np.ptp(frames[-1][:, 3:6], axis=0).max() > 0.3


def test_another_number_of_vertices_is_named_with_its_frame():
    scene, _, target = press(frames=5)
    build = target.modifiers.new("Build", "BUILD")
    build.frame_start, build.frame_duration = 0, 10
    with pytest.raises(SceneError, match=r"'Ball' has \d+ vertices at frame 2 and had \d+ at the first"):
        reading_of(scene)


def test_a_scale_that_turns_it_inside_out_is_named():
    scene, _, target = press(frames=5)
    keyframe(target, "scale", {1: (1.0, 1.0, 1.0), 5: (-3.0, 1.0, 1.0)})
    scene.frame_set(1)
    with pytest.raises(SceneError, match="turns it inside out at frame"):
        reading_of(scene)


def test_sensors_that_press_are_targets_as_well():
    """tests/core/solver/test_several_sensors.py tells what they feel."""
    scene, pad, _ = press(frames=1)
    pad.palpate.presses = True
    assert [part.sensor for part in scenario_of(scene).targets] == [0, None]


def test_only_a_free_body_that_does_deform_is_warned_of():
    """A modifier that rounds the edges changes nothing over time, and is nothing to warn of."""
    cube = press_and_drop(frames=4)[-1]
    cube.modifiers.new("Bevel", "BEVEL").width = 1e-3
    assert not any("deforms" in warning for warning in reading_of(bpy.context.scene).warnings)
    wave = cube.modifiers.new("Wave", "WAVE")
    wave.height, wave.speed = 1e-3, 1e-3
    assert any("deforms while forces move it" in warning for warning in reading_of(bpy.context.scene).warnings)
