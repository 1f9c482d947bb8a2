# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters as Blender presets, copied between sensors, and regions by material and face set."""

import re
from pathlib import Path

import bpy
import numpy as np
import pytest
from blender_scenes import baked, ball, grid, pad_sensor, press, refusal, save, start_of

from palpate.addon.authoring import laid_sensors
from palpate.addon.properties.parameter_properties import sensor_parameters
from palpate.addon.scene import mesh_arrays, participants, sensor_regions
from palpate.addon.timeline import live_cache
from palpate.core.errors import SensorError
from palpate.core.model.sensor_parameters import SensorParameters

PRESETS = sorted((laid_sensors.FOLDER / "palpate" / "sensor").glob("*.py"))


def test_blender_finds_the_presets():
    found = {Path(path) for path in bpy.utils.preset_paths("palpate/sensor")}
    assert laid_sensors.FOLDER / "palpate" / "sensor" in found


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_a_preset_makes_a_sensor_that_works_and_names_its_source(path):
    pad = pad_sensor()
    before = sensor_parameters(pad.palpate)
    pad.palpate.normal_law = "hunt-crossley"  # a preset's k is that of the linear law
    assert bpy.ops.palpate.preset_load(filepath=str(path)) == {"FINISHED"}
    after = sensor_parameters(pad.palpate)
    after.check(pad.name)
    text = path.read_text(encoding="utf-8")
    assert after.k == float(re.search(r"settings\.k = ([\d.]+)", text).group(1))
    assert re.search(r"paper|bulletin|20\d\d", text)
    if "Foam" in path.name:
        assert after == SensorParameters() == before  # the paper's Table 2 is what a new sensor has
    else:
        assert after != before


def test_own_presets_are_kept_and_removed():
    pad = pad_sensor()
    pad.palpate.k, pad.palpate.unit = 123.0, "V"
    assert bpy.ops.palpate.preset_add(name="Mine") == {"FINISHED"}
    mine = [path for folder in bpy.utils.preset_paths("palpate/sensor") for path in Path(folder).glob("Mine.py")]
    assert len(mine) == 1
    pad.palpate.k, pad.palpate.unit = 1.0, "N"
    bpy.ops.palpate.preset_load(filepath=str(mine[0]))
    assert (pad.palpate.k, pad.palpate.unit) == (123.0, "V")
    bpy.ops.palpate.preset_add(name="Mine", remove_name=True)
    assert not mine[0].exists()


def test_presets_that_come_with_palpate_stay():
    """Blender's list has a minus beside each."""
    pad_sensor()
    for path in PRESETS:
        assert bpy.ops.palpate.preset_add(name=bpy.path.display_name(path.name), remove_name=True) == {"CANCELLED"}
        assert path.exists()


def test_a_preset_needs_a_sensor_and_a_file():
    grid()
    assert not bpy.ops.palpate.preset_load.poll()
    bpy.ops.palpate.sensor_add()
    assert "no preset" in refusal(bpy.ops.palpate.preset_load, filepath="/nowhere/none.py")


def test_copy_to_selected():
    pad, other, third = grid(), grid("Other"), ball("Third")
    for obj in (pad, other):
        obj.palpate.role = "SENSOR"
    third.palpate.role = "TARGET"
    pad.palpate.k, pad.palpate.mus, pad.palpate.unit, pad.palpate.region = 77.0, 0.9, "V", "GROUP"
    bpy.context.view_layer.objects.active = pad
    bpy.ops.palpate.effect_add(effect="saturation")
    assert not bpy.ops.palpate.parameters_copy.poll()
    for obj in (pad, other, third):
        obj.select_set(True)
    assert bpy.ops.palpate.parameters_copy() == {"FINISHED"}
    assert (other.palpate.k, other.palpate.mus, other.palpate.unit) == (77.0, pytest.approx(0.9), "V")
    assert other.palpate.region == "MESH" and [item.kind for item in other.palpate.effects] == ["saturation"]
    assert third.palpate.k == pytest.approx(58.5)


# --- regions by material and face set


def two_halves(pad):
    """Left and right half of a 6 × 14 pad in two materials and two face sets; the right one has number 2 in both."""
    mesh = pad.data
    for name in ("Steel", "Rubber"):
        mesh.materials.append(bpy.data.materials.new(name))
    right = np.array([face.center.x > 0.01 for face in mesh.polygons])
    mesh.polygons.foreach_set("material_index", right.astype(np.int32))
    sets = mesh.attributes.new(".sculpt_face_set", "INT", "FACE")
    sets.data.foreach_set("value", np.where(right, 2, 1).astype(np.int32))
    return sensor_regions.vertices_of_faces(mesh, right)


