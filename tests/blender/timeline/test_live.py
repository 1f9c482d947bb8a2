# SPDX-License-Identifier: GPL-3.0-or-later
"""The timeline: playing computes what a bake computes, scrubbing shows it, and files hold none of it."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, changes, dump, play_to, press, press_and_drop, reopen, save

from palpate.addon.bake.bake import bake
from palpate.addon.scene import stored_names
from palpate.addon.session import frame_status, session_state
from palpate.addon.timeline import live_cache, playback
from palpate.core.jobs import run_job
from palpate.core.model.recording import SENSOR_FIELDS
from palpate.operators import bake as bake_operators


def play(scene, *frames):
    for frame in frames:
        scene.frame_set(frame)


def forces_of(run):
    """The forces of one sensor as bytes, by their frames."""
    return {number: frame.sensors["Pad"].normal_force.tobytes() for number, frame in run.frames.items()}


def shown_force(obj):
    attribute = obj.data.attributes.get(stored_names.FORCE)
    if attribute is None:
        return None
    values = np.zeros(len(obj.data.vertices), dtype=np.float32)
    attribute.data.foreach_get("value", values)
    return values


def test_playing_gives_the_numbers_of_a_bake(tmp_path):
    scene, *_ = press_and_drop(frames=8)
    frames = dict(play_to(scene, 8).frames)
    assert sorted(frames) == list(range(1, 9))
    recording = baked(scene, tmp_path).recording
    for number, frame in frames.items():
        expected = recording.at(number)
        assert frame.poses.tobytes() == expected.poses.tobytes()
        for name, felt in frame.sensors.items():
            for key in SENSOR_FIELDS:
                one, other = getattr(felt, key), getattr(expected.sensors[name], key)
                assert one.tobytes() == other.tobytes(), (number, name, key)
    assert recording.sensors["Pad"].contact[-1].any() and recording.sensors["Pad 2"].contact[-1].any()


def test_each_scene_has_participants_of_its_own():
    scene, pad, target = press(frames=2)
    empty = bpy.data.scenes.new("Empty")
    for role in ("SENSOR", "NONE"):
        pad.palpate.role = target.palpate.role = role  # a change of any role is one of all scenes
        assert [playback.has_participants(one) for one in (scene, empty)] == [role != "NONE", False]


def test_scrubbing_reads_what_was_computed():
    scene, pad, _, _, free = press_and_drop(frames=8)
    play(scene, *range(1, 7))
    heights = {}
    for frame in (3, 6, 2, 5):
        scene.frame_set(frame)
        heights[frame] = free.location.z
        assert shown_force(pad) == pytest.approx(live_cache.get(scene).frames[frame].sensors["Pad"].normal_force, abs=1e-7)
    assert heights[2] > heights[3] and live_cache.get(scene).simulation.frame == 6
    scene.frame_set(1)
    assert not free.palpate.has_start


def test_a_jump_shows_nothing_and_says_so():
    scene, *_ = press(frames=20)
    play(scene, 1, 2, 15)
    assert sorted(live_cache.get(scene).frames) == [1, 2]
    status = frame_status.status_of(scene)
    assert status.frame is None and status.text == "Frame 15 is not computed: play from frame 2, or use Compute to Here."
    play(scene, 3)
    assert frame_status.status_of(scene).step == live_cache.get(scene).simulation.step_reason != ""
    assert frame_status.status_of(scene).frame.frame == 3


def test_a_jump_ahead_is_computed_with_progress(tmp_path):
    scene, *_ = press_and_drop(frames=12)
    play(scene, 1, 2, 9)
    steps = []
    run_job(playback.compute_to_present_frame(scene), lambda step: steps.append((step.frame, step.done, step.total)))
    assert steps == [(frame, frame - 2, 7) for frame in range(3, 10)] and scene.frame_current == 9
    jumped = live_cache.get(scene).frames[9]
    assert frame_status.status_of(scene).frame is jumped
    bpy.ops.palpate.reset()
    play(scene, 1, 11)
    assert bpy.ops.palpate.catch_up() == {"FINISHED"}
    assert live_cache.get(scene).frames[9].poses.tobytes() == jumped.poses.tobytes()
    assert not bpy.ops.palpate.catch_up.poll()
    bpy.ops.palpate.reset()
    play(scene, 7)  # from nothing
    assert live_cache.get(scene) is None and "play from the first frame" in frame_status.status_of(scene).text
    assert bpy.ops.palpate.catch_up() == {"FINISHED"} and sorted(live_cache.get(scene).frames) == list(range(1, 8))


def test_hands_come_before_frames_that_nobody_asked_for():
    """Played with real events in tests/ui/roads/bake.py."""
    events = {("G", "PRESS"): True, ("LEFTMOUSE", "PRESS"): True, ("G", "RELEASE"): False, ("MOUSEMOVE", "NOTHING"): False}
    events |= {("ESC", "PRESS"): False, ("TIMER", "NOTHING"): False}
    for (kind, value), expected in events.items():
        assert bake_operators.is_user_input(SimpleNamespace(type=kind, value=value)) is expected
    assert bpy.ops.palpate.catch_up.get_rna_type().properties["by_itself"].is_hidden


def test_a_stopped_jump_keeps_what_was_computed():
    scene, *_ = press(frames=12)
    play(scene, 1, 10)
    job = playback.compute_to_present_frame(scene)
    next(job), next(job)
    job.close()
    assert sorted(live_cache.get(scene).frames) == [1, 2, 3] and scene.frame_current == 10
    assert not session_state.session.catching_up


@pytest.mark.parametrize("frame, rendering", [(1, False), (3, True)])
def test_a_render_and_another_frame_end_a_jump(frame, rendering, monkeypatch):
    """A render that begins while a changed scene is computed again gets the frames that it asks for."""
    scene, *_ = press(frames=12)
    play(scene, 1, 10)
    job = playback.compute_to_present_frame(scene)
    next(job), next(job)
    scene.frame_set(frame)
    monkeypatch.setattr(session_state.session, "rendering", rendering)
    assert next(job, None) is None and scene.frame_current == frame
    assert not session_state.session.catching_up
    scene.frame_set(10)
    assert bpy.ops.palpate.catch_up.poll() is not rendering and bpy.ops.palpate.bake.poll() is not rendering


def watched(scene, obj, moments):
    """Return where a body is and what the bake's nodes show at moments of the timeline."""
    seen = []
    for number, part in moments:
        scene.frame_set(number, subframe=part)
        matrix = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world
        seen.append([list(row) for row in matrix])
    return np.array(seen)


