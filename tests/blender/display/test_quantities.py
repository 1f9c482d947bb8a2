# SPDX-License-Identifier: GPL-3.0-or-later
"""Every quantity of the table is seen in every place: live and baked heat map, inset, panel and Workbench, on one scale."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, node_of, play_to, press, reopen, save, scene_with_readings

from palpate.addon.authoring import texel_overlay
from palpate.addon.display import bake_display, baked_scene, heat_map, materials, overlays
from palpate.addon.properties import scene_properties
from palpate.addon.render import figure_export, workbench_colors
from palpate.addon.scene import mesh_arrays
from palpate.addon.scene.stored_names import GAP_COLORS
from palpate.core.errors import PalpateError
from palpate.core.figures import color_maps
from palpate.core.figures.figure_style import FigureStyle
from palpate.core.figures.quantities import QUANTITIES, between
from palpate.panels import sensor as sensor_panel

EVERY = pytest.mark.parametrize("name", QUANTITIES)


def both_sides(texels):
    """Return the texels at the corners of an overlay: the lower side comes first, and its faces are turned downwards."""
    return np.concatenate([texels.layout.triangles[:, ::-1].ravel(), texels.layout.triangles.ravel()])


def expected_colors(quantity, felt, texels, scale):
    share = (quantity.values(felt, texels) - scale.low) / (scale.high - scale.low)
    return color_maps.colors(scale.colour_map, share)


@EVERY
def test_it_is_seen_while_playing(name):
    scene = scene_with_readings()
    scene.palpate.quantity, scene.palpate.show_indentation = name.upper(), False
    run = play_to(scene, 8)
    frame, texels, quantity = run.frames[8], run.scenario.sensors[0].texels, QUANTITIES[name]
    values = np.array([quantity.values(run.frames[number].sensors["Pad"], texels) for number in range(1, 9)])
    scale = overlays.live_scale(scene, run)
    assert np.ptp(values) > 0.0
    assert scale.low <= values.min() and values.max() <= scale.high and scale.unit == quantity.unit_of(frame.sensors["Pad"])
    colors = expected_colors(quantity, frame.sensors["Pad"], texels, scale)
    (overlay,) = overlays.sensor_overlays(scene, run, frame)
    assert overlay.colors[:, :3] == pytest.approx(colors[both_sides(texels)], abs=1e-6)
    content = overlays.inset_content(scene, run, frame)
    assert content.scale == scale and scale.unit in content.scale.words(scale.high)
    pixels = content.insets[0].pixels
    rows, columns = texels.layout.shape
    size = pixels.shape[0] // rows
    shown = pixels[size // 2 :: size, size // 2 :: size, :3][texels.layout.row, texels.layout.column]
    assert shown == pytest.approx(colors, abs=1e-6)


@EVERY
def test_it_is_seen_on_a_bake(tmp_path, name):
    scene, quantity = scene_with_readings(), QUANTITIES[name]
    pad, scene.palpate.quantity = scene.objects["Pad"], name.upper()
    baked(scene, tmp_path)
    found = figure_export.read_scene_bake(scene)
    scale = bake_display.figure_style(scene).scale(found.recording, found.texels)
    node = node_of(pad, "ShaderNodeMapRange")
    ends = [node.inputs[key].default_value for key in ("From Min", "From Max")]
    assert ends == pytest.approx([scale.low, scale.high]) and scale.unit in node.label and quantity.title in node.label
    felt, texels = found.recording.at(7).sensors["Pad"], found.texels["Pad"]
    if quantity.channel != materials.IMAGE_CHANNEL:
        scene.frame_set(7)
        mesh = pad.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        place = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.attributes[materials.attribute_of(quantity)].data.foreach_get("vector", place.ravel())
        image = next(image for image in bpy.data.images if image.name == f"Palpate Pad {name}")
        pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)[..., 0]
        # a material shows the pixel that is nearest: one colour per texel, also beside its vertex
        for shift in (-0.4, 0.0, 0.4):
            column, row = (place[texels.vertex, :2] * image.size + shift).astype(int).T
            values = quantity.values(felt, texels)
            assert pixels[row, column] == pytest.approx(values, rel=1e-5, abs=1e-5 * np.abs(values).max())
        texture = node_of(pad, "ShaderNodeTexImage")
        assert texture.image == image and texture.interpolation == "Closest"
    colors = expected_colors(quantity, felt, texels, scale)
    assert np.ptp([quantity.values(found.recording.sensors["Pad"].at(i), texels) for i in (0, 6)]) > 0.0
    (overlay,) = overlays.baked_overlays(scene, found, 7, scale)  # what Solid view shows
    assert overlay.plain_only and overlay.line is None
    corner = both_sides(texels)
    free = felt.depth[corner] == 0.0
    assert overlay.colors[free, :3] == pytest.approx(colors[corner][free], abs=1e-6)
    with workbench_colors.workbench_colors(baked_scene.bake_folders(scene), found, bake_display.figure_style(scene)) as show:
        show(7)
        attribute = pad.data.attributes[workbench_colors.COLOR_ATTRIBUTE]
        table = np.empty((len(attribute.data), 4), dtype=np.float32)
        attribute.data.foreach_get("color", table.ravel())
        vertices = mesh_arrays.corner_vertices(pad.data)
        place = {vertex: texel for texel, vertex in enumerate(texels.vertex.tolist())}
        at = [place[vertex] for vertex in vertices.tolist()]
        assert table[:, :3] == pytest.approx(color_maps.linear(colors)[at], abs=1e-6)
    heat_map.clear(pad)
    assert not [item.name for item in pad.data.attributes if "value_" in item.name]
    assert materials.find_block(bpy.data.images, f"{pad.palpate.uid}:{materials.TABLE}") is None


@EVERY
def test_the_panel_says_it(name, monkeypatch):
    scene = scene_with_readings()
    scene.palpate.quantity = name.upper()
    run = play_to(scene, 8)
    felt, texels = run.frames[8].sensors["Pad"], run.scenario.sensors[0].texels
    report = type("Report", (), {"texels": texels})
    monkeypatch.setattr(sensor_panel.sensor_report, "known_report", lambda *_: report)
    words = dict(sensor_panel._measured(bpy.context, felt))
    values = QUANTITIES[name].values(felt, texels)
    unit = QUANTITIES[name].unit_of(felt)
    assert words[QUANTITIES[name].title] == f"{values.min():.4g} to {values.max():.4g} {unit}"
    assert words["Reading"].endswith(" V")


@EVERY
def test_its_ends_are_set_in_its_own_unit(scene, name):
    own, quantity = scene.palpate, QUANTITIES[name]
    own.quantity, own.use_auto_range = name.upper(), False
    names = scene_properties.range_names(own)
    assert len(names) == 1 + (quantity.span is between)
    own.range_max, own.range_max_pressure = 0.15, 20.0  # names that older files have
    setattr(own, names[-1], 3.0)
    style = bake_display.figure_style(scene)
    assert style.limit == 3.0 and (style.lowest is None or style.lowest == 0.0)
    own.quantity = "PRESSURE" if name == "force" else "FORCE"
    assert bake_display.figure_style(scene).limit in (0.15, 20.0)


def test_the_automatic_range_is_that_of_the_present_run():
    """After a harder press the range is wide; softened again, it is narrow again, with Reset and without."""
    scene, pad, _ = press(8)
    ends = []
    for k in (100.0, 1000.0, 100.0):
        pad.palpate.k = k
        ends.append(overlays.live_scale(scene, play_to(scene, 8)).high)
    bpy.ops.palpate.reset()
    ends.append(overlays.live_scale(scene, play_to(scene, 8)).high)
    assert ends[0] == ends[2] == ends[3] and ends[1] > 5.0 * ends[0]


def test_a_sensor_without_channels_shows_none(tmp_path):
    scene, pad, _ = press(4)
    scene.palpate.quantity = "CHANNELS"
    run = play_to(scene, 4)
    assert overlays.sensor_overlays(scene, run, run.frames[4]) == []
    assert overlays.inset_content(scene, run, run.frames[4]).insets == []
    baked(scene, tmp_path)
    assert not any(slot.material and materials.SENSOR_KEY in slot.material for slot in pad.material_slots)
    found = figure_export.read_scene_bake(scene)
    with pytest.raises(PalpateError, match="without channels"):
        bake_display.figure_style(scene).scale(found.recording, found.texels)


def test_dots_of_texels_stand_on_no_colours():
    """Neither on a heat map nor on the errors of measurements, which Solid view shows as vertex colours."""
    scene, pad, _ = press(4)
    bpy.ops.palpate.reset()
    shading = type("Shading", (), {"type": "SOLID", "color_type": "MATERIAL"})
    assert not texel_overlay.hides_dots(scene, pad, shading)
    pad.data.color_attributes.active_color = pad.data.color_attributes.new(GAP_COLORS, "FLOAT_COLOR", "POINT")
    assert not texel_overlay.hides_dots(scene, pad, shading)
    shading.color_type = "VERTEX"
    assert texel_overlay.hides_dots(scene, pad, shading)
    pad.data.color_attributes.remove(pad.data.color_attributes[GAP_COLORS])
    assert not texel_overlay.hides_dots(scene, pad, shading)
    play_to(scene, 4)
    assert texel_overlay.hides_dots(scene, pad, shading)


def test_files_keep_their_choice_and_its_ends(scene, tmp_path):
    """A .blend stores the number of a choice and the names of the ends, which Palpate 0.1 has chosen."""
    items = scene.palpate.bl_rna.properties["quantity"].enum_items
    assert [(item.identifier, item.value) for item in items][:2] == [("FORCE", 0), ("PRESSURE", 1)]
    scene.palpate.quantity, scene.palpate.use_auto_range = "PRESSURE", False
    scene.palpate.range_max, scene.palpate.range_max_pressure = 0.25, 12.0
    path = save(tmp_path)
    own = reopen(path).palpate
    assert (own.quantity, own.range_max, own.range_max_pressure) == ("PRESSURE", 0.25, 12.0)
    assert bake_display.figure_style(bpy.context.scene).limit == 12.0


def test_a_heat_map_of_palpate_0_1_is_removed_with_its_areas(tmp_path):
    scene, pad, _ = press(4)
    baked(scene, tmp_path)
    uid = pad.palpate.uid
    pad.data.attributes.new("palpate_area", "FLOAT", "POINT")
    bpy.data.images.new("area", 4, 4)[materials.SENSOR_KEY] = f"{uid}:area"
    assert bpy.ops.palpate.bake_clear() == {"FINISHED"}
    assert pad.data.attributes.get("palpate_area") is None
    assert not [image.name for image in bpy.data.images if materials.SENSOR_KEY in image]


def test_a_heat_map_leaves_the_sensor_that_is_painted_alone():
    scene, pad, _ = press(4)
    run = play_to(scene, 4)
    (overlay,) = overlays.sensor_overlays(scene, run, run.frames[4])
    bpy.context.view_layer.objects.active = pad
    assert overlay.sensor == pad.session_uid and overlay.sensor not in overlays.edited_objects(bpy.context)
    for mode in ("WEIGHT_PAINT", "VERTEX_PAINT", "SCULPT"):
        bpy.ops.object.mode_set(mode=mode)
        assert overlay.sensor in overlays.edited_objects(bpy.context)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not overlays.edited_objects(bpy.context)


def test_a_picture_may_show_another_quantity_than_the_scene(tmp_path):
    """tests/core/figures tells the range that it has then."""
    scene, pad, _ = press(4)
    scene.palpate.use_auto_range, scene.palpate.range_max = False, 0.15
    baked(scene, tmp_path)
    found, style = figure_export.read_scene_bake(scene), FigureStyle(quantity="pressure")
    bake_display.take_style(scene, style)
    node, high = node_of(pad, "ShaderNodeMapRange"), style.scale(found.recording, found.texels).high
    assert node.inputs["From Max"].default_value == pytest.approx(high) and "kPa" in node.label
