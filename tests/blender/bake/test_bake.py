# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake: files, keyframes, arrows, heat maps; what is there before and after it, and that it can be repeated bit for bit."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, changes, contents, cube, dump, grid, keyframe, press, press_and_drop, reopen, save, visible
from kills import files_up_to
from sample_bake import read_exr

from palpate.addon.bake.bake import bake
from palpate.addon.display import heat_map, materials
from palpate.addon.scene import stored_names
from palpate.addon.session import fcurves, session_state, transforms
from palpate.core.errors import FileError
from palpate.core.io.bake_folder import read_manifest
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.hidden_folder import LOCK_NAME, PRIVATE_FOLDER
from palpate.core.io.recording_npz import load_recording
from palpate.core.jobs import SlicedJob, run_job


def test_one_folder_per_sensor(tmp_path):
    scene, *_ = press_and_drop(frames=4)
    scene.frame_start = 0
    result = baked(scene, tmp_path)
    assert visible(tmp_path / "palpate-bake") == ["Pad", "Pad 2"]
    for name, folder in result.folders.items():
        files = sorted(path.name for path in folder.iterdir())
        own = ["images.sha256", "manifest.json", "recording.npz", "sensor.npz"]
        assert files == [*own, *(f"tactile_{frame:04d}.exr" for frame in range(5))]
        manifest = read_manifest(folder)
        assert manifest.complete and manifest.sensor == name and manifest.digest == result.recording.digest
        assert "channels" not in (folder / "manifest.json").read_text()
        recording = load_recording(folder / "recording.npz")
        assert list(recording.sensors) == [name]
        channels, about = read_exr(folder / "tactile_0004.exr")
        force = recording.sensors[name].normal_force[-1]
        assert channels["R"] == pytest.approx(np.float32(force).reshape(14, 6)) and force.max() > 0
        assert about["digest"] == manifest.digest


def test_a_bake_without_images_has_the_same_recordings(tmp_path):
    scene, *_ = press_and_drop(frames=4)
    with_images = baked(scene, tmp_path)
    assert all(read_manifest(folder).has_images for folder in with_images.folders.values())
    expected = {path: content for path, content in contents(tmp_path / "palpate-bake").items() if str(path).endswith(".npz")}
    scene.palpate.folder = str(tmp_path / "plain")
    found = baked(scene, into_scene=False, images=False)
    for folder in found.folders.values():
        assert visible(folder) == ["manifest.json", "recording.npz", "sensor.npz"]
        assert not read_manifest(folder).has_images
    plain = {path: content for path, content in contents(tmp_path / "plain").items() if str(path).endswith(".npz")}
    assert plain == expected and len(plain) == 4
    assert read_bake(tmp_path / "plain").recording.digest == with_images.recording.digest
    with pytest.raises(ValueError, match="by its images"):
        next(bake(scene, images=False))


def test_progress_reaches_its_end(tmp_path):
    scene, *_ = press(frames=4)
    save(tmp_path)
    seen = []
    run_job(bake(scene), seen.append)
    assert [step.done for step in seen] == list(range(1, 9)) and {step.total for step in seen} == {8}
    assert not session_state.session.suspension_depth


def test_bake_and_compute_to_here_exclude_each_other(monkeypatch):
    press(frames=4)
    assert bpy.ops.palpate.bake.poll()
    monkeypatch.setitem(session_state.session.jobs, "PALPATE_OT_bake", None)
    assert not bpy.ops.palpate.bake.poll() and not bpy.ops.palpate.catch_up.poll()
    monkeypatch.delitem(session_state.session.jobs, "PALPATE_OT_bake")
    monkeypatch.setattr(session_state.session, "catching_up", True)
    assert not bpy.ops.palpate.bake.poll()


