# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface of a baked sensor is displaced by its penetration; what reads the scene, and the user's mesh, are unaffected."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, ball, changes, dump, grid, keyframe, play_to, press, press_and_drop, reopen, save, surface

from palpate.addon.display import indentation, materials, overlays, played_table
from palpate.addon.scene import mesh_arrays
from palpate.addon.scene.stored_names import INDENTATION_MODIFIER
from palpate.addon.session import frame_status
from palpate.core.figures.figure_style import FigureStyle


def press_wide(frames=6):
    """A ball of 40 mm that is pressed 3 mm deep into a turned, stretched pad of 16 by 16 texels."""
    scene, pad = bpy.context.scene, grid(columns=16, rows=16)
    scene.frame_end = frames
    target = ball(location=(0.0, 0.0, 0.0405), radius=0.04, segments=128)
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    pad.scale, pad.rotation_euler = (1.0, 0.8, 1.3), (0.0, 0.0, 0.4)
    keyframe(target, "location", {1: (0.0, 0.0, 0.0405), frames: (0.0, 0.0, 0.037)})
    scene.frame_set(1)
    return scene, pad, target


def test_the_surface_lies_where_the_ball_is(tmp_path):
    """Also between the texels: nowhere does the ball cut deeper than a tenth of its penetration into the surface."""
    scene, pad, target = press_wide()
    result = baked(scene, tmp_path)
    before = surface(pad)
    assert np.ptp(before[:, 2]) < 1e-9  # at the first frame nothing touches
    scene.frame_set(6)
    after = surface(pad)
    assert len(after) > 14 * len(pad.data.vertices)
    depth = result.recording.at(6).sensors["Pad"].depth
    assert -after[:, 2].min() == pytest.approx(depth.max(), rel=0.03)
    distance = np.linalg.norm(after - np.array(target.matrix_world.translation), axis=1)
    assert (0.04 - distance).max() < 0.1 * depth.max()
    outside = np.hypot(*(after[:, :2] - np.array(target.matrix_world.translation)[:2]).T) > 0.022
    assert np.abs(after[outside, 2]).max() < 0.02 * depth.max()
    scene.frame_set(5, subframe=0.5)  # between two frames the surface is between theirs
    half = surface(pad)[:, 2].min()
    assert after[:, 2].min() < half < -0.5 * depth.max()


def test_the_scene_reads_as_without(tmp_path):
    """A second bake gives the same bits, and no frame of the first is called out of date."""
    scene, pad, *_ = press_and_drop(frames=6)
    first = baked(scene, tmp_path)
    for frame in (1, 4, 6):
        scene.frame_set(frame)
        assert frame_status.status_of(scene).text == f"Frame {frame} of the bake."
    assert INDENTATION_MODIFIER in pad.modifiers
    with mesh_arrays.evaluated_mesh(pad, bpy.context.evaluated_depsgraph_get()) as mesh:
        assert np.array_equal(mesh_arrays.positions(mesh), mesh_arrays.positions(pad.data))
        assert np.array_equal(mesh_arrays.corner_vertices(mesh), mesh_arrays.corner_vertices(pad.data))
        assert len(mesh.polygons) == len(pad.data.polygons)
    second = baked(scene)
    assert first.recording.digest == second.recording.digest
    for name, sensor in first.recording.sensors.items():
        assert np.array_equal(sensor.normal_force, second.recording.sensors[name].normal_force)


def test_a_sensor_that_deforms_is_not_stale(tmp_path):
    scene, pad, _ = press()
    pad.shape_key_add(name="Basis")
    key = pad.shape_key_add(name="Bent")
    for i, vertex in enumerate(pad.data.vertices):
        key.data[i].co.z = 5.0 * vertex.co.x**2
    keyframe(key, "value", {1: key.value, 8: 0.5})
    scene.frame_set(1)
    save(tmp_path)
    plain = mesh_arrays.evaluated_fingerprint(pad, bpy.context.evaluated_depsgraph_get())
    result = baked(scene)
    assert result.scenario.sensors[0].deformation is not None
    assert mesh_arrays.evaluated_fingerprint(pad, bpy.context.evaluated_depsgraph_get()) == plain
    scene.frame_set(8)
    assert frame_status.status_of(scene).text == "Frame 8 of the bake."
    depth = result.recording.at(8).sensors["Pad"].depth.max()
    with mesh_arrays.evaluated_mesh(pad, bpy.context.evaluated_depsgraph_get()) as mesh:
        rest = mesh_arrays.vertices(mesh)
    moved = rest - surface(pad)[: len(rest)]
    assert np.linalg.norm(moved, axis=1).max() == pytest.approx(depth, rel=0.25)  # under three by three texels


