# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies in a scene: a gripper that is animated by nothing but its hand's motion and its wanted force."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, cube, grid, keyframe, save, scenario_of, scene_of

from palpate.addon.session import frame_status
from palpate.core.errors import SceneError

FRICTION = {"k": 1000.0, "cn": 10.0, "sigma0": 2000.0, "sigma1": 20.0, "mus": 0.8, "mud": 0.7}


def finger(name, side, hand):
    """A pad that closes along its own z on what lies between it and its partner."""
    pad = grid(name, (0.025 * side, 0.0, 0.02), size=0.03)
    pad.rotation_euler = (0.0, -side * np.pi / 2, 0.0)
    bpy.context.view_layer.update()
    pad.parent = hand
    pad.matrix_parent_inverse = hand.matrix_world.inverted()
    settings = pad.palpate
    settings.role, settings.body, settings.mass = "SENSOR", "DRIVEN", 0.1
    for key, value in FRICTION.items():
        setattr(settings, key, value)
    return pad


def gripper(frames=48):
    """Close until frame 24, then lift by 2 cm until frame 40."""
    scene = scene_of(frames)
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 1e-3
    bpy.ops.object.empty_add(location=(0, 0, 0.1))
    hand = bpy.context.object
    left, right = finger("Left", -1.0, hand), finger("Right", 1.0, hand)
    left.palpate.drive_control, left.palpate.drive_force = "FORCE", 4.0
    right.palpate.drive_leader = left
    table = grid("Table", (0, 0, 0), columns=10, rows=10, size=0.05)
    table.palpate.role = "PAD"
    for key, value in FRICTION.items():
        setattr(table.palpate, key, value)
    box = cube("Box", (0, 0, 0.0199), size=0.04)
    box.palpate.role, box.palpate.body, box.palpate.mass = "TARGET", "FREE", 0.1
    keyframe(hand, "location", {24: (0.0, 0.0, 0.1), 40: (0.0, 0.0, 0.12)})
    scene.frame_set(1)
    return scene, hand, left, right, box


def test_a_gripper_closes_lifts_and_is_keyframed(tmp_path):
    scene, hand, left, right, box = gripper()
    recording = baked(scene, tmp_path).recording
    total = recording.sensors["Left"].normal_force.sum(axis=1)
    assert total[23] == pytest.approx(4.0, rel=1e-3)
    assert total[-1] == pytest.approx(4.0, rel=1e-4)
    names = list(recording.body_names)
    height = recording.poses[:, names.index("Box"), 2]
    assert height[-1] - height[22] == pytest.approx(0.02, abs=1e-4)
    for frame in (1, 24, 48):  # the keyframes show what was recorded, hand and all
        scene.frame_set(frame)
        for obj in (left, right, box):
            place = obj.matrix_world.translation
            np.testing.assert_allclose(place, recording.poses[frame - 1, names.index(obj.name), :3], atol=2e-7)
    scene.frame_set(1)
    bpy.ops.palpate.bake_clear()
    assert left.animation_data is None or left.animation_data.action is None
    np.testing.assert_allclose(left.matrix_world.translation, (-0.025, 0, 0.02), atol=1e-7)


def test_playing_gives_the_bake_s_numbers(tmp_path):
    scene, _, left, _, box = gripper(frames=30)
    save(tmp_path)
    scene.frame_set(1)
    frames = {}
    for frame in range(2, 31):
        scene.frame_set(frame)
        frames[frame] = frame_status.status_of(scene).frame
    at_end = tuple(left.matrix_world.translation), tuple(box.matrix_world.translation)
    assert frames[30].sensors["Left"].normal_force.sum() == pytest.approx(4.0, rel=1e-3)
    recording = baked(scene).recording
    for frame, played in frames.items():
        assert np.array_equal(played.sensors["Left"].normal_force, recording.at(frame).sensors["Left"].normal_force)
    scene.frame_set(30)
    np.testing.assert_allclose(left.matrix_world.translation, at_end[0], atol=1e-7)
    np.testing.assert_allclose(box.matrix_world.translation, at_end[1], atol=1e-7)


def test_targets_are_keyframed_and_axes_belong_to_whom_they_are_said_to():
    scene, hand, left, right, _ = gripper(frames=5)
    hand.rotation_euler = (0.0, 0.0, np.pi / 2)
    keyframe(left.palpate, "drive_force", {1: 4.0, 5: 8.0})
    scenario = scenario_of(scene)
    body = {b.name: b for b in scenario.bodies}
    values = body["Left"].drive.target.values
    assert values[0] == 4.0 and values[-1] == 8.0 and np.all(np.diff(values) > 0)
    assert body["Left"].drive.axis.tolist() == [0.0, 0.0, 1.0]
    assert body["Right"].drive.leader == [b.name for b in scenario.bodies].index("Left")
    left.palpate.drive_axis, left.palpate.drive_space = "-X", "WORLD"
    found = scenario_of(scene).bodies[0].drive
    assert found.axis.tolist() == [-1.0, 0.0, 0.0] and found.axis_in_world
    # The hand's +x is the world's +y, in which the left finger's own -y points after the hand's turn by a quarter: its y axis
    # was the hand's y before, and its z the hand's x.
    left.palpate.drive_axis, left.palpate.drive_space = "X", "PARENT"
    found = scenario_of(scene).bodies[0].drive
    np.testing.assert_allclose(found.axis, [0.0, 0.0, 1.0], atol=1e-6)
    assert not found.axis_in_world


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda left, right, box: left.keyframe_insert("location", frame=1), "Driven body 'Left' has keyframes"),
        (lambda left, right, box: left.constraints.new("COPY_LOCATION"), "Driven body 'Left' has constraints"),
        (
            lambda left, right, box: setattr(left.palpate, "drive_sensor", box),
            "'Left' controls the force on 'Box', which is no",
        ),
        (lambda left, right, box: setattr(right.palpate, "drive_leader", box), "'Right' is coupled with 'Box', which is not"),
        (lambda left, right, box: setattr(left.palpate, "drive_leader", right), "follows a body that has no drive of its own"),
        (lambda left, right, box: setattr(box, "parent", left), "'Box' is a child of driven body 'Left'"),
    ],
)
def test_a_driven_body_that_cannot_be_is_refused_in_one_sentence(spoil, says):
    scene, _, left, right, box = gripper(frames=3)
    spoil(left, right, box)
    with pytest.raises(SceneError, match=says):
        scenario_of(scene)