def test_sub_frames_loops_steps_and_handlers_off_give_the_same_pictures(tmp_path):
    moments = [(3, 0.25), (6, 0.5), (2, 0.0), (8, 0.0), (4, 0.75), (8, 0.0), (2, 0.0)]
    scene, *_, free = press_and_drop(frames=8)
    free.palpate.angular_velocity = (3.0, 5.0, -2.0)
    play(scene, *range(1, 9))
    played = watched(scene, free, moments)
    bpy.ops.palpate.reset()
    baked(scene, tmp_path)
    shown = watched(scene, free, moments)
    assert played == pytest.approx(shown, abs=1e-6)
    playback.forget()
    handlers = {name: getattr(bpy.app.handlers, name).copy() for name in ("frame_change_pre", "frame_change_post")}
    for name in handlers:
        getattr(bpy.app.handlers, name).clear()
    alone = watched(scene, free, moments)
    for name, functions in handlers.items():
        getattr(bpy.app.handlers, name).extend(functions)
    assert alone.tolist() == shown.tolist()


def test_time_stretching_shows_the_same_bake_slower(tmp_path):
    """Twice as slow: frame 2 n of the timeline is frame n of the animation, for bodies, images and numbers alike."""
    scene, pad, _, _, free = press_and_drop(frames=8)
    plain = baked(scene, tmp_path).recording
    at_speed = watched(scene, free, [(number, 0.0) for number in range(1, 9)])
    bpy.ops.palpate.bake_clear()
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 200
    scene.palpate.overlays = {"NORMALS"}
    slow = baked(scene).recording
    assert slow.digest == plain.digest and slow.poses.tobytes() == plain.poses.tobytes()
    assert (scene.render.frame_map_old, scene.render.frame_map_new) == (100, 200)
    assert watched(scene, free, [(2 * number, 0.0) for number in range(1, 9)]) == pytest.approx(at_speed, abs=1e-6)
    scene.frame_set(16)
    assert frame_status.status_of(scene).text == "Frame 8 of the bake."
    assert frame_status.status_of(scene).step == plain.step_reason != ""
    arrows = {}
    for number in (2, 16):  # of the timeline; nothing touches at the animation's frame 1
        scene.frame_set(number)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        parents = [found.parent.original.name for found in depsgraph.object_instances if found.is_instance and found.parent]
        arrows[number] = parents.count("Normal Forces Pad")
    assert arrows[2] == 0 and arrows[16] == np.count_nonzero(plain.sensors["Pad"].contact[-1])


