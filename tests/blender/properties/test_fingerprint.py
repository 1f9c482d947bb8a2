# SPDX-License-Identifier: GPL-3.0-or-later
"""A new property of an object or a scene must be in the fingerprint that makes a bake stale, or be known to change no force."""

import inspect
import re

import bpy
import pytest

from palpate.addon.scene import drives, scene_fingerprint

OBJECT_WITHOUT_FORCES = {
    *("schema_version", "uid", "measured", "made_vertices", "skin", "is_baked", "made_action", "bake_folder"),
    *("has_start", "start_matrix", "start_channels"),
}
"""Properties of an object that change no force: identity, file names, and what laying texels or a bake has left."""
COMPARED_BY_COMPONENT = {"velocity", "angular_velocity", "effects"}
"""Read component by component in `settings_of`."""
NOT_COMPARED = set(drives.TARGET_PROPERTIES.values())
"""Targets of drives change forces and are in no fingerprint: a bake stays fresh when they change. Comparing them would make
every existing bake with a driven body stale."""
SCENE_WITHOUT_FORCES = {
    *("schema_version", "folder", "use_live", "figures", "baked_digest", "baked_fingerprint", "baked_shapes"),
    *("baked_start", "baked_end", "show_texels", "show_normals", "show_numbers", "show_reach", "show_overlay", "show_inset"),
    *("color_map", "use_auto_range", "quantity", "range_max_pressure", "range_max", "overlays", "texel_arrow_scale"),
    *("use_auto_arrow", "arrow_scale"),
}
"""Properties of a scene that change no force: how results are shown, where they are written, and what a bake has left."""


@pytest.fixture
def settings():
    bpy.ops.mesh.primitive_plane_add()
    return bpy.context.object.palpate


def own_properties(settings) -> set[str]:
    return {item.identifier for item in settings.bl_rna.properties} - {"rna_type", "name"}


def test_every_property_of_an_object_is_in_the_fingerprint_or_changes_no_force(settings):
    compared = {*scene_fingerprint.OBJECT_PROPERTIES} | COMPARED_BY_COMPONENT
    assert own_properties(settings) == compared | NOT_COMPARED | OBJECT_WITHOUT_FORCES
    assert not compared & OBJECT_WITHOUT_FORCES


def test_every_property_of_a_scene_is_in_the_fingerprint_or_changes_no_force():
    compared = set(re.findall(r"\bown\.(\w+)", inspect.getsource(scene_fingerprint.settings_of)))
    assert own_properties(bpy.context.scene.palpate) == compared | SCENE_WITHOUT_FORCES
    assert not compared & SCENE_WITHOUT_FORCES
