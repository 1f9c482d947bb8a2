# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of other versions of Palpate: older ones find their bakes, newer ones are left alone and it is said."""

import bpy
import pytest
from blender_scenes import press, raw_settings, reopen, save

from palpate.addon.properties import migrations
from palpate.addon.properties.migrations import VERSION
from palpate.addon.session import session_state
from palpate.core.io.hidden_folder import lock_folder


def test_a_newer_file_is_left_alone_and_it_is_said(tmp_path):
    _, pad, _ = press()
    raw_settings(pad)["schema_version"], raw_settings(pad)["k"] = VERSION + 5, 77.0
    reopen(save(tmp_path))
    assert bpy.data.objects["Pad"].palpate.k == 77.0
    assert bpy.data.objects["Pad"].palpate.schema_version == VERSION + 5
    assert session_state.session.unreadable_settings["Pad"].startswith("The settings of 'Pad' were saved by a newer Palpate")
    bpy.ops.wm.read_homefile(use_empty=True)
    assert session_state.session.unreadable_settings == {}


@pytest.mark.enabling
def test_a_file_that_is_open_when_the_add_on_is_enabled_is_looked_through_as_well(tmp_path):
    """At the first event, since Blender allows nothing while it enables an add-on."""
    _, pad, _ = press()
    raw_settings(pad)["schema_version"] = VERSION + 5
    path = save(tmp_path)
    bpy.ops.preferences.addon_disable(module="palpate")
    reopen(path)
    bpy.ops.preferences.addon_enable(module="palpate")
    assert session_state.session.unreadable_settings == {}
    bpy.data.objects["Pad"].location.x += 0.001
    bpy.context.view_layer.update()
    assert "newer Palpate" in session_state.session.unreadable_settings["Pad"]


def test_todays_settings_are_not_touched(tmp_path):
    _, pad, _ = press()
    before = raw_settings(pad).to_dict()
    assert before["schema_version"] == VERSION
    migrations.apply()
    assert raw_settings(pad).to_dict() == before


def test_an_older_file_finds_its_bake(tmp_path):
    """Before, the default folder of bakes was palpate/ beside the file; what was baked there is found and replaced there."""
    scene, _, _ = press()
    path = save(tmp_path)
    scene.palpate.folder = "//palpate"
    bpy.ops.palpate.bake()
    scene.palpate.property_unset("folder")  # as an older version saved it: the default of its own
    scene.palpate.property_unset("schema_version")
    bpy.ops.wm.save_mainfile()
    assert reopen(path).palpate.folder == "//palpate"
    bpy.ops.palpate.bake()
    assert sorted(one.name for one in tmp_path.iterdir() if one.is_dir()) == ["palpate"]


def test_an_unfinished_bake_of_an_older_version_goes_on_in_its_folder(tmp_path):
    assert reopen(save_scene_with(tmp_path / "old", private_folder=True)).palpate.folder == "//palpate"


def test_a_package_beside_the_file_is_no_bake(tmp_path):
    """A folder called palpate that holds no bake, as a checkout of Palpate, is left alone."""
    assert reopen(save_scene_with(tmp_path / "new", private_folder=False)).palpate.folder == "//palpate-bake"
    bpy.ops.palpate.bake()
    assert reopen(save(tmp_path / "new")).palpate.folder == "//palpate-bake"


def save_scene_with(folder, private_folder):
    """Save a scene that was never baked beside a folder called palpate."""
    press()
    (folder / "palpate").mkdir(parents=True)
    if private_folder:
        lock_folder(folder / "palpate").release()
    return save(folder)