def test_factor_and_checkbox_are_applied_and_nothing_is_left(tmp_path):
    scene, pad, _ = press()
    bpy.ops.palpate.reset()
    save(tmp_path)
    before = dump()
    baked(scene)
    scene.frame_set(8)
    once = -surface(pad)[:, 2].min()
    scene.palpate.indentation_factor = 3.0
    assert bpy.ops.palpate.display_refresh() == {"FINISHED"}
    assert -surface(pad)[:, 2].min() == pytest.approx(3.0 * once, rel=1e-4)
    assert indentation.factor_of(pad) == 3.0
    save(tmp_path)
    scene = reopen(tmp_path / "scene.blend")
    pad = scene.objects["Pad"]
    assert -surface(pad)[:, 2].min() == pytest.approx(3.0 * once, rel=1e-4)
    scene.palpate.show_indentation = False
    assert bpy.ops.palpate.display_refresh() == {"FINISHED"}
    assert np.ptp(surface(pad)[:, 2]) < 1e-9 and indentation.factor_of(pad) == 0.0
    assert not [image.name for image in bpy.data.images if "depth" in image.name]
    scene.palpate.show_indentation, scene.palpate.indentation_factor = True, 1.0
    assert bpy.ops.palpate.display_refresh() == {"FINISHED"}
    scene.frame_set(1)
    assert bpy.ops.palpate.bake_clear() == {"FINISHED"}
    assert [line for line in changes(before, dump()) if "baked_" not in line and "settings" not in line] == []


def test_two_sensors_share_a_mesh(tmp_path):
    """Each is displaced by its own penetration."""
    scene, pad, _ = press()
    other = pad.copy()
    scene.collection.objects.link(other)
    other.name, other.location = "Other", (0.0, 0.3, 0.0)
    plate = ball("Second", (0.005, 0.3, 0.007))
    plate.palpate.role = "TARGET"
    result = baked(scene, tmp_path)
    scene.frame_set(8)
    assert pad.data == other.data
    for obj in (pad, other):
        depth = result.recording.at(8).sensors[obj.name].depth.max()
        assert depth > 0.0 and -surface(obj)[:, 2].min() == pytest.approx(depth, rel=0.25)


def test_modifiers_that_add_vertices_leave_the_surface_as_it_is(tmp_path):
    scene, pad, _ = press()
    pad.modifiers.new("Subdivision", "SUBSURF")
    baked(scene, tmp_path)
    assert INDENTATION_MODIFIER not in pad.modifiers


def test_long_bakes_keep_every_second_frame(tmp_path, monkeypatch):
    scene, pad, _ = press()
    monkeypatch.setattr(played_table, "MOST_PIXELS", 4)
    result = baked(scene, tmp_path)
    image = next(image for image in bpy.data.images if image.name.endswith("depth"))
    width, height = image.size
    assert width * height <= 4 and height == 4
    scene.frame_set(7)  # the last that is kept
    depth = result.recording.at(7).sensors["Pad"].depth.max()
    assert -surface(pad)[:, 2].min() == pytest.approx(depth, rel=0.25)


def test_the_overlay_of_solid_view_is_indented_as_the_texels_are(tmp_path):
    scene, pad, _ = press_wide()
    result = baked(scene, tmp_path)
    scene.frame_set(6)
    made = type("Bake", (), {})()
    made.recording, made.texels = result.recording, {"Pad": result.scenario.sensors[0].texels}
    made.manifests = {"Pad": type("Manifest", (), {"body": ""})()}
    (overlay,) = overlays.baked_overlays(scene, made, 6, FigureStyle(limit=1.0).scale(made.recording, made.texels))
    assert_indented(overlay, made.texels["Pad"], result.recording.at(6).sensors["Pad"].depth)


def assert_indented(overlay, texels, depth):
    """The pad lies in the plane z = 0: both sides of its overlay are as deep as the texels at their corners."""
    corner = texels.layout.triangles.ravel()
    below, above = np.split(overlay.corners.astype(float), 2)
    below = below.reshape(-1, 3, 3)[:, ::-1].reshape(-1, 3)  # its faces are turned downwards
    assert np.linalg.norm(above - below, axis=1) == pytest.approx(2 * overlays.LIFT * 0.05, rel=1e-3)
    assert -0.5 * (above + below)[:, 2] == pytest.approx(np.maximum(depth, 0.0)[corner], abs=1e-7)
    assert np.abs(np.abs(overlay.at_rest[:, 2]) - overlays.LIFT * 0.05).max() < 1e-6


