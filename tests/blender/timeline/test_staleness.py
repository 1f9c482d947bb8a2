# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake says when it is out of date, whatever has changed; and playing gives its numbers, however finely motion is read."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, ball, keyframe, play_to, press, press_and_drop, reopen, save

from palpate.addon.session import fcurves, frame_status

FRESH, STALE = "Frame {} of the bake.", "The scene has changed since this bake. Bake again."


def bent(scene, target):
    """Give the target everything that can change its shape."""
    target.modifiers.new("Cast", "CAST").factor = 0.1
    target.shape_key_add(name="Basis")
    key = target.shape_key_add(name="Bump")
    for i in range(0, len(key.data), 3):
        key.data[i].co *= 1.05
    keyframe(key, "value", {1: 0.0, 6: 0.5})
    scene.frame_set(1)


@pytest.fixture(scope="module")
def bent_blend(blender, tmp_path_factory):
    """A scene with a ball that bends and a pad with a modifier that keeps its vertices, baked and saved."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene, pad, target = press(frames=6)
    bent(scene, target)
    pad.modifiers.new("Wave", "CAST").factor = 0.0
    scene.collection.objects.link(bpy.data.objects.new("Arm", None))
    target.parent = bpy.data.objects["Arm"]
    return baked_file(scene, tmp_path_factory.mktemp("bent"))[0]


@pytest.fixture
def shown(bent_blend):
    return reopen(bent_blend)


def texts(scene, frames):
    found = []
    for frame in frames:
        scene.frame_set(frame)
        found.append(frame_status.status_of(scene).text)
    return found


def test_nothing_changed_is_fresh_at_every_frame(shown):
    frames = (1, 2, 3, 4, 5, 6, 4, 2, 1)
    assert texts(shown, frames) == [FRESH.format(frame) for frame in frames]
    shown.frame_set(3, subframe=0.5)
    assert frame_status.status_of(shown).text == FRESH.format(3)


def bow(obj):
    """Leave the values at whole frames far from the middle of a curve alone, nearly: an ease that starts differently."""
    for curve in fcurves.of_object(obj):
        for point in curve.keyframe_points:
            point.interpolation = "QUAD"


CHANGES = {
    "parameter": lambda pad, ball: setattr(pad.palpate, "k", 99.0),
    "region": lambda pad, ball: setattr(pad.palpate, "region", "GROUP"),
    "gravity": lambda pad, ball: setattr(bpy.context.scene, "gravity", (0.0, 0.0, -1.6)),
    "vertex": lambda pad, ball: (setattr(pad.data.vertices[5].co, "z", 0.01), pad.data.update()),
    "location": lambda pad, ball: setattr(pad.location, "z", 0.001),
    "no animation": lambda pad, ball: ball.animation_data_clear(),
    "no target": lambda pad, ball: bpy.data.objects.remove(ball),
    "modifier of a target": lambda pad, ball: setattr(ball.modifiers["Cast"], "factor", 0.2),
    "modifier of a sensor": lambda pad, ball: setattr(pad.modifiers["Wave"], "factor", 0.1),
    "modifier switched off": lambda pad, ball: setattr(ball.modifiers["Cast"], "show_viewport", False),
    "shape key": lambda pad, ball: setattr(ball.data.shape_keys.key_blocks["Bump"].data[0], "co", (0.0, 0.0, 0.01)),
    "scale": lambda pad, ball: setattr(ball, "scale", (1.0, 1.0, 1.01)),
    "scale of a parent": lambda pad, ball: setattr(ball.parent, "scale", (1.01, 1.01, 1.01)),
    "interpolation": lambda pad, ball: bow(ball),
    "key in between": lambda pad, ball: ball.keyframe_insert("location", frame=2.5),
    "samples per frame": lambda pad, ball: setattr(bpy.context.scene.palpate, "subframes", 4),
    "effect": lambda pad, ball: bpy.ops.palpate.effect_add(effect="offset"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_is_noticed_at_whatever_frame_is_shown_next(shown, change):
    pad, target = bpy.data.objects["Pad"], bpy.data.objects["Ball"]
    bpy.context.view_layer.objects.active = pad
    shown.frame_set(4)
    CHANGES[change](pad, target)
    bpy.context.view_layer.update()
    assert texts(shown, [5, 2]) == [STALE, STALE]
    assert frame_status.status_of(shown).frame is not None  # it is still shown


@pytest.mark.parametrize("renamed", ["Pad", "Ball"])
def test_a_new_name_alone_leaves_a_bake_fresh(shown, renamed, bent_blend):
    bpy.data.objects[renamed].name = "Renamed"
    assert texts(shown, [2, 5]) == [FRESH.format(2), FRESH.format(5)]
    shown = reopen(save(bent_blend.parent, f"{renamed}.blend"))
    assert texts(shown, [3]) == [FRESH.format(3)]
    bpy.data.objects["Arm"].scale = (1.01, 1.01, 1.01)
    bpy.context.view_layer.update()
    assert texts(shown, [4]) == [STALE]  # the renamed object is still watched


def test_a_duplicate_with_the_old_name_makes_a_bake_out_of_date_until_it_is_deleted(shown):
    target = bpy.data.objects["Ball"]
    copy = target.copy()
    shown.collection.objects.link(copy)
    target.name, copy.name = "Old", "Ball"
    bpy.context.view_layer.update()
    assert texts(shown, [3]) == [STALE]
    bpy.data.objects.remove(copy)
    assert texts(shown, [4]) == [FRESH.format(4)]


def keyed(owner, path, index=-1):
    """Keep a property as it is, by keyframes that say so."""
    for frame in (1, 3, 4, 5):
        owner.keyframe_insert(path, index=index, frame=frame)


@pytest.fixture(scope="module")
def hung_blend(blender, tmp_path_factory):
    """A baked scene whose ball hangs on others, all of which have keyframes and stay where they are."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene, pad, target, *_ = press_and_drop(frames=8)
    others = {name: bpy.data.objects.new(name, None) for name in ("Leader", "Source", "Far", "Strips", "Nodes")}
    others["Cage"] = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
    for other in others.values():
        scene.collection.objects.link(other)
        keyed(other, "location")
    constraint = target.constraints.new("COPY_LOCATION")
    constraint.target, constraint.use_offset = others["Leader"], True
    others["Leader"].parent = others["Far"]
    target.modifiers.new("Cage", "LATTICE").object = others["Cage"]
    target.shape_key_add(name="Basis")
    key = target.shape_key_add(name="Bump")
    key.data[0].co.z += 0.001
    keyed(key, "value")
    driver = target.driver_add("delta_location", 0).driver
    driver.type = "SUM"
    driver.variables.new().targets[0].id = others["Source"]
    driver.variables[0].targets[0].data_path = "location.x"
    target.driver_add("delta_location", 1).driver.expression = "0.0 * frame"
    data = others["Strips"].animation_data
    action, data.action = data.action, None
    data.nla_tracks.new().strips.new("Strip", 1, action)
    target.parent = others["Strips"]
    group = bpy.data.node_groups.new("Group", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    for name in ("Geometry", "Object"):
        group.interface.new_socket(name, in_out="INPUT", socket_type=f"NodeSocket{name}")
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    modifier = target.modifiers.new("Nodes", "NODES")
    modifier.node_group = group
    socket = group.interface.items_tree["Object"].identifier
    if hasattr(modifier, "properties"):  # Blender 5.2
        getattr(modifier.properties.inputs, socket).value = others["Nodes"]
    else:
        modifier[socket] = others["Nodes"]
    scene.frame_set(1)
    return baked_file(scene, tmp_path_factory.mktemp("hung"))[0]


@pytest.fixture
def hung(hung_blend):
    return reopen(hung_blend)


def moved_at_4(owner):
    """Change what keyframes say at frame 4, and nowhere else but around it."""
    curve = fcurves.of_object(owner)[0]
    point = next(point for point in curve.keyframe_points if round(point.co.x) == 4)
    point.co.y += 0.001
    curve.update()


def shaken():
    modifier = fcurves.of_object(bpy.data.objects["Ball"])[0].modifiers.new("NOISE")
    modifier.use_restricted_range, modifier.frame_start, modifier.frame_end = True, 3.0, 5.0


ELSEWHERE = {
    "target of a constraint": lambda ball: moved_at_4(bpy.data.objects["Leader"]),
    "parent of that": lambda ball: moved_at_4(bpy.data.objects["Far"]),
    "object of a modifier": lambda ball: moved_at_4(bpy.data.objects["Cage"]),
    "object of Geometry Nodes": lambda ball: moved_at_4(bpy.data.objects["Nodes"]),
    "what a driver reads": lambda ball: moved_at_4(bpy.data.objects["Source"]),
    "shape key": lambda ball: moved_at_4(ball.data.shape_keys),
    "driver": lambda ball: setattr(ball.animation_data.drivers[1].driver, "expression", "0.001 * (frame == 4)"),
    "F-curve modifier": lambda ball: shaken(),
    "strip": lambda ball: setattr(ball.parent.animation_data.nla_tracks[0].strips[0], "scale", 1.5),
}


@pytest.mark.parametrize("change", [None, *ELSEWHERE])
def test_a_change_at_other_frames_is_noticed_too(hung, change):
    hung.frame_set(7)
    if change is not None:
        ELSEWHERE[change](bpy.data.objects["Ball"])
        bpy.context.view_layer.update()
    expected = [FRESH.format(6), FRESH.format(8)] if change is None else [STALE, STALE]
    assert texts(hung, [6, 8]) == expected


def test_a_target_that_is_a_curve_is_watched(tmp_path):
    scene, pad, target = press(frames=3)
    bpy.ops.curve.primitive_bezier_circle_add(radius=0.005, location=(0.01, 0.0, 0.002))
    ring = bpy.context.object
    ring.data.bevel_depth, ring.palpate.role = 0.002, "TARGET"
    baked(scene, tmp_path)
    assert texts(scene, [1, 2]) == [FRESH.format(1), FRESH.format(2)]
    ring.data.bevel_depth = 0.003
    bpy.context.view_layer.update()
    assert texts(scene, [3]) == [STALE]


@pytest.mark.parametrize("stretched", [False, True])
@pytest.mark.parametrize("bends", [False, True])
def test_playing_reads_between_frames_as_a_bake_does(tmp_path, stretched, bends):
    scene, pad, target, *_ = press_and_drop(frames=6)
    extra = ball("Tip", location=(0.012, 0.0, 0.0075), radius=0.008)  # turns fast: its way between frames is no straight line
    extra.palpate.role, extra.rotation_mode = "TARGET", "XYZ"
    arm = bpy.data.objects.new("Arm", None)
    scene.collection.objects.link(arm)
    extra.parent = arm
    keyframe(arm, "rotation_euler", {1: (0.0, 0.0, 0.0), 6: (0.0, 0.0, 6.0)})
    if bends:
        bent(scene, target)
    scene.palpate.subframes, scene.palpate.interpolation = 3, "SMOOTH"
    if stretched:
        scene.render.frame_map_old, scene.render.frame_map_new = 100, 200
    scene.frame_set(1)
    last = 12 if stretched else 6
    played = dict(play_to(scene, last).frames)
    assert scene.frame_current == last and scene.frame_subframe == 0.0
    bpy.ops.palpate.reset()
    recording = baked(scene, tmp_path).recording
    felt = recording.sensors["Pad"].normal_force
    assert felt[-1].max() > 0
    for number in range(2 if stretched else 1, 7):
        np.testing.assert_allclose(played[number].sensors["Pad"].normal_force, felt[number - 1], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(played[number].poses, recording.poses[number - 1], rtol=1e-9, atol=1e-12)
