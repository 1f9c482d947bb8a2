# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown is looked at again when something else than the frame changes: no old number stays unmarked."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, choose, keyframe, play_to, press, press_and_drop
from mathutils import Vector

from palpate.addon.authoring import sensor_report
from palpate.addon.display import overlays
from palpate.addon.session import frame_status
from palpate.addon.timeline import live_cache, playback, second_look


@pytest.fixture(autouse=True)
def forget(monkeypatch):
    """Frames are computed at once however busy the machine is; nothing of a test is left to the next one."""
    monkeypatch.setattr(second_look, "QUICK", 60.0)
    yield
    second_look.stop()


def test_a_bake_is_out_of_date_at_once(tmp_path):
    """After any change of those in test_staleness.py."""
    scene, pad, target = press(frames=4)
    baked(scene, tmp_path)
    scene.frame_set(2)
    second_look.look_again(scene)
    assert frame_status.status_of(scene).text == "Frame 2 of the bake."
    pad.palpate.k *= 2
    second_look.look_again(scene)
    assert "The scene has changed since this bake" in frame_status.status_of(scene).text and scene.frame_current == 2


def test_a_renamed_sensor_takes_numbers_and_arrows_along(tmp_path):
    scene, pad, _ = press(frames=4)
    baked(scene, tmp_path)
    scene.frame_set(4)
    for name in ("Skin", "Palm"):
        pad.name = name
        second_look.look_again(scene)
        assert set(frame_status.status_of(scene).frame.sensors) == {name}
        assert f"Net Force {name}" in scene.objects
    scene.objects["Net Force Palm"].name = "My arrow"
    pad.name = "Pad"
    second_look.look_again(scene)
    assert "My arrow" in scene.objects and "Net Force Pad" not in scene.objects


@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("is_reported_first", [False, True], ids=["", "its report comes first"])
def test_a_duplicate_of_a_baked_sensor_is_not_baked(tmp_path, linked, is_reported_first):
    scene, pad, _ = press(frames=4)
    baked(scene, tmp_path)
    scene.frame_set(4)
    choose(pad)
    shown = [slot.material for slot in pad.material_slots]
    assert any(shown)
    bpy.ops.object.duplicate(linked=linked)
    copy = bpy.context.object
    if is_reported_first:  # drawing the panel requests a report, which may be computed first
        sensor_report.fresh_report(copy, scene)
    second_look.look_again(scene)
    assert copy.palpate.is_baked == linked  # a linked duplicate shows the heat map of the shared mesh
    assert pad.palpate.is_baked and pad.palpate.bake_folder and "Net Force Pad" in scene.objects
    assert copy.palpate.uid != pad.palpate.uid or linked
    assert [slot.material for slot in pad.material_slots] == shown
    assert "Pad" in frame_status.status_of(scene).frame.sensors
    baked(scene)
    assert copy.palpate.is_baked and set(frame_status.status_of(scene).frame.sensors) == {"Pad", "Pad.001"}


def test_a_baked_file_that_was_opened_shows_its_numbers_and_warnings_at_once(tmp_path):
    scene, pad, _ = press(frames=8)
    pad.palpate.max_penetration = 0.0003
    baked(scene, tmp_path)
    scene.frame_set(2)
    assert "maximum penetration" in frame_status.status_of(scene).warnings
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    second_look.look_again(bpy.context.scene)
    status = frame_status.status_of(bpy.context.scene)
    assert status.text == "Frame 2 of the bake." and "Pad" in status.frame.sensors
    assert "maximum penetration" in status.warnings


def test_a_slider_gives_the_numbers_of_playing_anew():
    scene, pad, *_ = press_and_drop(frames=6)
    play_to(scene, 5)
    soft = frame_status.status_of(scene).frame.sensors["Pad"].normal_force
    pad.palpate.k *= 2
    second_look.look_again(scene)
    hard = frame_status.status_of(scene).frame.sensors["Pad"].normal_force
    assert scene.frame_current == 5 and hard.sum() > 1.5 * soft.sum()
    play_to(scene, 5)
    np.testing.assert_array_equal(live_cache.get(scene).frames[5].sensors["Pad"].normal_force, hard)


def test_what_would_take_long_is_computed_later_and_after_each_change(monkeypatch):
    """The window computes it once nothing changes for a while, as after a jump; see tests/ui."""
    monkeypatch.setattr(second_look, "QUICK", 0.0)
    later = []
    monkeypatch.setattr(second_look, "compute_later", lambda: later.append(True))
    scene, pad, *_ = press_and_drop(frames=6)
    play_to(scene, 5)
    pad.palpate.k *= 2
    second_look.look_again(scene)
    status = frame_status.status_of(scene)
    assert status.frame is None and status.text.startswith(("Out of date", "Frame 5 is not computed"))
    assert live_cache.get(scene) is None and scene.frame_current == 5 and later == [True]
    second_look.look_again(scene)  # a change while it was computed has dropped it again
    assert later == [True, True]
    job = playback.compute_to_present_frame(scene)
    next(job), next(job)
    job.close()  # stopped by the user: it does not begin again by itself
    second_look.look_again(scene)
    assert later == [True, True] and frame_status.status_of(scene).frame is None
    pad.palpate.k *= 2
    second_look.look_again(scene)
    assert later == [True, True, True]
    bpy.ops.palpate.catch_up()
    second_look.look_again(scene)
    assert later == [True, True, True] and frame_status.status_of(scene).frame.frame == 5


