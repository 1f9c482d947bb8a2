# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says about a sensor: counts, area, density, time step, and every problem with the button that fixes it."""

import bpy
import numpy as np
import pytest
from blender_scenes import ball, cube, grid, press_and_drop, problems_of, refusal, report_of, start_of

from palpate.addon.authoring import problems, texel_overlay
from palpate.core.solver.time_step_adviser import advise


def sensor(obj):
    bpy.context.view_layer.objects.active = obj
    bpy.ops.palpate.sensor_add(source="MESH")
    obj.palpate.max_penetration = 0.001
    return obj


def fix(obj, kind):
    bpy.context.view_layer.objects.active = obj
    assert bpy.ops.palpate.fix(kind=kind) == {"FINISHED"}


def test_counts_area_and_density():
    pad = sensor(grid(size=0.05))
    report = report_of(pad)
    assert not report.problems
    assert len(report.texels) == 84
    assert report.area == pytest.approx(0.05 * 0.05, rel=1e-6)
    assert report.density == pytest.approx(84 / 25, rel=1e-6)


def test_stability_limit_and_step_are_those_of_the_scene():
    scene, pad, *_ = press_and_drop()
    report = report_of(pad)
    assert report.advice == advise(start_of(scene).scenario)
    assert 0 < report.advice.dt < report.advice.limit < 1.0


def test_a_scene_that_makes_no_run_says_what_is_missing():
    assert "give at least one other object the role Target" in report_of(sensor(grid())).missing


def test_a_painted_vertex_below_a_subdivision_names_the_modifier_at_once():
    obj = sensor(cube())
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 4
    group = obj.vertex_groups.new(name="Painted")
    group.add([0], 1.0, "REPLACE")
    obj.palpate.region, obj.palpate.vertex_group = "GROUP", "Painted"
    assert problems_of(obj) == ["REGION", "MODIFIER"] and "Subdivision" in report_of(obj).problems[1].text
    fix(obj, "MODIFIER")
    assert "MODIFIER" not in problems_of(obj)


def hide_collection(target):
    collection = bpy.data.collections.new("Objects")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(target)
    bpy.context.scene.collection.objects.unlink(target)
    bpy.context.view_layer.layer_collection.children[0].exclude = True


@pytest.mark.parametrize(
    "hide",
    [lambda target: target.hide_set(True), lambda target: setattr(target, "hide_viewport", True), hide_collection],
    ids=["H", "monitor", "collection"],
)
def test_a_hidden_target_is_named_and_shown(hide):
    pad, target = sensor(grid()), ball()
    target.palpate.role = "TARGET"
    bpy.context.view_layer.update()
    hide(target)
    problem = report_of(pad).problems[0]
    assert problem.kind == "HIDDEN" and problem.text.startswith("'Ball' is hidden and is not part of the simulation. Nothing")
    fix(pad, "HIDDEN")
    assert target.visible_get() and report_of(pad).advice is not None and problems_of(pad) == []


def test_a_target_in_an_instance_of_a_collection_is_named():
    pad, target = sensor(grid()), ball()
    target.palpate.role = "TARGET"
    collection = bpy.data.collections.new("Asset")
    collection.objects.link(target)
    bpy.context.scene.collection.objects.unlink(target)
    bpy.ops.object.collection_instance_add(collection="Asset")
    missing = report_of(pad).missing
    assert missing.startswith("'Asset' shows an instance of 'Ball', which is not part of the simulation: use Object")


def flip(obj, faces):
    for index in faces:
        obj.data.polygons[index].flip()
    obj.data.update()


def join(one, other):
    for obj in (one, other):
        obj.select_set(True)
    bpy.context.view_layer.objects.active = one
    bpy.ops.object.join()


def flipped_face():
    obj = sensor(cube(size=0.05))
    flip(obj, [2])
    return obj


def inside_out():
    obj = sensor(ball(radius=0.02))
    flip(obj, range(len(obj.data.polygons)))
    return obj


def laid_skin():
    carrier = ball(radius=0.02)
    bpy.ops.palpate.skin_add(source="MESH", method="NOISE", spacing=0.008)
    bpy.context.object.palpate.max_penetration = 0.001
    assert problems_of(bpy.context.object) == []
    return carrier, bpy.context.object


def skin_that_faces_its_carrier():
    _, skin = laid_skin()
    flip(skin, range(len(skin.data.polygons)))
    return skin


def thin_plate():
    plate = cube(size=0.05)
    plate.scale = (1, 1, 0.04)  # 2 mm
    sensor(plate).palpate.max_penetration = 0.012
    return plate


def subdivided():
    obj = sensor(grid(columns=4, rows=4))
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1
    return obj


def group_that_is_gone():
    pad = sensor(grid())
    pad.palpate.region, pad.palpate.vertex_group = "GROUP", "Gone"
    return pad


PROBLEMS = {
    flipped_face: "NORMALS",
    inside_out: "FLIPPED",
    skin_that_faces_its_carrier: "FLIPPED",
    thin_plate: "THROUGH",
    subdivided: "MODIFIER",
    group_that_is_gone: "REGION",
}
"""Problems, by what makes a sensor that has this one alone."""