@pytest.mark.parametrize(("mode", "parented"), [("XYZ", False), ("ZXY", True), ("QUATERNION", True), ("AXIS_ANGLE", True)])
def test_keyframes_put_free_bodies_where_the_solver_had_them(tmp_path, mode, parented):
    scene, _, _, _, free = press_and_drop(frames=6)
    free.palpate.angular_velocity = (2.0, -3.0, 9.0)
    free.scale = (1.0, 1.5, 0.5)
    free.rotation_mode = mode
    free.rotation_quaternion = (0.9, 0.1, -0.3, 0.2)
    free.rotation_axis_angle = (0.5, 0.0, 0.6, 0.8)
    if parented:
        bpy.ops.object.empty_add(location=(0.1, 0.0, 0.0))
        free.parent = bpy.context.object
        keyframe(free.parent, "rotation_euler", {1: (0.0, 0.0, 0.5), 6: (0.3, 0.0, 0.5)})
    result = baked(scene, tmp_path)
    index = result.recording.body_names.index("Cube")
    for i, frame in enumerate(range(1, 7)):
        scene.frame_set(frame)
        location, quaternion, _ = transforms.decompose(transforms.as_array(free.matrix_world))
        assert location == pytest.approx(result.recording.poses[i, index, :3], abs=2e-7)
        turned = transforms.rotation(result.recording.poses[i, index, 3:])
        assert transforms.rotation(quaternion) == pytest.approx(turned, abs=2e-6)
    paths = fcurves.animated_paths(free)
    rotation = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}.get(mode, "rotation_euler")
    assert paths == {"location", rotation}
    assert {point.interpolation for curve in fcurves.of_object(free) for point in curve.keyframe_points} == {"LINEAR"}


def test_the_arrow_is_the_reaction_at_the_centre_of_pressure(tmp_path):
    scene, pad, *_ = press(frames=6)
    pad.rotation_euler = (0.1, 0.2, 0.3)
    scene.palpate.use_auto_arrow, scene.palpate.arrow_scale = False, 0.5
    result = baked(scene, tmp_path)
    arrow = materials.find_block(scene.objects, pad.palpate.uid)
    readings = result.recording.sensors["Pad"]
    assert readings.contact.any(axis=1).tolist()[0] is False and readings.contact[-1].any()
    for i, frame in enumerate(range(1, 7)):
        scene.frame_set(frame)
        size = np.linalg.norm(readings.net_force[i])
        assert list(arrow.scale) == pytest.approx([0.5 * size] * 3, rel=1e-5)
        if size > 0:
            world = transforms.as_array(arrow.matrix_world)
            rotation = transforms.rotation(result.recording.poses[i, 0, 3:])
            assert world[:3, 2] / 0.5 == pytest.approx(-rotation @ readings.net_force[i], rel=1e-4, abs=1e-6)
            foot = result.recording.poses[i, 0, :3] + rotation @ readings.centre_of_pressure[i]
            assert world[:3, 3] == pytest.approx(foot, abs=1e-7)


def test_the_heat_map_is_on_the_region_only(tmp_path):
    scene, pad, _ = press(frames=4)
    pad.data.materials.append(bpy.data.materials.new("Rubber"))
    group = pad.vertex_groups.new(name="Tip")
    group.add([0, 1, 2, 6, 7, 8], 1.0, "REPLACE")
    pad.palpate.region, pad.palpate.vertex_group = "GROUP", "Tip"
    baked(scene, tmp_path)
    faces = [face.index for face in pad.data.polygons if face.material_index == 1]
    assert [sorted(pad.data.polygons[i].vertices) for i in faces] == [[0, 1, 6, 7], [1, 2, 7, 8]]
    assert pad.material_slots[1].material.name == "Palpate Pad"
    image = next(node.image for node in pad.material_slots[1].material.node_tree.nodes if node.type == "TEX_IMAGE")
    assert image.filepath == "//palpate-bake/Pad/tactile_0001.exr"
    assert (image.source, image.colorspace_settings.name) == ("SEQUENCE", "Non-Color")