def test_play_from_the_first_frame_starts_with_the_second():
    """Blender reports no arrival at the frame where it already stands."""
    scene, *_ = press(frames=8)
    scene.palpate.use_live = False
    scene.frame_set(1)
    scene.palpate.use_live = True
    live_cache.drop()
    play(scene, 2, 3)
    assert sorted(live_cache.get(scene).frames) == [1, 2, 3]


def test_its_own_writing_does_not_make_it_stale():
    scene, *_ = press_and_drop(frames=8)
    for frame in range(1, 9):
        scene.frame_set(frame)
        bpy.context.view_layer.update()  # as the window does between frames
    assert sorted(live_cache.get(scene).frames) == list(range(1, 9))


@pytest.mark.parametrize("is_known", [True, False], ids=["after a run", "first of all"])
def test_a_pose_that_is_not_keyframed_reaches_no_later_frame(is_known):
    """The animation puts the ball back as soon as another frame is shown; before, frame 1 kept it in the pad."""
    scene, _, target = press(frames=8)
    play(scene, *range(1, 9), 1)
    expected = forces_of(live_cache.get(scene))
    if not is_known:
        live_cache.drop()
    target.location.z = 0.005
    bpy.context.view_layer.update()
    play(scene, *range(2, 9))
    assert forces_of(live_cache.get(scene)) == expected


def test_a_free_body_moved_at_the_first_frame_starts_there():
    scene, _, _, _, free = press_and_drop(frames=8)
    play(scene, 1, 2, 3, 1)
    free.location.z = 0.05
    bpy.context.view_layer.update()
    play(scene, 2)
    index = live_cache.get(scene).reading.object_names.index("Cube")
    assert live_cache.get(scene).frames[1].poses[index, 2] == pytest.approx(0.05)


def test_an_error_is_said_in_the_panel_and_not_at_every_frame(capfd):
    scene, pad, _ = press(frames=4)
    pad.palpate.mud = 0.9  # above mus
    play(scene, 1, 2, 3)
    assert "mud of sensor 'Pad'" in frame_status.status_of(scene).text
    assert "Traceback" not in capfd.readouterr().err


def test_a_file_saved_while_playing_holds_none_of_it(tmp_path):
    scene, pad, _, _, free = press_and_drop(frames=8)
    bpy.ops.palpate.reset()
    path = save(tmp_path)
    before = dump()
    play(scene, *range(1, 7))
    moved = free.location.z
    save(tmp_path)
    assert free.location.z == moved and shown_force(pad) is not None  # shown again
    scene = reopen(path)
    assert scene.frame_current == 6
    scene.palpate.use_live = False
    scene.frame_set(1)
    scene.palpate.use_live = True
    assert changes(before, dump()) == []