@pytest.mark.parametrize("made", PROBLEMS, ids=lambda made: made.__name__)
def test_a_problem_is_named_and_its_button_fixes_it(made):
    obj = made()
    assert problems_of(obj) == [PROBLEMS[made]]
    fix(obj, PROBLEMS[made])
    assert problems_of(obj) == []


def test_texels_inside_the_object_are_left_out():
    """Two balls that overlap, joined: what is inside the other never touches anything."""
    one = ball("One", (0, 0, 0), 0.02)
    join(one, ball("Other", (0.015, 0, 0), 0.02))
    (problem,) = report_of(sensor(one)).problems
    points = np.array([v.co for v in one.data.vertices])
    depth = np.array([0.02 - np.linalg.norm(points - centre, axis=1) for centre in ((0, 0, 0), (0.015, 0, 0))])
    inside = (depth > 4e-4).any(axis=0)  # below the facets
    assert problem.kind == "INSIDE" and set(np.flatnonzero(inside)) <= set(problem.texels)
    fix(one, "INSIDE")
    assert one.palpate.region == "GROUP" and "INSIDE" not in problems_of(one)


def test_texels_one_upon_another_are_merged():
    one = grid("One")
    join(one, grid("Other", (0.00005, 0, 0.00001)))
    found = {problem.kind: problem for problem in report_of(sensor(one)).problems}
    assert len(found["OVERLAP"].texels) == 84
    fix(one, "OVERLAP")
    assert "OVERLAP" not in problems_of(one) and len(one.data.vertices) == 84


def test_a_joined_mesh_is_asked_about():
    pad = sensor(grid())
    join(pad, cube())
    found = {problem.kind: problem for problem in report_of(pad).problems}
    assert "had 84 vertices" in found["GROWN"].text
    fix(pad, "GROWN")
    assert "GROWN" not in problems_of(pad)


def test_a_renamed_group_offers_the_active_one():
    pad = sensor(grid())
    pad.palpate.region, pad.palpate.vertex_group = "GROUP", "Tip"
    group = pad.vertex_groups.new(name="Tip")
    group.add(range(20, 60), 1.0, "REPLACE")
    before = len(report_of(pad).texels)
    group.name = "Finger Tip"
    assert "was it renamed?" in report_of(pad).problems[0].text
    fix(pad, "GROUP")
    assert problems_of(pad) == []
    assert (pad.palpate.vertex_group, len(report_of(pad).texels)) == ("Finger Tip", before)


def test_what_is_not_the_regions_fault_leaves_the_region():
    """A lost painted group and a missing UV map have buttons of their own, and the region stays."""
    pad = sensor(grid())
    group = pad.vertex_groups.new(name="Tip")
    group.add(range(20, 60), 1.0, "REPLACE")
    pad.palpate.region, pad.palpate.vertex_group = "GROUP", "Tip"
    pad.palpate.k_map, pad.palpate.gain_map = "Gone", "Tip"
    assert "Painted Stiffness" in report_of(pad).problems[0].text
    fix(pad, "PAINTED")
    assert (pad.palpate.k_map, pad.palpate.gain_map) == ("", "Tip")
    for layer in list(pad.data.uv_layers):
        pad.data.uv_layers.remove(layer)
    pad.palpate.image_layout = "UV"
    fix(pad, "IMAGE")
    assert problems_of(pad) == []
    assert pad.palpate.region == "GROUP"
    pad.palpate.mus = 0.1  # below the dynamic one: told, and no button guesses a value
    pad.palpate.mud = 0.2
    assert not set(problems_of(pad)) & set(problems.FIXES)


def test_an_outdated_skin_is_laid_anew_and_an_orphan_stands_alone():
    carrier, skin = laid_skin()
    for vertex in carrier.data.vertices:
        vertex.co *= 1.2
    assert "OUTDATED" in problems_of(skin)
    fix(skin, "OUTDATED")
    assert problems_of(skin) == []
    skin.parent = None
    assert problems_of(skin) == ["ORPHAN"]
    fix(skin, "ORPHAN")
    assert skin.palpate.body == "KEYFRAMED" and problems_of(skin) == []


def test_every_problem_has_a_button_with_a_name():
    assert all(label and call for label, call in problems.FIXES.values())
    pad = sensor(grid())
    bpy.context.view_layer.objects.active = pad
    assert "no longer has this problem" in refusal(bpy.ops.palpate.fix, kind="FLIPPED")


def test_what_is_drawn_is_where_the_texels_are():
    pad = sensor(grid(size=0.05))
    report = report_of(pad)
    drawing = texel_overlay.drawing_of(report)
    assert drawing.labels[0][0] == "0,0"
    assert drawing.labels[83][0] == "13,5"
    assert [place[:2] for _, place in drawing.labels] == pytest.approx(report.texels.position[:, :2], abs=1e-9)
    deep = drawing.lines["reach"].reshape(-1, 2, 3)
    assert deep[:, 0, 2] - deep[:, 1, 2] == pytest.approx(0.001, rel=1e-6)
    up = drawing.lines["normals"].reshape(-1, 2, 3)
    assert (up[:, 1, 2] > up[:, 0, 2]).all()
    assert len(drawing.spots["faulty"]) == 0
    assert len(drawing.spots["fine"]) == 84 * texel_overlay.DISC_SIDES * 3
