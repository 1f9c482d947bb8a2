# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user can get wrong gets one clear sentence and changes nothing; what can be used is used, with a warning."""

import os
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from blender_scenes import baked, ball, changes, dump, press, press_and_drop, raw_settings, refusal, save

from palpate.addon.bake.bake import bake
from palpate.addon.scene import scene_reader
from palpate.core.errors import PalpateError, SceneError
from palpate.core.jobs import SlicedJob, run_job


@pytest.fixture
def pressed(tmp_path):
    """A scene that bakes; each test spoils it."""
    scene, pad, target = press(frames=4)
    bpy.ops.palpate.reset()
    scene.palpate.use_live = False
    save(tmp_path)
    return SimpleNamespace(scene=scene, pad=pad, target=target, folder=tmp_path)


def whole_refusal(operator=bpy.ops.palpate.bake, **settings) -> str:
    """Press a button that has to refuse; return its sentence. Nothing may have changed, in the file and in its folder."""
    folder = os.path.dirname(bpy.data.filepath)
    before, files = dump(), everything_in(folder)
    sentence = refusal(operator, **settings)
    assert changes(before, dump()) == []
    assert everything_in(folder) == files
    return sentence


def everything_in(folder):
    return sorted(Path(folder).rglob("*"))


# --- one sentence each


def region(name, vertices=()):
    """Return what gives the sensor a region of some vertices, or of a group that there is not."""

    def spoil(it):
        if vertices is not None:
            it.pad.vertex_groups.new(name=name).add(list(vertices), 1.0, "REPLACE")
        it.pad.palpate.region, it.pad.palpate.vertex_group = "GROUP", name

    return spoil


def a_curve(role):
    def spoil(it):
        bpy.ops.curve.primitive_bezier_circle_add()
        bpy.context.object.name = "Circle"
        bpy.context.object.palpate.role = role

    return spoil


def value(what, name, number):
    """Return what sets a property of the pad, the target or the scene, or one axis of a location or scale."""
    return lambda it: setattr(what(it), name, number)


SPOILED = {
    "a region without vertices": (region("Empty"), "The region of sensor 'Pad' is empty"),
    "a region whose group was deleted": (region("Gone", None), "Sensor 'Pad' has no vertex group 'Gone'"),
    "a sensor without faces": (lambda it: it.pad.data.clear_geometry(), "'Pad' has no faces"),
    "a vertex that is no number": (
        value(lambda it: it.target.data.vertices[7].co, "x", float("nan")),
        "Vertex 7 of 'Ball' has a NaN or infinite coordinate",
    ),
    "an object at no place": (value(lambda it: it.pad.location, "x", float("nan")), "'Pad' has a NaN or infinite location"),
    "no scale along one axis": (value(lambda it: it.target, "scale", (1.0, 0.0, 1.0)), "The scale of 'Ball' is zero"),
    "a stiffness that is no number": (lambda it: raw_settings(it.pad).update({"k": float("nan")}), "k of sensor 'Pad' is nan"),
    "a time step of zero": (
        lambda it: (setattr(it.scene.palpate, "use_auto_dt", False), setattr(it.scene.palpate, "dt", 0.0)),
        "The time step of 'Scene' is 0 s",
    ),
    "no sensor": (value(lambda it: it.pad.palpate, "role", "TARGET"), "'Scene' has no sensor"),
    "nothing that touches": (value(lambda it: it.target.palpate, "role", "NONE"), "Nothing in 'Scene' can touch a sensor"),
    "a curve as sensor": (a_curve("SENSOR"), "'Circle' is not a mesh"),
    "a curve without surface as target": (a_curve("TARGET"), "'Circle' has no faces"),
    "no folder at all": (value(lambda it: it.scene.palpate, "folder", " "), "The bake folder of 'Scene' is empty"),
}
"""Numbers and shapes that no sensor can have are those of tests/core/model and tests/core/geometry."""


@pytest.mark.parametrize("spoil", SPOILED)
def test_a_scene_that_cannot_be_baked_is_one_sentence(pressed, spoil):
    change, words = SPOILED[spoil]
    change(pressed)
    assert whole_refusal().startswith(words)


@pytest.mark.parametrize(("chosen", "words"), [
    ([], "Nothing is selected on 'Pad'"),
    ([0, 8, 20], "The 3 chosen vertices of 'Pad' span no face"),
])  # fmt: skip
def test_a_selection_that_makes_no_sensor(pressed, chosen, words):
    pressed.pad.data.vertices.foreach_set("select", np.isin(np.arange(84), chosen))
    bpy.context.view_layer.objects.active = pressed.pad
    assert whole_refusal(bpy.ops.palpate.sensor_add, source="SELECTION").startswith(words)
    assert whole_refusal(bpy.ops.palpate.sensor_add, source="GROUP").startswith("'Pad' has no vertex group")