def playing(scene, last):
    """Play to a frame; return the overlay of the only sensor and the run."""
    run = play_to(scene, last)
    (overlay,) = overlays.sensor_overlays(scene, run, run.frames[last])
    return overlay, run


def test_while_playing_the_surface_gives_way_without_a_change_of_the_scene(tmp_path):
    scene, pad, _ = press_wide()
    save(tmp_path)
    scene.frame_set(6)
    scene.frame_set(1)
    before = dump()
    overlay, run = playing(scene, 6)
    scene.frame_set(1)
    assert_indented(overlay, run.scenario.sensors[0].texels, run.frames[6].sensors["Pad"].depth)
    dark = overlay.colors[:, :3].max(axis=1) / np.maximum(flat_colors(scene, run), 1e-9)
    assert dark.min() >= materials.GLOW - 1e-3 and dark.max() <= 1.0 + 1e-3 and np.ptp(dark) > 0.02
    assert [line for line in changes(before, dump()) if "baked_" not in line and "settings" not in line] == []


def flat_colors(scene, run):
    """Return the largest of red, green and blue of each corner of an overlay without indentation."""
    scene.palpate.show_indentation = False
    (plain,) = overlays.sensor_overlays(scene, run, run.frames[6])
    up = np.cross(*np.diff(plain.corners.reshape(-1, 3, 3), axis=1).transpose(1, 0, 2))[:, 2] > 0.0
    assert np.array_equal(up, np.arange(len(up)) >= len(up) / 2)  # seen from both sides where the backs of faces are not drawn
    assert plain.at_rest is None and np.ptp(plain.corners[:, 2]) < 1.01 * 2 * overlays.LIFT * 0.05
    scene.palpate.show_indentation = True
    return plain.colors[:, :3].max(axis=1)


@pytest.mark.parametrize("how", ["modifier", "laid"])
def test_sensors_whose_surface_stays_stay_while_playing(how):
    scene, pad, _ = press()
    if how == "modifier":
        pad.modifiers.new("Subdivision", "SUBSURF")
    else:
        pad.palpate.skin.method = "VERTICES"
    overlay, run = playing(scene, 8)
    assert run.frames[8].sensors["Pad"].depth.max() > 0.0
    assert overlay.at_rest is None


def test_playing_does_not_bring_the_scene_up_to_date():
    """An update inside a frame change is reported as a change of its own, for which a window drops the run and starts again."""
    scene, pad, target = press_wide()
    pad.modifiers.new("Smooth", "SMOOTH")
    _, run = playing(scene, 3)
    reports = []
    bpy.app.handlers.depsgraph_update_post.append(lambda *_: reports.append(1))
    try:
        target.location.x = 0.01
        (overlay,) = overlays.sensor_overlays(scene, run, run.frames[3])
        assert overlay.at_rest is not None and not reports
        bpy.context.view_layer.update()
        assert reports  # the change was waiting
    finally:
        bpy.app.handlers.depsgraph_update_post.pop()


FAN = [[0, 1, 2], [0, 2, 3, 4, 5], [0, 5, 6, 7], [0, 7, 1]]
"""Triangles, a pentagon and a quad around a vertex."""


def test_a_sensor_of_any_faces_is_indented(scene, tmp_path):
    """Every part of the finer surface moves with the texels around it: the two subdivisions number their vertices alike."""
    scene.frame_end = 2
    ring = [(np.cos(turn), np.sin(turn)) for turn in np.radians([0, 50, 100, 150, 200, 250, 300])]
    mesh = bpy.data.meshes.new("Fan")
    mesh.from_pydata([(0, 0, 0), *((0.02 * x, 0.02 * y, 0.0) for x, y in ring)], [], FAN)
    pad = bpy.data.objects.new("Fan", mesh)
    scene.collection.objects.link(pad)
    ball(location=(0.0, 0.0, 0.006)).palpate.role, pad.palpate.role = "TARGET", "SENSOR"
    result = baked(scene, tmp_path)
    scene.frame_set(2)
    depth = result.recording.at(2).sensors["Fan"].depth
    assert (depth > 1e-3).sum() == 1, "only the vertex in the middle is touched"
    found = surface(pad)
    away = np.linalg.norm(found[:, :2], axis=1)
    assert len(found) > 100 and away[np.argmin(found[:, 2])] < 1e-6
    assert -found[:, 2].min() == pytest.approx(depth.max(), rel=0.35)
    order = np.argsort(away)
    assert found[order[:8], 2].mean() < found[order[-30:], 2].mean() - 0.3 * depth.max()
