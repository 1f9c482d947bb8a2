# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene › New › Full Copy of a baked scene: the copy's bake and its removal leave no copied arrow; the original stays whole."""

import bpy
import pytest
from blender_scenes import find_marker, press, save

from palpate.addon.display import markers

ALL = {"FORCE", "TORQUE", "CENTRE", "SLIP", "NORMALS", "SHEARS"}


@pytest.fixture
def scenes(tmp_path):
    """Return a baked scene with every marker, and its full copy."""
    original, *_ = press(frames=3)
    original.palpate.overlays = ALL
    save(tmp_path)
    assert bpy.ops.palpate.bake() == {"FINISHED"}
    bpy.ops.scene.new(type="FULL_COPY")
    return original, bpy.context.scene


def marker_names(scene):
    return sorted(obj.name for obj in scene.objects if markers.KIND_KEY in obj)


def owners(scene):
    return {obj[markers.materials.SENSOR_KEY] for obj in scene.objects if markers.KIND_KEY in obj}


def test_a_bake_of_a_full_copy_replaces_the_copied_markers(scenes):
    original, copy = scenes
    before = marker_names(original)
    assert bpy.ops.palpate.bake() == {"FINISHED"}
    assert len(marker_names(copy)) == len(ALL) and owners(copy) == {copy.objects["Pad.001"].palpate.uid}
    assert marker_names(original) == before and owners(original) == {original.objects["Pad"].palpate.uid}


@pytest.mark.parametrize("bakes", [0, 1])
def test_clear_bake_of_a_full_copy_removes_every_marker_of_it(scenes, bakes):
    original, copy = scenes
    before = marker_names(original)
    for _ in range(bakes):
        bpy.ops.palpate.bake()
    assert bpy.ops.palpate.bake_clear() == {"FINISHED"}
    assert marker_names(copy) == [] and not copy.objects["Pad.001"].palpate.is_baked
    assert marker_names(original) == before and original.objects["Pad"].palpate.is_baked


def test_a_bake_removes_copies_of_its_own_markers(scenes):
    original, _ = scenes
    bpy.context.window.scene = original
    arrow = find_marker(original.objects, original.objects["Pad"].palpate.uid, "FORCE")
    original.collection.objects.link(arrow.copy())
    assert len(marker_names(original)) == len(ALL) + 1
    assert bpy.ops.palpate.bake() == {"FINISHED"}
    assert len(marker_names(original)) == len(ALL)