def test_a_frame_range_that_runs_backwards(pressed):
    """Blender's own buttons keep it straight; a file or a command line need not."""
    with pytest.raises(SceneError, match=r"frame range of 'Shot' runs backwards \(9 to 3\): set the end frame after"):
        scene_reader._check_frame_range(SimpleNamespace(name="Shot", frame_start=9, frame_end=3))


# --- participants


def test_a_mesh_in_edit_mode(pressed):
    bpy.context.view_layer.objects.active = pressed.pad
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(SceneError, match="'Pad' is in Edit Mode"):
        run_job(bake(pressed.scene))


def test_a_baked_body_that_is_no_longer_free(tmp_path):
    """Its keyframes are the old bake's; taking them for the user's would make them into a motion that forces follow."""
    scene, *_, free = press_and_drop(frames=3)
    save(tmp_path)
    bpy.ops.palpate.bake()
    free.palpate.body = "KEYFRAMED"
    assert whole_refusal().startswith("'Cube' is Keyframed, but its keyframes are those of a bake")
    bpy.ops.palpate.bake_clear()
    assert bpy.ops.palpate.bake() == {"FINISHED"}


def test_a_sensor_whose_mesh_is_linked(tmp_path, pressed):
    """A library override: the object can be changed, its mesh cannot."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "borrower.blend"))
    for obj in (pressed.pad, pressed.target):
        bpy.data.objects.remove(obj)
    with bpy.data.libraries.load(str(tmp_path / "scene.blend"), link=True) as (_, wanted):
        wanted.objects = ["Pad"]
    pad = wanted.objects[0].override_create(remap_local_usages=True)
    pressed.scene.collection.objects.link(pad)
    ball(location=(0.0, 0.0, 0.006)).palpate.role = "TARGET"
    assert pad.is_editable
    bpy.context.view_layer.update()
    assert whole_refusal().startswith("The mesh of sensor 'Pad' is linked from another file")
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = pad
    pad.select_set(True)
    with pytest.raises(RuntimeError, match="The mesh of 'Pad' is linked from another file: use Object › Relations"):
        bpy.ops.palpate.sensor_add()
    bpy.ops.object.make_local(type="SELECT_OBDATA")  # what the sentences say
    assert bpy.ops.palpate.bake() == {"FINISHED"}


def with_hidden(folder):
    """The content of all files in a folder, also of those that a bake hides there."""
    return {path: path.read_bytes() for path in everything_in(folder) if path.is_file()}


@pytest.mark.parametrize("steps", [1, 3, 5, 7])
def test_a_target_deleted_while_its_bake_runs(tmp_path, steps):
    scene, _, target, *_ = press_and_drop(frames=4)
    bpy.ops.palpate.reset()
    scene.palpate.use_live = False
    baked(scene, tmp_path)
    other = ball("Other")
    other.palpate.role = "TARGET"
    files = with_hidden(tmp_path)
    work = SlicedJob(bake(scene))
    for _ in range(steps):
        work.work(0.0)
    bpy.data.objects.remove(other)
    scene.frame_set(1)
    before = dump()
    with pytest.raises(PalpateError, match=r"^'Other' was deleted while .*: undo that, or start again without it\.$"):
        while not work.is_done:
            work.work(0.0)
    assert with_hidden(tmp_path) == files
    scene.frame_set(1)
    assert changes(before, dump()) == []


def test_a_scene_deleted_while_its_bake_runs(tmp_path):
    scene, *_ = press(frames=4)
    save(tmp_path)
    work = SlicedJob(bake(scene))
    for _ in range(6):
        work.work(0.0)
    bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(scene)
    with pytest.raises(PalpateError, match="^Scene 'Scene' was deleted or renamed"):
        while not work.is_done:
            work.work(0.0)


# --- files


def test_a_file_that_was_never_saved():
    press(frames=4)
    bpy.context.scene.palpate.use_live = False
    bpy.ops.palpate.reset()
    before = dump()
    said = refusal(bpy.ops.palpate.bake)
    assert "relative to a file that is not saved yet: save the .blend first." in said
    assert changes(before, dump()) == []


def test_a_folder_that_is_missing(pressed):
    pressed.scene.palpate.folder = str(pressed.folder / "not" / "there")
    assert "not' does not exist" in whole_refusal()
