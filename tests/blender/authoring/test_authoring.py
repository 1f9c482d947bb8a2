# SPDX-License-Identifier: GPL-3.0-or-later
"""Making sensors, targets and pads: from a selection, a painted group or a whole mesh, and back by undo."""

import bpy
import pytest
from blender_scenes import ball, changes, choose, dump, grid, pad_sensor, select


def members(obj, name):
    index = obj.vertex_groups[name].index
    return {v.index for v in obj.data.vertices for g in v.groups if g.group == index and g.weight >= 0.5}


def test_whole_mesh():
    pad = grid()
    assert bpy.ops.palpate.sensor_add() == {"FINISHED"}
    assert (pad.palpate.role, pad.palpate.region) == ("SENSOR", "MESH")
    assert pad.palpate.uid and pad.palpate.schema_version == 1
    assert not pad.vertex_groups


def test_selection_becomes_a_vertex_group():
    pad = grid()
    chosen = {0, 1, 2, 6, 7, 8, 12, 13, 14}
    select(pad, chosen)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.palpate.sensor_add() == {"FINISHED"}
    assert pad.mode == "OBJECT"
    assert (pad.palpate.role, pad.palpate.region, pad.palpate.vertex_group) == ("SENSOR", "GROUP", "Palpate Sensor")
    assert members(pad, "Palpate Sensor") == chosen


def test_a_second_selection_replaces_the_first():
    pad = grid()
    for chosen in ({0, 1, 6, 7}, {1, 2, 7, 8}):
        select(pad, chosen)
        bpy.ops.palpate.sensor_add(source="SELECTION")
    assert members(pad, "Palpate Sensor") == {1, 2, 7, 8}
    assert len(pad.vertex_groups) == 1


def test_nothing_selected_in_edit_mode_means_the_whole_mesh():
    pad = grid()
    select(pad, ())
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.palpate.sensor_add()
    assert pad.palpate.region == "MESH"


def test_the_painted_group():
    pad = grid()
    assert bpy.ops.palpate.weight_paint() == {"FINISHED"}
    assert pad.mode == "WEIGHT_PAINT"
    assert (pad.palpate.role, pad.palpate.region) == ("SENSOR", "GROUP")
    group = pad.vertex_groups.active
    assert group.name == pad.palpate.vertex_group
    group.add([0, 1, 6, 7], 0.8, "REPLACE")
    group.add([8], 0.3, "REPLACE")  # below the threshold
    assert bpy.ops.palpate.sensor_add() == {"FINISHED"}
    assert pad.palpate.vertex_group == group.name
    assert members(pad, group.name) == {0, 1, 6, 7}


def test_pad_and_target():
    pad, other, third = grid(), ball(), ball("Other")
    choose(third, other)
    bpy.ops.palpate.role_set(role="TARGET")
    assert (pad.palpate.role, other.palpate.role, third.palpate.role) == ("NONE", "TARGET", "TARGET")
    bpy.context.view_layer.objects.active = pad
    bpy.ops.palpate.sensor_add(role="PAD")
    assert pad.palpate.role == "PAD"
    bpy.ops.palpate.sensor_remove()
    assert pad.palpate.role == "NONE"


def test_a_role_set_by_a_script_is_enough():
    pad = grid()
    pad.palpate.role = "SENSOR"
    assert len(pad.palpate.uid) == 32


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT", "WEIGHT_PAINT"])
def test_undo_restores_the_object_exactly(mode):
    pad = grid()
    pad.data.uv_layers.new(name="Mine")
    pad.data.materials.append(bpy.data.materials.new("Rubber"))
    pad.vertex_groups.new(name="Before").add([0, 1, 6, 7], 1.0, "REPLACE")
    select(pad, {0, 1, 2, 6, 7, 8})
    bpy.ops.ed.undo_push(message="made")
    if mode != "OBJECT":
        bpy.ops.object.mode_set(mode=mode)
        bpy.ops.ed.undo_push(message="mode")
    before = dump()
    assert bpy.ops.palpate.sensor_add("EXEC_DEFAULT", True) == {"FINISHED"}
    pad = bpy.data.objects["Pad"]
    assert pad.palpate.role == "SENSOR"
    assert changes(before, dump())
    bpy.ops.ed.undo()
    pad = bpy.data.objects["Pad"]
    assert pad.mode == mode
    if mode == "EDIT":
        pad.update_from_editmode()
    assert changes(before, dump()) == []
    bpy.ops.ed.redo()
    assert bpy.data.objects["Pad"].palpate.role == "SENSOR"


def test_poll_says_no_without_a_mesh():
    bpy.context.view_layer.objects.active = None
    assert not bpy.ops.palpate.sensor_add.poll()
    bpy.ops.object.empty_add()
    assert not bpy.ops.palpate.sensor_add.poll()
    assert not bpy.ops.palpate.bake.poll()
    assert not bpy.ops.palpate.bake_clear.poll()
    bpy.ops.curve.primitive_bezier_circle_add()
    assert not bpy.ops.palpate.sensor_add.poll()
    assert bpy.ops.palpate.role_set.poll()  # a curve can press, not feel


@pytest.mark.parametrize(("size", "expected"), [(2.0, 0.1), (0.2, 0.012), (0.05, 0.012), (0.01, 0.003)])
def test_the_maximum_penetration_follows_the_size_of_the_region(size, expected):
    assert pad_sensor(size=size).palpate.max_penetration == pytest.approx(expected)


def test_a_maximum_penetration_that_was_set_stays():
    pad = grid(size=2.0)
    pad.palpate.max_penetration = 0.012
    bpy.ops.palpate.sensor_add()
    bpy.ops.palpate.probe_add()
    assert pad.palpate.max_penetration == pytest.approx(0.012)


def test_a_painted_region_has_its_size_when_it_is_probed():
    pad = grid(columns=41, rows=41, size=2.0)
    pad.scale = 0.5, 0.5, 0.5
    bpy.context.scene.unit_settings.scale_length = 0.8
    bpy.ops.palpate.weight_paint()
    bpy.ops.object.mode_set(mode="OBJECT")
    corner = [v.index for v in pad.data.vertices if max(v.co.xy) < 0.0]
    pad.vertex_groups["Palpate Sensor"].add(corner, 1.0, "REPLACE")
    assert pad.palpate.max_penetration == pytest.approx(0.012)
    bpy.ops.palpate.probe_add()
    assert pad.palpate.max_penetration == pytest.approx(0.02)  # a twentieth of 0.95 × 0.5 × 0.8 m
