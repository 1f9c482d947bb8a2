# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands on a baked sensor says what its recording says: arrows, markers, colours on one scale; and it can be changed."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, find_marker, keyframe, node_of, press, press_and_drop, reopen

from palpate.addon.bake.bake import bake
from palpate.addon.display import markers, materials, overlays, texel_arrows
from palpate.addon.scene.stored_names import ARROWS_MODIFIER
from palpate.addon.session import transforms
from palpate.core import response
from palpate.sample_blends import grasp

ALL = {"FORCE", "TORQUE", "CENTRE", "SLIP", "NORMALS", "SHEARS"}


@pytest.fixture(scope="module")
def two_sensors(blender, tmp_path_factory):
    """Return a saved scene of two sensors with every marker, and its bake."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene, pad, target, *_ = press_and_drop(frames=8)
    pad.rotation_euler, pad.scale = (0.03, 0.05, 0.3), (1.0, 1.2, 1.0)
    keyframe(target, "location", {8: (0.004, 0.002, 0.0045)})
    scene.frame_set(1)
    scene.palpate.overlays = ALL
    return baked_file(scene, tmp_path_factory.mktemp("overlays"))


@pytest.fixture
def shown(two_sensors):
    path, result = two_sensors
    scene = reopen(path)
    return scene, scene.objects["Pad"], result


def instances(obj):
    """Return the matrices of the arrows that geometry nodes make on an object, by place."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return [
        transforms.as_array(found.matrix_world)
        for found in depsgraph.object_instances
        if found.is_instance and found.parent is not None and found.parent.original == obj
    ]


def end_of_colours(obj):
    """Return the value that has the last colour of a heat map."""
    return node_of(obj, "ShaderNodeMapRange").inputs["From Max"].default_value


@pytest.mark.parametrize("kind", ["NORMALS", "SHEARS"])
def test_texel_arrows_are_the_forces_of_their_texels(shown, kind):
    scene, pad, result = shown
    scene.frame_set(8)
    body, texels = result.scenario.sensors[0].body, result.scenario.sensors[0].texels
    readings = result.recording.at(8).sensors["Pad"]
    rotation = transforms.rotation(result.recording.poses[-1, body, 3:])
    force = readings.normal_force[:, None] * texels.normal
    if kind == "SHEARS":
        force = -readings.shear[:, :1] * texels.tangent - readings.shear[:, 1:] * texels.bitangent
    found = instances(find_marker(scene.objects, pad.palpate.uid, kind))
    size = np.linalg.norm(force, axis=1)
    assert len(found) == (size > texel_arrows.MIN_ARROW_SHARE * size.max()).sum() >= 3
    place = result.recording.poses[-1, body, :3] + texels.position @ rotation.T
    ratios = []
    for matrix in found:
        texel = int(np.linalg.norm(place - matrix[:3, 3], axis=1).argmin())
        assert np.linalg.norm(place[texel] - matrix[:3, 3]) < (1e-6 if kind == "NORMALS" else 2e-3)
        expected = rotation @ force[texel]
        assert matrix[:3, 2] / np.linalg.norm(matrix[:3, 2]) == pytest.approx(expected / size[texel], abs=1e-4)
        ratios.append(np.linalg.norm(matrix[:3, 2]) / size[texel])
    assert ratios == pytest.approx([ratios[0]] * len(ratios), rel=1e-4)


def test_markers_stand_at_the_centre_of_pressure_and_show_moment_and_slip(shown):
    scene, pad, result = shown
    readings = result.recording.sensors["Pad"]
    share = response.slip_share(readings, result.scenario.sensors[0].parameters)
    moment = response.free_moment(readings)
    radius = float(np.ptp(result.scenario.sensors[0].texels.position, axis=0).max()) * markers.RING_SHARE
    for frame in (1, 6, 8):
        scene.frame_set(frame)
        i = frame - 1
        rotation = transforms.rotation(result.recording.poses[i, 0, 3:])
        foot = result.recording.poses[i, 0, :3] + rotation @ readings.centre_of_pressure[i]
        for kind in ("TORQUE", "CENTRE", "SLIP"):
            marker = find_marker(scene.objects, pad.palpate.uid, kind)
            assert list(marker.location) == pytest.approx(foot, abs=1e-7)
            assert (marker.scale.x > 0) <= bool(readings.contact[i].any())
        assert marker.scale.x == pytest.approx(share[i] * radius, abs=1e-7)  # SLIP
        arrow = find_marker(scene.objects, pad.palpate.uid, "TORQUE")
        if readings.contact[i].any():
            axis = transforms.as_array(arrow.matrix_world)[:3, 2] / arrow.scale.x
            assert axis == pytest.approx(-rotation @ moment[i] / np.linalg.norm(moment[i]), abs=1e-4)


def test_all_sensors_share_one_scale(shown):
    scene, pad, result = shown
    lengths = {}
    scene.frame_set(8)
    for name, obj in (("Pad", pad), ("Pad 2", scene.objects["Pad 2"])):
        arrow = find_marker(scene.objects, obj.palpate.uid, "FORCE")
        lengths[name] = arrow.scale.x / np.linalg.norm(result.recording.sensors[name].net_force[-1])
    assert lengths["Pad"] == pytest.approx(lengths["Pad 2"], rel=1e-5)
    ends = {end_of_colours(obj) for obj in (pad, scene.objects["Pad 2"])}
    assert list(ends) == [pytest.approx(response.scale_limit(response.peak_force(result.recording)))]