def stored_mesh(path, obj):
    """Return the mesh of an object as a file has it, which opening the file would not show."""
    copy = path.with_name("copy.blend")  # Blender does not append from the open file
    copy.write_bytes(path.read_bytes())
    with bpy.data.libraries.load(str(copy)) as (_, wanted):
        wanted.meshes = [obj.data.name]
    return wanted.meshes[0]


def test_a_file_saved_in_edit_mode_while_playing_holds_none_of_it(tmp_path):
    scene, pad, _ = press(frames=4)
    play(scene, 1, 2, 3)
    bpy.context.view_layer.objects.active = pad
    bpy.ops.object.mode_set(mode="EDIT")
    path = save(tmp_path)
    assert stored_names.FORCE not in stored_mesh(path, pad).attributes
    bpy.ops.object.mode_set(mode="OBJECT")
    play(scene, *range(1, 5))
    assert shown_force(pad).max() > 0.0  # it goes on


def test_a_file_saved_when_what_was_played_is_stale_holds_none_of_it(tmp_path):
    scene, pad, target = press(frames=4)
    play(scene, 1, 2, 3)
    pad.palpate.k *= 2.0
    play(scene, 4)
    assert live_cache.get(scene) is None
    assert stored_names.FORCE not in stored_mesh(save(tmp_path), pad).attributes


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_a_file_written_by_a_crash_is_cleaned_when_opened(tmp_path, mode):
    scene, pad, _, _, free = press_and_drop(frames=6)
    start = tuple(free.location)
    play(scene, *range(1, 7))
    bpy.context.view_layer.objects.active = pad
    bpy.ops.object.mode_set(mode=mode)
    hidden = bpy.app.handlers.save_pre.copy()
    bpy.app.handlers.save_pre.clear()
    path = save(tmp_path)
    bpy.app.handlers.save_pre.extend(hidden)
    assert stored_names.FORCE in stored_mesh(path, pad).attributes
    scene = reopen(path)
    assert stored_names.FORCE not in scene.objects["Pad"].data.attributes
    assert tuple(scene.objects["Cube"].location) == start


def test_undo_forgets_what_was_computed():
    scene, _, _, _, free = press_and_drop(frames=8)
    bpy.ops.palpate.reset()
    start = tuple(free.location)
    bpy.ops.ed.undo_push(message="before")
    play(scene, *range(1, 5))
    bpy.ops.ed.undo_push(message="played")
    bpy.ops.ed.undo()
    scene, free = bpy.context.scene, bpy.data.objects["Cube"]
    assert live_cache.get(scene) is None
    assert tuple(free.location) == start
    bpy.ops.ed.redo()
    scene, free = bpy.context.scene, bpy.data.objects["Cube"]
    assert free.palpate.has_start
    play(scene, 1)
    assert tuple(free.location) == start
    play(scene, 2, 3)
    assert sorted(live_cache.get(scene).frames) == [1, 2, 3]


def test_reset_puts_bodies_back():
    scene, pad, _, _, free = press_and_drop(frames=8)
    start = tuple(free.location), tuple(free.rotation_euler)
    play(scene, *range(1, 6))
    assert bpy.ops.palpate.reset() == {"FINISHED"}
    assert (tuple(free.location), tuple(free.rotation_euler)) == start
    assert shown_force(pad) is None and live_cache.get(scene) is None


@pytest.mark.parametrize("setting, value", [("body", "KEYFRAMED"), ("role", "NONE")])
def test_a_body_that_is_no_longer_free_goes_back_to_its_start(setting, value):
    scene, *_, free = press_and_drop(frames=8)
    start = tuple(free.location), tuple(free.rotation_euler)
    play(scene, *range(1, 6))
    assert tuple(free.location) != start[0]
    setattr(free.palpate, setting, value)
    assert (tuple(free.location), tuple(free.rotation_euler)) == start
    play(scene, 6, 1)
    assert (tuple(free.location), tuple(free.rotation_euler)) == start