def test_clearing_brings_everything_back(tmp_path):
    scene, pad, _, _, free = press_and_drop(frames=4)
    bpy.ops.palpate.reset()
    scene.palpate.use_live = False
    scene.palpate.overlays = {"FORCE", "TORQUE", "CENTRE", "SLIP", "NORMALS", "SHEARS"}
    scene.palpate.quantity = "PRESSURE"  # which is in no image of the bake
    cube("Tip", (0.0, 0.3, 0.0), size=0.02).palpate.role = "SENSOR"  # its heat map has geometry nodes
    pad.data.materials.append(bpy.data.materials.new("Rubber"))
    free.keyframe_insert("hide_render", frame=1)  # an animation of its own stays
    save(tmp_path)
    scene.frame_set(1)
    before = dump()
    baked(scene)
    assert bpy.ops.palpate.bake() == {"FINISHED"}  # twice, since the second replaces the first
    assert len([obj for obj in scene.objects if materials.SENSOR_KEY in obj]) == 18
    scene.frame_set(3)
    assert bpy.ops.palpate.bake_clear() == {"FINISHED"}
    scene.frame_set(1)
    assert [line for line in changes(before, dump()) if "baked_" not in line and "start_" not in line] == []
    assert fcurves.animated_paths(free) == {"hide_render"}


def test_a_stopped_bake_leaves_the_old_one(tmp_path):
    scene, pad, *_ = press_and_drop(frames=4)
    baked(scene, tmp_path)
    files = contents(tmp_path / "palpate-bake")
    before = dump()
    pad.palpate.k = 70.0
    for steps in (1, 3, 5, 7):
        work = SlicedJob(bake(scene))
        for _ in range(steps):
            work.work(0.0)
        work.cancel()
        assert [path.name for path in (tmp_path / "palpate-bake" / PRIVATE_FOLDER).iterdir()] == [LOCK_NAME]
        assert contents(tmp_path / "palpate-bake") == files
        assert [line for line in changes(before, dump()) if not line.startswith("Pad: settings")] == []
        assert not session_state.session.suspension_depth


@pytest.mark.parametrize("manifest", [None, '{"name": "My web page"}'], ids=["", "that of another program"])
def test_a_refused_bake_has_touched_nothing(tmp_path, manifest):
    """The bake folder of a .blend from the net leads to a folder of the user's; its sensor has the name of a folder there."""
    scene, pad, _ = press(frames=2)
    pad.name = "project"
    save(tmp_path)
    folder = tmp_path / "palpate-bake" / "project"
    folder.mkdir(parents=True)
    (folder / "main.tex").write_text("years of work")
    if manifest is not None:
        (folder / "manifest.json").write_text(manifest)
    files = {str(path) for path in tmp_path.rglob("*")}
    stages = []
    with pytest.raises(FileError, match="holds other files than a bake"):
        run_job(bake(scene), lambda progress: stages.append(progress.stage))
    assert "Computing forces" not in stages  # nobody waits for forces that cannot be kept
    assert {str(path) for path in tmp_path.rglob("*")} == files


def test_one_bake_at_a_time(tmp_path):
    """The second is refused and touches nothing, and later it may."""
    scene, *_ = press(frames=3)
    save(tmp_path)
    first = bake(scene)
    while not (tmp_path / "palpate-bake" / PRIVATE_FOLDER / LOCK_NAME).exists():
        next(first)
    with pytest.raises(FileError, match="Another bake is writing to"):
        baked(scene)
    run_job(first)
    files = contents(tmp_path / "palpate-bake")
    baked(scene)
    assert contents(tmp_path / "palpate-bake") == files


def test_a_full_disk_is_one_sentence_and_the_earlier_bake_stays(tmp_path):
    """A limit on the size of files stands for the disk."""
    scene, pad, *_ = press(frames=3)
    baked(scene, tmp_path)
    files = contents(tmp_path / "palpate-bake")
    pad.palpate.k *= 2.0
    for size in (100, 1500, 3000):
        with files_up_to(size), pytest.raises(FileError, match=r"could not be written.*\(file too large\): "):
            baked(scene)
        assert contents(tmp_path / "palpate-bake") == files
        assert [path.name for path in (tmp_path / "palpate-bake" / PRIVATE_FOLDER).iterdir()] == [LOCK_NAME]


