# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens to objects in a Blender session: duplicated, linked, appended, overridden, mirrored, joined, separated, scaled,
renamed. The sensor stays right, or says what to do."""

import bpy
import numpy as np
import pytest
from blender_scenes import ball, choose, grid, press, problems_of, reopen, report_of, save, scenario_of, select

from palpate.addon.session import identity, transforms
from palpate.commands import main
from palpate.core.io.recording_npz import load_recording
from palpate.core.solver.simulation import run


def forces():
    """Sum of the normal forces of every sensor at the last frame."""
    recording = run(scenario_of(bpy.context.scene))
    return {name: float(felt.normal_force[-1].sum()) for name, felt in recording.sensors.items()}


@pytest.mark.parametrize("linked", [False, True])
def test_duplicated(linked):
    """Shift D and Alt D: two sensors that feel the same at two places, each with a uid of its own."""
    scene, pad, target = press(4)
    choose(pad)
    bpy.ops.object.duplicate(linked=linked)
    copy = bpy.context.object
    copy.location.x += 0.2
    choose(target)
    bpy.ops.object.duplicate()
    other = bpy.context.object
    other.delta_location.x = 0.2  # on top of its keyframes
    felt = forces()
    assert felt["Pad"] > 0
    assert felt["Pad.001"] == pytest.approx(felt["Pad"], rel=1e-4)
    assert identity.key(pad) != identity.key(copy)


def test_a_duplicated_skin_lies_on_the_same_surface_and_one_with_its_carrier_on_the_copy():
    finger = ball("Finger", radius=0.02)
    bpy.ops.palpate.skin_add(source="MESH", spacing=0.006)
    skin = bpy.context.object
    choose(skin)
    bpy.ops.object.duplicate()
    assert bpy.context.object.parent == finger
    choose(finger, skin)
    bpy.ops.object.duplicate()
    copies = {obj.name: obj for obj in bpy.context.selected_objects}
    assert copies["Finger Skin.002"].parent == copies["Finger.001"]


@pytest.mark.parametrize("axis", [0, 1])
def test_the_net_force_on_a_mirrored_sensor_has_the_sign_of_one_that_is_not(axis):
    """Along the y and z axes of the object; x completes a right-handed frame."""
    scene, pad, target = press(4)
    pad.rotation_euler.z = 0.3
    before = run(scenario_of(scene)).sensors["Pad"].net_force[-1]
    pad.scale[axis] = -1.0
    after = run(scenario_of(scene)).sensors["Pad"].net_force[-1]
    signs = [1.0, 1.0, 1.0] if axis == 0 else [-1.0, -1.0, 1.0]
    assert before[2] < -0.01
    assert after == pytest.approx(signs * before, abs=0.02 * abs(before[2]))


def test_mirrored_upside_down_it_faces_down():
    """As Blender shows it: a negative scale along the normal turns the normal around."""
    scene, pad, _ = press(4)
    pad.scale.z = -1.0
    texels = report_of(pad).texels
    frame = transforms.rotation(transforms.decompose(np.array(pad.matrix_world, float))[1])
    assert texels.normal @ frame.T == pytest.approx(np.tile([0, 0, -1.0], (84, 1)), abs=1e-6)


def test_joined_by_region():
    """Two painted pads joined are one sensor of both regions."""
    scene, pad, target = press(2)
    other = grid("Other", (0.1, 0, 0))
    for obj in (pad, other):
        select(obj, range(12))
        bpy.context.view_layer.objects.active = obj
        bpy.ops.palpate.sensor_add(source="SELECTION")
    choose(other, pad)
    bpy.ops.object.join()
    assert len(report_of(pad).texels) == 24 and problems_of(pad) == []


def test_separated():
    """A sensor cut in two: each part is a sensor with its own share of the region and the same parameters."""
    scene, pad, target = press(4)
    pad.palpate.k = 99.0
    select(pad, range(0, 42))
    choose(pad)
    bpy.ops.palpate.sensor_add(source="MESH")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_mode(type="FACE")
    bpy.ops.mesh.separate(type="SELECTED")
    bpy.ops.object.mode_set(mode="OBJECT")
    parts = [obj for obj in scene.objects if obj.name.startswith("Pad")]
    assert len(parts) == 2
    assert {obj.palpate.k for obj in parts} == {99.0}
    assert len({identity.key(obj) for obj in parts if identity.ensure_uid(obj) is None}) == 2
    # fewer vertices than were made a sensor: said, one click accepts it
    assert all("GROWN" in problems_of(obj) for obj in parts)
    assert set(forces()) == {obj.name for obj in parts}


def _library(tmp_path, link=True):
    """Link or append a pad and the ball that presses it from another file; return the pad and the forces there."""
    press(4)
    bpy.data.objects["Pad"].palpate.k = 88.0
    expected = forces()
    path = save(tmp_path, "library.blend")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)  # an empty file; add-ons stay
    with bpy.data.libraries.load(str(path), link=link) as (_, target):
        target.objects = ["Pad", "Ball"]
    for obj in target.objects:
        bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.frame_end = 4
    return target.objects[0], expected


@pytest.mark.parametrize("link", [False, True])
def test_appended_and_linked(tmp_path, link):
    pad, expected = _library(tmp_path, link)
    assert forces() == {name: pytest.approx(value, rel=1e-6) for name, value in expected.items()}
    bpy.context.view_layer.objects.active = pad
    if link:
        assert not bpy.ops.palpate.skin_add.poll()  # grey, with a message that names Make Local
        assert not bpy.ops.palpate.fix.poll()
    else:
        assert bpy.ops.palpate.sensor_add(source="MESH") == {"FINISHED"}


def test_linked_it_is_baked_into_files_alone(tmp_path, refused):
    """What is linked cannot hold heat maps and keyframes; the command line needs none where it does not save."""
    _, expected = _library(tmp_path)
    (tmp_path / "scene").mkdir()
    scene = str(save(tmp_path / "scene", "links.blend"))
    assert "'Pad' is linked from another file" in refused("bake", scene, "--save")
    assert main(["bake", scene]) == 0
    felt = load_recording(tmp_path / "scene" / "palpate-bake" / "Pad" / "recording.npz").sensors["Pad"]
    assert felt.normal_force[-1].sum() == pytest.approx(expected["Pad"], rel=0.02)


def test_overridden(tmp_path):
    pad, expected = _library(tmp_path)
    pad = pad.override_create(remap_local_usages=True)
    pad.palpate.k = 176.0
    bpy.context.view_layer.update()
    assert forces()[pad.name] == pytest.approx(2 * expected["Pad"], rel=0.02)
    path = save(tmp_path, "override.blend")
    reopen(path)
    local = next(obj for obj in bpy.data.objects if obj.override_library is not None and obj.name == "Pad")
    assert local.palpate.k == 176.0