def test_a_copy_of_a_displaced_body_stays_where_it_was_put():
    scene, *_, free = press_and_drop(frames=8)
    start = free.location.x
    play(scene, *range(1, 6))
    copy = free.copy()
    scene.collection.objects.link(copy)
    copy.location.x += 0.1
    here = tuple(copy.location)
    play(scene, 6, 1)
    assert tuple(copy.location) == here
    assert free.location.x == start


def test_another_file_opened_while_a_bake_is_half_done_can_be_played(tmp_path):
    scene, *_ = press(frames=4)
    path = save(tmp_path)
    job = bake(scene)
    next(job)
    next(job)
    scene = reopen(path)
    job.close()
    play(scene, 1, 2)
    assert sorted(live_cache.get(scene).frames) == [1, 2]


def test_the_numbers_of_a_bake_follow_a_file_saved_elsewhere(tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    scene, *_ = press(frames=4)
    felt = baked(scene, tmp_path / "here").recording.sensors["Pad"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "there" / "scene.blend"), relative_remap=True)
    scene = reopen(tmp_path / "there" / "scene.blend")
    play(scene, 3)
    assert frame_status.status_of(scene).frame.sensors["Pad"].normal_force.tolist() == felt.normal_force[2].tolist()


def test_rendering_never_simulates(tmp_path, capfd):
    scene, _, _, _, free = press_and_drop(frames=4)
    play(scene, 1, 2)
    bpy.ops.object.camera_add(location=(0.2, -1.0, 0.1), rotation=(1.5, 0.0, 0.0))
    scene.camera = bpy.context.object
    render = scene.render
    render.engine, scene.cycles.samples = "CYCLES", 1
    render.resolution_x = render.resolution_y = 16
    render.filepath = str(tmp_path / "frame_")
    seen = []
    bpy.app.handlers.render_post.append(lambda scene, *_: seen.append((scene.frame_current, free.location.z)))
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.render_post.pop()
    run = live_cache.get(scene)
    assert sorted(run.frames) == [1, 2]
    assert [frame for frame, _ in seen] == [1, 2, 3, 4]
    index = run.reading.object_names.index("Cube")
    assert seen[1][1] == pytest.approx(run.frames[2].poses[index, 2])  # remembered frames are shown
    assert not session_state.session.rendering
    note = "'Scene' is rendered without forces, and free bodies stay in their place: bake it first."
    assert session_state.session.render_note == note and capfd.readouterr().err.count(note) == 1
    bpy.ops.render.render()  # a still picture shows the frame that was shown before
    assert not session_state.session.render_note
    render.use_lock_interface, scene.frame_end = True, 2
    bpy.ops.render.render(animation=True)  # computed frames
    assert not session_state.session.render_note
    baked(scene, tmp_path)
    scene.frame_end = 4
    bpy.ops.render.render(animation=True)
    assert not session_state.session.render_note


def test_a_baked_scene_is_not_simulated_again(tmp_path):
    scene, pad, *_ = press_and_drop(frames=4)
    path, result = baked_file(scene, tmp_path)
    felt = result.recording.sensors["Pad"].normal_force
    assert play_to(scene, 3) is None
    assert frame_status.status_of(scene).frame.sensors["Pad"].normal_force.tolist() == felt[2].tolist()
    scene = reopen(path)
    play(scene, 4)
    assert frame_status.status_of(scene).frame.sensors["Pad"].normal_force.tolist() == felt[3].tolist()
    play(scene, 9)
    assert frame_status.status_of(scene).frame is None


def test_a_scene_without_roles_costs_nothing(scene, monkeypatch):
    scene.frame_set(1)
    monkeypatch.setattr(playback.baked_scene, "baked_objects", lambda scene: pytest.fail("looked at objects"))
    play(scene, 2, 3)