def test_who_left_the_bake_is_cleaned(tmp_path):
    scene, _, _, second, free = press_and_drop(frames=3)
    baked(scene, tmp_path)
    second.palpate.role = free.palpate.role = "NONE"
    baked(scene)
    assert not second.palpate.is_baked and not free.palpate.is_baked
    assert [obj.name for obj in scene.objects if obj.name.startswith("Net Force")] == ["Net Force Pad"]
    assert fcurves.animated_paths(free) == set()


def test_two_pads_with_one_mesh_have_a_heat_map_each(tmp_path):
    scene, pad, target = press(frames=3)
    twin = pad.copy()
    twin.name, twin.location.x = "Twin", 0.1
    scene.collection.objects.link(twin)
    bpy.ops.palpate.reset()
    before = dump(uids=False)
    baked(scene, tmp_path)
    assert pad.material_slots[1].material.name == "Palpate Pad"
    assert twin.material_slots[1].material.name == "Palpate Twin"
    assert len(pad.data.materials) == 2
    heat_map.clear(pad)
    assert twin.material_slots[1].material.name == "Palpate Twin"
    bpy.ops.palpate.bake_clear()
    after = dump(uids=False)
    assert [line for line in changes(before, after) if "settings" not in line and "baked_" not in line] == []


def test_materials_given_after_a_bake_outlive_the_next(tmp_path):
    """In the slot that was empty, and on faces of the region."""
    scene, pad, _ = press(frames=2)
    baked(scene, tmp_path)
    rubber, tape = bpy.data.materials.new("Rubber"), bpy.data.materials.new("Tape")
    pad.data.materials[0] = rubber
    pad.data.materials.append(tape)
    pad.data.polygons[0].material_index = 2
    heat_map.clear(pad)
    assert list(pad.data.materials) == [rubber, tape]
    assert [face.material_index for face in pad.data.polygons] == [1] + [0] * 64
    baked(scene)
    assert list(pad.data.materials) == [rubber, tape, None]


@pytest.mark.parametrize("change", ["faces", "slot"])
def test_a_heat_map_that_was_taken_apart_can_be_cleared_and_baked_again(tmp_path, change):
    scene, pad, _ = press(frames=2)
    baked(scene, tmp_path)
    bpy.context.view_layer.objects.active = pad
    if change == "faces":
        region = pad.data.copy()
        pad.data.clear_geometry()
    else:
        pad.active_material_index = 1
        bpy.ops.object.material_slot_remove()
    heat_map.clear(pad)
    assert heat_map.OLD_MATERIAL not in pad.data.attributes and len(pad.data.materials) == 0
    if change == "faces":
        pad.data = region
    baked(scene)
    assert "Palpate Pad" in [slot.name for slot in pad.material_slots]


def test_the_arrow_is_in_the_scene_that_was_baked(tmp_path):
    """The sensor may be in several."""
    first, pad, target = press(frames=2)
    second = bpy.data.scenes.new("Scene Z")
    second.frame_end = 2
    for obj in (pad, target):
        second.collection.objects.link(obj)
    baked(second, tmp_path)
    assert materials.find_block(second.objects, pad.palpate.uid) is not None
    assert materials.find_block(first.objects, pad.palpate.uid) is None


@pytest.mark.parametrize("mode", ["EDIT", "WEIGHT_PAINT"])
def test_the_buttons_leave_the_mode_in_which_a_mesh_is_changed(tmp_path, mode):
    scene, pad, _ = press(frames=2)
    save(tmp_path)
    bpy.context.view_layer.objects.active = pad
    for button, is_baked in ((bpy.ops.palpate.bake, True), (bpy.ops.palpate.bake_clear, False)):
        bpy.ops.object.mode_set(mode=mode)
        assert button() == {"FINISHED"}
        assert pad.mode == "OBJECT"
        bpy.ops.object.mode_set(mode="EDIT")  # which would bring back what the mesh was before
        bpy.ops.object.mode_set(mode="OBJECT")
        assert pad.palpate.is_baked == is_baked
        assert (stored_names.UV_MAP in pad.data.uv_layers) == is_baked
        assert {face.material_index for face in pad.data.polygons} == {int(is_baked)}


