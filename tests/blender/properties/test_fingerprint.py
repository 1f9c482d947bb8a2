# SPDX-License-Identifier: GPL-3.0-or-later
"""A new property of an object or a scene must be in the fingerprint that makes a bake stale, or be known to change no force."""

import inspect
import re

import bpy
import pytest

from palpate.addon.properties import scene_properties
from palpate.addon.properties.scene_units import ENDING
from palpate.addon.scene import moved_bodies, scene_fingerprint

OBJECT_WITHOUT_FORCES = {
    *("schema_version", "uid", "measured", "made_vertices", "skin", "is_baked", "made_action", "bake_folder", "tactile_images"),
    *("has_start", "start_matrix", "start_channels"),
}
"""Properties of an object that change no force: identity, file names, and what laying texels or a bake has left."""
COMPARED_BY_COMPONENT = {"velocity", "angular_velocity", "effects", "readout", "magnetic"}
"""Read component by component in `settings_of`."""
COMPARED_WHEN_DRIVEN = set(moved_bodies.TARGET_PROPERTIES.values())
"""Targets of drives: the one that the drive follows is compared, with its keyframes."""
SCENE_WITHOUT_FORCES = {
    *("schema_version", "folder", "use_live", "figures", "baked_digest", "baked_fingerprint", "baked_shapes", "baked_names"),
    *("baked_start", "baked_end", "show_texels", "show_normals", "show_numbers", "show_reach", "show_overlay", "show_inset"),
    *("color_map", "use_auto_range", "quantity", "overlays", "texel_arrow_scale"),
    *("use_auto_arrow", "arrow_scale", "scene_id", "baked_id", "unchanged_note", "study"),
    *("show_indentation", "indentation_factor", "show_through", *scene_properties._ranges()),
}
"""Properties of a scene that change no force: how results are shown, where they are written, and what a bake has left."""


def own_properties(settings) -> set[str]:
    """Return the properties, but not those that only show another in the scene's units."""
    found = {item.identifier for item in settings.bl_rna.properties} - {"rna_type", "name"}
    shown = {name for name in found if name.endswith(ENDING)}
    assert {name.removesuffix(ENDING) for name in shown} < found
    return found - shown


def test_every_property_of_an_object_is_in_the_fingerprint_or_changes_no_force(settings):
    compared = {*scene_fingerprint.OBJECT_PROPERTIES} | COMPARED_BY_COMPONENT
    assert own_properties(settings) == compared | COMPARED_WHEN_DRIVEN | OBJECT_WITHOUT_FORCES
    assert not compared & OBJECT_WITHOUT_FORCES


def test_every_property_of_a_scene_is_in_the_fingerprint_or_changes_no_force():
    compared = set(re.findall(r"\bown\.(\w+)", inspect.getsource(scene_fingerprint.settings_of)))
    assert own_properties(bpy.context.scene.palpate) == compared | SCENE_WITHOUT_FORCES
    assert not compared & SCENE_WITHOUT_FORCES


@pytest.mark.parametrize("control, path", moved_bodies.TARGET_PROPERTIES.items())
def test_the_target_of_a_drive_is_compared_where_the_drive_follows_it(settings, control, path):
    obj, scene = settings.id_data, bpy.context.scene
    settings.role, settings.body, settings.mass = "TARGET", "DRIVEN", 1.0
    settings.drive_control = control
    found = [scene_fingerprint.fingerprint(scene)]

    def check(is_changed):
        found.append(scene_fingerprint.fingerprint(scene))
        assert (found[-1] != found[-2]) == is_changed

    setattr(settings, path, 0.25)
    check(True)
    other = next(name for name in moved_bodies.TARGET_PROPERTIES.values() if name != path)
    setattr(settings, other, 0.5)
    check(False)
    settings.keyframe_insert(path, frame=1)
    check(True)
    setattr(settings, path, 0.75)  # the keyframe decides
    check(False)
    settings.keyframe_insert(path, frame=9)
    check(True)
    obj.keyframe_insert("location", frame=3)  # as the bake of a driven body does
    check(False)
    bpy.ops.mesh.primitive_cube_add()
    leader = bpy.context.object
    leader.palpate.role, leader.palpate.body, leader.palpate.mass = "TARGET", "DRIVEN", 1.0
    settings.drive_leader = leader
    check(True)
    settings.keyframe_insert(path, frame=20)  # the leader's drive moves it
    check(False)


def test_the_target_of_a_drive_counts_in_strips_too(settings):
    obj, scene = settings.id_data, bpy.context.scene
    settings.role, settings.body, settings.mass, settings.drive_control = "TARGET", "DRIVEN", 1.0, "FORCE"
    settings.keyframe_insert("drive_force", frame=1)
    data = obj.animation_data
    strip = data.nla_tracks.new().strips.new("Grip", 1, data.action)
    data.action = None
    before = scene_fingerprint.fingerprint(scene)
    settings.drive_force = 3.0  # the strip decides
    assert scene_fingerprint.fingerprint(scene) == before
    strip.frame_start_ui += 2.0
    assert scene_fingerprint.fingerprint(scene) != before


def test_without_a_drive_the_fingerprint_is_that_of_earlier_versions(scene, settings, monkeypatch):
    settings.role, settings.body, settings.mass = "TARGET", "FREE", 1.0
    settings.keyframe_insert("drive_force", frame=1)
    found = scene_fingerprint.fingerprint(scene)
    settings.drive_force, settings.drive_speed, settings.drive_position = 1.0, 2.0, 3.0
    settings.keyframe_insert("drive_force", frame=5)
    assert scene_fingerprint.fingerprint(scene) == found
    monkeypatch.setattr(scene_fingerprint, "_constant_drive_target", lambda obj: "")
    assert scene_fingerprint.fingerprint(scene) == found