@pytest.mark.parametrize("source", ["MATERIAL", "FACE_SET"])
def test_a_material_or_face_set_becomes_the_region(source):
    pad = grid()
    right = two_halves(pad)
    pad.active_material_index = 1
    pad.data.polygons.active = int(np.argmax([face.center.x > 0.01 for face in pad.data.polygons]))
    assert bpy.ops.palpate.sensor_add(source=source) == {"FINISHED"}
    assert pad.palpate.region == source
    assert (sensor_regions.region_vertices(pad) == right).all()
    assert 0 < right.sum() < len(right)
    if source == "FACE_SET":
        assert bpy.ops.palpate.face_set_choose(face_set="1") == {"FINISHED"}
        assert pad.palpate.face_set == 1
        pad.palpate.face_set = 7
        with pytest.raises(SensorError, match="no face set 7: choose one of 1, 2"):
            sensor_regions.region_vertices(pad)
    else:
        pad.palpate.material = "Gone"
        with pytest.raises(SensorError, match="has no material 'Gone'"):
            sensor_regions.region_vertices(pad)


def test_a_region_by_material_survives_its_own_heat_map(tmp_path):
    scene, pad, _ = press(3)
    right = two_halves(pad)
    pad.palpate.region, pad.palpate.material = "MATERIAL", "Rubber"
    save(tmp_path)
    for _ in range(2):
        baked(scene)
        assert (sensor_regions.region_vertices(pad) == right).all()


def test_a_changed_region_or_painted_map_is_noticed():
    scene, pad, _ = press(4)
    two_halves(pad)
    pad.palpate.region, pad.palpate.material = "MATERIAL", "Rubber"
    depsgraph = participants.depsgraph_of(scene)
    run = live_cache.start(scene, depsgraph)
    assert not live_cache.is_stale(scene, depsgraph, run)
    first = mesh_arrays.evaluated_fingerprint(pad, depsgraph)
    pad.data.polygons.foreach_set("material_index", np.ones(len(pad.data.polygons), dtype=np.int32))
    assert mesh_arrays.evaluated_fingerprint(pad, depsgraph) != first
    second = mesh_arrays.evaluated_fingerprint(pad, depsgraph)
    group = pad.vertex_groups.new(name="Soft")
    pad.palpate.k_map = "Soft"
    group.add([0], 1.0, "REPLACE")
    assert mesh_arrays.evaluated_fingerprint(pad, depsgraph) != second
    assert live_cache.is_stale(scene, depsgraph, run)


# --- painted multipliers


def test_painted_maps_reach_the_solver():
    scene, pad, _ = press(2)
    soft = pad.vertex_groups.new(name="Soft")
    soft.add([0, 1, 2], 1.0, "REPLACE")
    soft.add([3], 0.5, "REPLACE")
    pad.palpate.k_map, pad.palpate.k_factor = "Soft", 0.2
    rough = pad.data.attributes.new("Rough", "FLOAT", "POINT")
    rough.data.foreach_set("value", np.linspace(0.5, 2.0, 84).astype(np.float32))
    pad.palpate.friction_map = "Rough"
    painted = start_of(scene).scenario.sensors[0].painted
    assert painted.k[:5] == pytest.approx([0.2, 0.2, 0.2, 0.6, 1.0])
    assert painted.friction == pytest.approx(np.linspace(0.5, 2.0, 84), rel=1e-6)
    assert painted.gain is None


@pytest.mark.parametrize(
    ("name", "value", "text"), [("Gone", 1.0, "no vertex group or attribute 'Gone'"), ("Bad", -1.0, "nega")]
)
def test_a_painted_map_that_cannot_be_used_says_so(name, value, text):
    scene, pad, _ = press(2)
    bad = pad.data.attributes.new("Bad", "FLOAT", "POINT")
    bad.data.foreach_set("value", np.full(84, value, dtype=np.float32))
    pad.palpate.gain_map = name
    with pytest.raises(SensorError, match=text):
        start_of(scene)


def test_a_preset_may_be_toml_which_is_only_data(tmp_path):
    from palpate.operators import presets

    assert ".toml" in presets.PALPATE_PT_presets.preset_extensions == presets.PALPATE_MT_presets.preset_extensions
    pad = pad_sensor()
    pad.palpate.k = 123.0
    path = tmp_path / "mine.toml"
    assert bpy.ops.palpate.sensor_toml_export(filepath=str(path)) == {"FINISHED"}
    pad.palpate.k = 7.0
    assert bpy.ops.palpate.preset_load(filepath=str(path)) == {"FINISHED"}
    assert pad.palpate.k == 123.0
    path.write_text("import os", encoding="utf-8")
    assert "is not TOML" in refusal(bpy.ops.palpate.preset_load, filepath=str(path))