def test_clearing_a_copy_leaves_the_original_alone_in_a_reopened_file(tmp_path):
    scene, pad, _ = press(frames=2)
    baked(scene, tmp_path)
    twin = pad.copy()
    scene.collection.objects.link(twin)
    scene = reopen(save(tmp_path))
    bpy.context.view_layer.objects.active = scene.objects["Pad.001"]
    assert bpy.ops.palpate.sensor_remove() == {"FINISHED"}
    pad = scene.objects["Pad"]
    assert pad.material_slots[1].material.name == "Palpate Pad"
    assert materials.find_block(scene.objects, pad.palpate.uid) is not None


@pytest.mark.parametrize("around", [False, True])
def test_nothing_is_left_of_a_deleted_sensor(tmp_path, around):
    """Neither by the next bake nor by Clear Bake, also when it was the only one."""
    scene, pad, target = press(frames=3)
    if around:  # its heat map has geometry nodes, too
        pad.palpate.role = "NONE"
        pad = cube("Tip", (0.0, 0.0, -0.01), size=0.02)
        pad.palpate.role = "SENSOR"
    twin = grid("Pad 2", (0.2, 0.0, 0.0))
    twin.palpate.role = "SENSOR"
    bpy.ops.palpate.reset()
    save(tmp_path)
    kinds = ("materials", "images", "node_groups", "actions")

    def ours():
        arrows_left = [obj.name for obj in scene.objects if materials.SENSOR_KEY in obj]
        return arrows_left, {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds}

    baked(scene)
    name = pad.name
    assert f"Palpate {name}" in ours()[1]["materials"] and f"Palpate {name}" in ours()[1]["images"]
    kept = bpy.data.materials.new("Mine")
    kept[materials.SENSOR_KEY] = pad.palpate.uid  # a copy that the user has put on something
    target.data.materials.append(kept)
    bpy.data.objects.remove(pad)
    baked(scene)
    left, blocks = ours()
    assert left == ["Net Force Pad 2"]
    assert blocks["materials"] == ["Mine", "Palpate Arrow", "Palpate Pad 2"]
    assert blocks["images"] == ["Palpate Pad 2"] and blocks["node_groups"] == []
    bpy.data.objects.remove(twin)
    assert bpy.ops.palpate.bake_clear.poll()
    assert bpy.ops.palpate.bake_clear() == {"FINISHED"}
    assert not bpy.ops.palpate.bake_clear.poll()
    left, blocks = ours()
    assert left == [] and blocks["materials"] == ["Mine"] and blocks["images"] == []
    assert not [action for action in blocks["actions"] if action.startswith("Net Force")]


def test_files_put_beside_the_images_outlive_the_next_bake(tmp_path):
    scene, *_ = press(frames=3)
    folder = baked(scene, tmp_path).folders["Pad"]
    mine = {"notes.txt": b"years of work", "tactile_mean.exr": b"mine", "plots/a.svg": b"<svg/>"}
    (folder / "plots").mkdir()
    for name, content in mine.items():
        (folder / name).write_bytes(content)

    scene.frame_end = 2
    baked(scene)
    assert {name: (folder / name).read_bytes() for name in mine} == mine
    assert sorted(path.name for path in folder.glob("tactile_0*.exr")) == ["tactile_0001.exr", "tactile_0002.exr"]
    assert visible(folder.parent) == ["Pad"]
    assert [path.name for path in (folder.parent / PRIVATE_FOLDER).iterdir()] == [LOCK_NAME]
