# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors on objects that something else moves: what counts is where Blender's evaluated object is."""

import bpy
import numpy as np
import pytest
from blender_scenes import ball, grid, reading_of, scenario_of, scene_of
from mathutils import Matrix

from palpate.addon.scene import participants
from palpate.addon.session import fcurves
from palpate.core.errors import SceneError
from palpate.core.solver.simulation import run

FRAMES = 7
RISE = 0.003


def raise_object(obj, moved=None, path="matrix_world"):
    """Move by 3 mm along the world's z between the first and the last frame, at constant speed, and lean by 0.1 rad.

    What moves is the object itself, or a bone of it by its matrix in the object.
    """
    moved = moved or obj
    before = getattr(moved, path).copy()
    for frame in (1, FRAMES):
        share = (frame - 1) / (FRAMES - 1)
        setattr(moved, path, Matrix.Translation((0, 0, RISE * share)) @ Matrix.Rotation(0.1 * share, 4, "Y") @ before)
        moved.keyframe_insert("location", frame=frame)
        moved.keyframe_insert("rotation_euler", frame=frame)
    for curve in fcurves.of_object(obj):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def empty():
    bpy.ops.object.empty_add()
    return bpy.context.object


def grandchild(pad):
    outer, inner = empty(), empty()
    inner.location, inner.parent = (0.1, 0.2, 0.3), outer
    bpy.context.view_layer.update()
    pad.parent, pad.matrix_parent_inverse = inner, inner.matrix_world.inverted()
    raise_object(outer)


def constrained(pad):
    carrier = empty()
    pad.constraints.new("COPY_TRANSFORMS").target = carrier
    raise_object(carrier)


def posed_bone(pad):
    """The bone itself is posed, the armature stands still."""
    bpy.ops.object.armature_add()
    rig = bpy.context.object
    bone = rig.pose.bones[0]
    pad.parent, pad.parent_type, pad.parent_bone = rig, "BONE", bone.name
    bpy.context.view_layer.update()
    pad.matrix_world = Matrix.Identity(4)
    bone.rotation_mode = "XYZ"
    raise_object(rig, bone, "matrix")


def driven_by_an_expression(pad):
    for path, index, rate in (("location", 2, RISE), ("rotation_euler", 1, 0.1)):
        pad.driver_add(path, index).driver.expression = f"{rate} * (frame - 1) / {FRAMES - 1}"


WAYS = (raise_object, grandchild, constrained, posed_bone, driven_by_an_expression)


def scene_with(way):
    scene = scene_of(FRAMES)
    pad, target = grid(), ball(location=(0.0, 0.0, 0.031), radius=0.03)
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    way(pad)
    scene.frame_set(1)
    return scene, pad


@pytest.fixture(scope="module")
def reference():
    return {}


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_whatever_moves_a_sensor_gives_the_same_forces(way, reference):
    scene, pad = scene_with(way)
    scenario = scenario_of(scene)
    motion = scenario.bodies[0].motion
    for i, frame in enumerate(range(1, FRAMES + 1)):
        scene.frame_set(frame)
        place = pad.evaluated_get(participants.depsgraph_of(scene)).matrix_world
        np.testing.assert_allclose(motion.positions[i], place.translation, atol=1e-9)
    assert motion.positions[-1, 2] == pytest.approx(RISE, abs=1e-6)
    force = run(scenario).sensors["Pad"].normal_force
    assert np.count_nonzero(force[-1]) > 5
    expected = reference.setdefault("force", force)
    # Matrices of 32 bits and more than one of them in a row: positions to 1e-7 m, against 2 mm of depth.
    np.testing.assert_allclose(force, expected, atol=2e-4 * expected.max())


def test_free_bodies_with_constraints_are_refused():
    scene, _ = scene_with(raise_object)
    free = bpy.data.objects["Ball"]
    free.palpate.body = "FREE"
    free.constraints.new("COPY_LOCATION")
    with pytest.raises(SceneError, match="Free body 'Ball' has constraints"):
        reading_of(scene)
    free.constraints[0].enabled = False
    reading_of(scene)


def test_motion_is_read_between_frames_where_that_is_asked_for():
    scene, pad = scene_with(driven_by_an_expression)
    pad.driver_remove("location", 2)
    pad.driver_add("location", 2).driver.expression = "0.001 * sin(2 * frame)"
    scene.palpate.subframes, scene.palpate.interpolation = 4, "SMOOTH"
    scene.frame_set(2, subframe=0.25)
    scenario = scenario_of(scene)
    assert (scene.frame_current, scene.frame_subframe) == (2, 0.25)
    assert scenario.interpolation == "smooth"
    motion = scenario.bodies[0].motion
    assert len(motion.times) == 4 * (FRAMES - 1) + 1
    frames = 1 + motion.times * scenario.fps
    np.testing.assert_allclose(motion.positions[:, 2], 0.001 * np.sin(2 * frames), atol=1e-9)
    assert len(run(scenario).frames) == FRAMES