def test_arrows_of_fingers_that_face_each_other_do_not_cross(scene, tmp_path):
    """In a grasp the two net forces point at each other: together they are shorter than the way between the fingers."""
    grasp.build(scene)
    scene.frame_start, scene.frame_end = 10, 15
    baked(scene, tmp_path)
    scene.frame_set(15)
    left, right = (find_marker(scene.objects, scene.objects[name].palpate.uid, "FORCE") for name in (grasp.LEFT, grasp.RIGHT))
    between = right.location.x - left.location.x
    assert left.scale.z + right.scale.z == pytest.approx(0.94 * between, rel=0.05)  # the tightest is of another frame


def test_display_settings_are_applied_to_a_bake_without_computing(shown, monkeypatch):
    scene, pad, result = shown
    monkeypatch.setattr("palpate.core.solver.simulation.Simulation", lambda *_: pytest.fail("computed"))
    scene.palpate.overlays = {"CENTRE"}
    scene.palpate.color_map = "CIVIDIS"
    scene.palpate.use_auto_range, scene.palpate.range_max = False, 0.25
    assert bpy.ops.palpate.display_refresh() == {"FINISHED"}
    left = [obj.name for obj in scene.objects if materials.SENSOR_KEY in obj]
    assert sorted(left) == ["Centre of Pressure Pad", "Centre of Pressure Pad 2"]
    kinds = {name: [block.name for block in getattr(bpy.data, name)] for name in ("node_groups", "materials")}
    assert all("indentation" in name or "smoothing" in name for name in kinds["node_groups"])  # no group of arrows
    assert not [name for name in kinds["materials"] if "Arrow" in name]
    assert end_of_colours(pad) == pytest.approx(0.25)


def test_views_that_change_colours_get_the_overlay(shown):
    scene, *_ = shown
    scene.view_settings.view_transform = "Standard"
    assert overlays.shows_colors_as_they_are(scene)
    scene.view_settings.exposure = 1.0
    assert not overlays.shows_colors_as_they_are(scene)
    scene.view_settings.exposure, scene.view_settings.view_transform = 0.0, "AgX"
    assert not overlays.shows_colors_as_they_are(scene)


def test_arrows_of_a_lost_image_do_not_show(shown):
    scene, pad, _ = shown
    assert texel_arrows.KINDS.keys() <= ALL
    image = materials.find_block(bpy.data.images, pad.palpate.uid)
    image.filepath = image.filepath.replace("palpate-bake", "lost")
    image.reload()
    scene.frame_set(7)
    scene.frame_set(8)
    assert instances(find_marker(scene.objects, pad.palpate.uid, "NORMALS")) == []


@pytest.mark.parametrize("end", ["read", "stopped"])
def test_arrows_rest_while_a_bake_reads_the_scene(shown, end):
    scene, pad, _ = shown
    own = [find_marker(scene.objects, pad.palpate.uid, kind).modifiers[ARROWS_MODIFIER] for kind in texel_arrows.KINDS]
    own[1].show_viewport = False  # as the user left it
    work = bake(scene)
    for _ in range(3):
        next(work)
        assert not any(modifier.show_viewport for modifier in own)
    if end == "read":
        while next(work).stage == "Reading the scene":
            pass
    else:
        work.close()
    assert [modifier.show_viewport for modifier in own] == [True, False]
    work.close()


@pytest.mark.parametrize(
    ("kind", "solid", "wireframe", "expected"),
    [
        ("SOLID", True, False, True),
        ("SOLID", False, True, False),
        ("WIREFRAME", False, True, True),
        ("WIREFRAME", True, False, False),
        ("MATERIAL", True, True, False),
    ],
)
def test_heat_maps_are_drawn_through_objects_in_x_ray(scene, kind, solid, wireframe, expected):
    """Blender keeps one X-ray switch for Solid and one for Wireframe; Material Preview has none."""
    space = next(area.spaces.active for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D")
    space.shading.type, space.shading.show_xray, space.shading.show_xray_wireframe = kind, solid, wireframe
    assert not scene.palpate.show_through
    assert overlays.draws_through(scene, space) == expected
    scene.palpate.show_through = True
    assert overlays.draws_through(scene, space)


# --- full copies of a baked scene


@pytest.fixture
def scenes(tmp_path):
    """Return a baked scene with every marker, and its full copy by Scene › New."""
    original, *_ = press(frames=3)
    original.palpate.overlays = ALL
    baked(original, tmp_path)
    bpy.ops.scene.new(type="FULL_COPY")
    return original, bpy.context.scene


def marker_names(scene):
    return sorted(obj.name for obj in scene.objects if markers.KIND_KEY in obj)


def owners(scene):
    return {obj[materials.SENSOR_KEY] for obj in scene.objects if markers.KIND_KEY in obj}


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
