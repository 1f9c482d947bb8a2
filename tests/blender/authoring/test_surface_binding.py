# SPDX-License-Identifier: GPL-3.0-or-later
"""Laid texels on surfaces that change their shape, and what they keep when they are laid again."""

import bpy
import numpy as np
import pytest
from blender_scenes import ball, grid, keyframe, problems_of, reopen, save, scenario_of, scene_of, start_of

from palpate.addon.authoring import laid_sensors, surface_binding
from palpate.addon.scene import mesh_arrays


def finger():
    """A sheet of 40 mm with a shape key that bends and stretches it over frames 1 to 11."""
    obj = grid("Sheet", size=0.04)
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Bent", from_mix=False)
    for point, vertex in zip(key.data, obj.data.vertices, strict=True):
        x, y, _ = vertex.co
        point.co = (1.2 * x, y + 0.1 * x, 0.01 + 12.0 * x * x + 3.0 * x * y)
    keyframe(key, "value", {1: 0.0, 11: 1.0})
    scene_of(11).frame_set(1)
    return obj


def shapes(obj):
    """(frames, n, 9) where the texels of a sensor are, as the solver gets it."""
    target = ball("Target", (0.0, 0.0, 1.0))
    target.palpate.role = "TARGET"
    scenario = scenario_of(bpy.context.scene)
    bpy.data.objects.remove(target)
    return next(s for s in scenario.sensors if s.name == obj.name).deformation.values


def lay(carrier, **settings):
    bpy.context.view_layer.objects.active = carrier
    assert bpy.ops.palpate.skin_add(source="MESH", **settings) == {"FINISHED"}
    return bpy.context.object


@pytest.mark.parametrize("laid_at", [1, 6])
def test_laid_texels_move_as_the_vertices_under_them(laid_at):
    carrier = finger()
    bpy.context.scene.frame_set(laid_at)
    skin = lay(carrier, method="VERTICES")
    assert surface_binding.is_bound(skin)
    bpy.context.scene.frame_set(1)
    laid = shapes(skin)
    skin.palpate.role = "NONE"
    carrier.palpate.role = "SENSOR"
    own = shapes(carrier)
    assert laid.shape == own.shape
    assert np.ptp(own[:, :, 2], axis=0).max() > 0.005
    assert laid[:, :, :3] == pytest.approx(own[:, :, :3], abs=2e-7)  # Blender keeps vertices in single precision
    assert laid[:, :, 3:6] == pytest.approx(own[:, :, 3:6], abs=2e-4)


@pytest.mark.parametrize("lift", [0.0, 0.0005])
def test_texels_between_vertices_keep_their_place_in_the_triangle_under_them(lift):
    carrier = finger()
    skin = lay(carrier, method="ARRAY", rows=6, columns=5, lift=lift)
    found = shapes(skin)
    triangles = mesh_arrays.read_arrays(carrier.data).triangles
    flat = mesh_arrays.vertices(carrier.data)
    bent = np.array([point.co for point in carrier.data.shape_keys.key_blocks["Bent"].data])
    for start, end in zip(found[0, :, :3], found[-1, :, :3], strict=True):
        a, b, c = (flat[triangles[:, i]] for i in range(3))
        # shares by solving for each triangle; the one that the texel is in has none below zero
        system = np.stack([(b - a)[:, :2], (c - a)[:, :2]], axis=2)
        shares = np.linalg.solve(system, (start[:2] - a[:, :2])[:, :, None])[:, :, 0]
        inside = np.argmax(np.minimum(shares.min(axis=1), 1 - shares.sum(axis=1)))
        a, b, c = bent[triangles[inside]]
        u, v = shares[inside]
        normal = np.cross(b - a, c - a)
        assert end == pytest.approx(a + u * (b - a) + v * (c - a) + lift * normal / np.linalg.norm(normal), abs=2e-6)


def test_a_rigid_surface_binds_nothing_and_one_that_bends_later_says_so(tmp_path):
    carrier = grid("Sheet", size=0.04)
    skin = lay(carrier, method="GRID", spacing=0.004)
    assert not skin.modifiers
    carrier.modifiers.new("Wave", "WAVE")
    bpy.context.view_layer.objects.active = skin
    assert problems_of(skin) == ["STILL"]
    assert bpy.ops.palpate.fix(kind="STILL") == {"FINISHED"}
    assert surface_binding.is_bound(skin)
    assert problems_of(skin) == []
    reopen(save(tmp_path))
    assert surface_binding.is_bound(bpy.data.objects["Sheet Skin"])


def test_what_is_painted_on_a_skin_stays_when_it_is_laid_anew():
    """Weights and factors that are linear on a flat sheet are the same linear function of the new texels' places."""
    carrier = grid("Sheet", size=0.04)
    skin = lay(carrier, method="GRID", spacing=0.0045)
    group = skin.vertex_groups.new(name="Tip")
    for vertex in skin.data.vertices:
        group.add([vertex.index], 0.5 + 20.0 * vertex.co.x, "REPLACE")
    factors = [2.0 + 30.0 * vertex.co.y for vertex in skin.data.vertices]
    skin.data.attributes.new("factors", "FLOAT", "POINT").data.foreach_set("value", factors)
    skin.palpate.k_map, skin.palpate.friction_map = "Tip", "factors"
    skin.palpate.skin.spacing = 0.003
    before = len(skin.data.vertices)
    assert bpy.ops.palpate.skin_update() == {"FINISHED"}
    assert len(skin.data.vertices) > 1.5 * before
    for vertex in skin.data.vertices:
        x, y, _ = vertex.co
        if max(abs(x), abs(y)) < 0.015:  # beyond the outermost old texels there is nothing but the nearest
            assert skin.vertex_groups["Tip"].weight(vertex.index) == pytest.approx(0.5 + 20.0 * x, abs=1e-5)
            assert skin.data.attributes["factors"].data[vertex.index].value == pytest.approx(2.0 + 30.0 * y, abs=1e-5)
    assert (skin.palpate.k_map, skin.palpate.friction_map) == ("Tip", "factors")


def test_a_part_that_was_left_out_stays_out():
    carrier = grid("Sheet", size=0.04)
    skin = lay(carrier, method="GRID", spacing=0.005)
    group = skin.vertex_groups.new(name="Half")
    group.add([v.index for v in skin.data.vertices if v.co.x > 0], 1.0, "REPLACE")
    skin.palpate.region, skin.palpate.vertex_group = "GROUP", "Half"
    bpy.ops.palpate.skin_update()
    ball("Target", (0.0, 0.0, 1.0)).palpate.role = "TARGET"
    assert -0.003 < start_of(bpy.context.scene).scenario.sensors[0].texels.position[:, 0].min() < 0.003
    assert laid_sensors.is_laid(skin)