def test_what_is_computed_later_waits_for_the_users_hands(monkeypatch):
    begun = []
    monkeypatch.setattr(playback, "offer_to_compute", lambda: begun.append(True))
    monkeypatch.setattr(second_look, "_user_is_busy", lambda: True)  # an object is being moved
    assert second_look._compute_missing() == second_look.PAUSE and begun == []
    monkeypatch.setattr(second_look, "_user_is_busy", lambda: False)
    assert second_look._compute_missing() is None and begun == [True]


def test_a_change_where_nothing_is_computed_yet_computes_nothing(monkeypatch):
    """As after a jump to frame 90,000 that the user has stopped, to go on with his work there."""
    later = []
    monkeypatch.setattr(second_look, "compute_later", lambda: later.append(True))
    scene, pad, _ = press(frames=9)
    play_to(scene, 2)
    scene.frame_set(8)
    pad.palpate.k *= 2
    second_look.look_again(scene)
    assert later == [] and frame_status.status_of(scene).frame is None


@pytest.mark.parametrize("is_keyframed", [True, False])
def test_what_is_moved_with_a_keyframe_or_has_none_is_computed_again(is_keyframed):
    scene, pad, target = press(frames=6)
    play_to(scene, 5)
    before = frame_status.status_of(scene).frame.sensors["Pad"].normal_force.sum()
    if is_keyframed:
        keyframe(target, "location", {5: target.location - Vector((0.0, 0.0, 1e-3))})
    else:
        pad.location.z += 1e-3
    bpy.context.view_layer.update()
    second_look.look_again(scene)
    assert frame_status.status_of(scene).frame.sensors["Pad"].normal_force.sum() > 1.2 * before


def test_what_is_moved_without_a_keyframe_stays_where_it_was_put():
    scene, _, target = press(frames=6)
    play_to(scene, 5)
    target.location.x = 0.003
    second_look.look_again(scene)
    assert target.location.x == pytest.approx(0.003)
    assert frame_status.status_of(scene).text.startswith("Out of date")


def test_a_hidden_target_is_named_and_computed_again_when_it_is_shown():
    scene, _, target = press(frames=6)
    play_to(scene, 5)
    before = frame_status.status_of(scene).frame.sensors["Pad"].normal_force
    target.hide_set(True)
    second_look.look_again(scene)
    assert frame_status.status_of(scene).text.startswith("'Ball' is hidden")
    target.hide_set(False)
    second_look.look_again(scene)
    np.testing.assert_array_equal(frame_status.status_of(scene).frame.sensors["Pad"].normal_force, before)


def test_nothing_changed_is_left_as_it_is():
    scene, *_ = press_and_drop(frames=6)
    play_to(scene, 5)
    run, status = live_cache.get(scene), frame_status.status_of(scene)
    second_look.look_again(scene)
    assert live_cache.get(scene) is run and frame_status.status_of(scene) is status


def test_the_first_stroke_puts_what_is_shown_out_of_date():
    scene, pad, _ = press(frames=4)
    group = pad.vertex_groups.new(name="Texels")
    group.add(list(range(84)), 1.0, "REPLACE")
    pad.palpate.region, pad.palpate.vertex_group = "GROUP", "Texels"
    bpy.context.view_layer.objects.active = pad
    play_to(scene, 4)
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    second_look.note_edit(scene, pad)
    assert frame_status.status_of(scene).frame is not None  # entering a mode changes nothing
    said = "'Pad' has changed since this frame was computed: go on in Object Mode."
    for is_painted in (False, True):
        if is_painted:
            group.add(list(range(20)), 0.0, "REPLACE")
        pad.data.update_tag()
        bpy.context.view_layer.update()
        second_look.note_edit(scene, pad)
        assert (frame_status.status_of(scene).text == said) is is_painted
        assert (frame_status.status_of(scene).frame is None) is is_painted
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    second_look.look_again(scene)
    assert len(frame_status.status_of(scene).frame.sensors["Pad"].reading) == 64  # computed again, with the new texels


def test_another_quantity_is_shown_at_once(monkeypatch):
    scene, *_ = press(frames=4)
    play_to(scene, 4)
    shown = []
    monkeypatch.setattr(overlays, "show", lambda scene, run, frame: shown.append((scene.palpate.quantity, frame.frame)))
    overlays._shown[scene.session_uid] = overlays._settings_of(scene)
    second_look.look_again(scene)
    assert not shown
    scene.palpate.quantity = "READING"
    second_look.look_again(scene)
    assert shown == [("READING", 4)]
