# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile pads, and texels laid onto the surfaces of other objects."""

import bpy
import numpy as np
import pytest
from blender_scenes import ball, changes, dump, grid, refusal, select, start_of

from palpate.addon.authoring import laid_sensors
from palpate.addon.session import transforms


def texels_of(obj):
    """The texels of a sensor; reading a scene needs something that presses."""
    ball("Target", (0.0, 0.0, 1.0)).palpate.role = "TARGET"
    reading = start_of(bpy.context.scene)
    return reading.scenario.sensors[reading.sensor_objects(bpy.context.scene).index(obj)].texels


def finger():
    return ball("Finger", (0.0, 0.0, 0.0), 0.01, segments=48)


def upper(obj, share=0.3):
    size = max(v.co.z for v in obj.data.vertices)
    return [v.index for v in obj.data.vertices if v.co.z > share * size]


@pytest.mark.parametrize("radius", [0.0, 0.012])
def test_a_tactile_pad_is_a_sensor_of_rows_and_columns(radius):
    assert bpy.ops.palpate.pad_mesh_add(rows=7, columns=5, pitch_x=0.002, pitch_y=0.003, radius=radius) == {"FINISHED"}
    pad = bpy.context.object
    assert (pad.name, pad.palpate.role, pad.palpate.region) == ("Tactile Pad", "SENSOR", "MESH")
    texels = texels_of(pad)
    assert (texels.layout.rows, texels.layout.columns) == (7, 5)
    assert pad.dimensions.y == pytest.approx(0.018)
    assert (pad.dimensions.z > 1e-4) == bool(radius)
    assert (texels.normal[:, 2] > 0).all()


def test_a_pad_in_millimetres_is_as_large():
    bpy.context.scene.unit_settings.scale_length = 0.001
    bpy.ops.palpate.pad_mesh_add(rows=7, columns=5, pitch_x=0.002, pitch_y=0.003)
    assert bpy.context.object.dimensions.y == pytest.approx(18.0)


def test_a_pad_that_meets_itself_says_so():
    assert "use a larger radius" in refusal(bpy.ops.palpate.pad_mesh_add, columns=60, radius=0.01)


@pytest.mark.parametrize(
    ("method", "settings", "grid_size"),
    [
        ("ARRAY", {"rows": 6, "columns": 5, "pitch_x": 0.002, "pitch_y": 0.0025}, (6, 5)),
        ("GRID", {"spacing": 0.002}, None),
        ("NOISE", {"spacing": 0.002}, None),
        ("VERTICES", {}, None),
    ],
)
def test_texels_are_laid_onto_a_selection(method, settings, grid_size):
    obj = finger()
    select(obj, upper(obj))
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.palpate.skin_add(method=method, **settings) == {"FINISHED"}
    skin = bpy.context.object
    assert (skin.name, skin.parent, skin.palpate.role, skin.palpate.body) == ("Finger Skin", obj, "SENSOR", "PARENT")
    assert obj.palpate.role == "NONE"
    texels = texels_of(skin)
    if grid_size:
        assert (texels.layout.rows, texels.layout.columns) == grid_size
    radius = np.linalg.norm(texels.position, axis=1)
    assert radius == pytest.approx(0.01, rel=0.01)
    assert np.einsum("ij,ij->i", texels.normal, texels.position).min() > 0
    assert texels.position[:, 2].min() > 0.002  # only where it was selected


@pytest.mark.parametrize("role", ["SENSOR", "PAD"])
def test_texels_laid_on_a_painted_region_take_its_place(role):
    """After *Paint Region* the mode is Weight Paint and the active group the sensor's own: nothing may be pressed twice."""
    obj = finger()
    bpy.ops.palpate.weight_paint()
    obj.palpate.role, obj.palpate.k = role, 300.0
    obj.vertex_groups.active.add(upper(obj), 1.0, "REPLACE")
    assert obj.mode == "WEIGHT_PAINT"
    assert bpy.ops.palpate.skin_add(method="VERTICES") == {"FINISHED"}
    assert bpy.context.object.palpate.role == "SENSOR" and obj.palpate.role == "NONE"
    assert bpy.context.object.palpate.k == 300.0


@pytest.mark.parametrize("source", ["OWN", "GROUP"])
def test_a_region_has_the_sensors_threshold_when_texels_are_laid_on_it(source):
    """Half of the region is painted with 0.3: with a threshold of 0.2 it is part of it, also when texels are laid again."""
    pad = grid(size=0.04)
    group = pad.vertex_groups.new(name="Painted")
    for vertex in pad.data.vertices:
        group.add([vertex.index], 1.0 if vertex.co.x > 0.0 else 0.3, "REPLACE")
    pad.palpate.role, pad.palpate.region, pad.palpate.vertex_group = "SENSOR", "GROUP", "Painted"
    pad.palpate.threshold = 0.2
    assert bpy.ops.palpate.skin_add(source=source, method="VERTICES") == {"FINISHED"}
    skin = bpy.context.object
    assert len(skin.data.vertices) == len(pad.data.vertices) and pad.palpate.role == "NONE"
    assert not laid_sensors.is_outdated(skin)
    pad.palpate.threshold = 0.9  # not the object's own any more: the sensor that lies there keeps its region
    bpy.ops.palpate.skin_update()
    assert len(skin.data.vertices) == len(pad.data.vertices)


def test_texels_laid_beside_a_painted_region_leave_it_as_it_is():
    obj = finger()
    bpy.ops.palpate.weight_paint()
    obj.vertex_groups.active.add(upper(obj), 1.0, "REPLACE")
    bpy.ops.object.mode_set(mode="OBJECT")
    other = obj.vertex_groups.new(name="Other side")
    other.add([v.index for v in obj.data.vertices if v.index not in upper(obj)], 1.0, "REPLACE")
    obj.vertex_groups.active_index = other.index
    assert bpy.ops.palpate.skin_add(source="GROUP", method="VERTICES") == {"FINISHED"}
    assert obj.palpate.role == "SENSOR"


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (1.0, 2.0, 1.0), (-1.0, 1.0, 1.0)])
def test_spacing_is_in_metres_whatever_the_scale_of_the_object(scale):
    obj = grid("Plate", size=0.04)
    obj.scale = scale
    bpy.context.view_layer.update()
    bpy.ops.palpate.skin_add(source="MESH", method="GRID", spacing=0.004)
    skin = bpy.context.object
    texels = texels_of(skin)
    apart = np.linalg.norm(texels.position[:, None] - texels.position, axis=2) + np.eye(len(texels))
    assert apart.min(axis=1) == pytest.approx(0.004, rel=1e-4)
    frame = transforms.rotation(transforms.decompose(np.array(skin.matrix_world, float))[1])
    assert texels.normal @ frame.T == pytest.approx(np.tile([0, 0, 1.0], (len(texels), 1)), abs=1e-6)


def test_a_skin_is_laid_anew_when_the_surface_has_changed():
    obj = finger()
    select(obj, upper(obj))
    bpy.ops.palpate.skin_add(source="SELECTION", method="NOISE", spacing=0.003)
    skin = bpy.context.object
    assert not laid_sensors.is_outdated(skin)
    for vertex in obj.data.vertices:
        vertex.co *= 1.5
    assert laid_sensors.is_outdated(skin)
    before = len(skin.data.vertices)
    skin.palpate.k = 99.0
    assert bpy.ops.palpate.skin_update() == {"FINISHED"}
    assert not laid_sensors.is_outdated(skin)
    points = np.array([v.co for v in skin.data.vertices])
    assert np.linalg.norm(points, axis=1) == pytest.approx(0.015, rel=0.01)
    assert len(points) == pytest.approx(1.5**2 * before, rel=0.2)
    assert skin.palpate.k == 99.0
    skin.palpate.skin.spacing = 0.006
    bpy.ops.palpate.skin_update()
    assert len(skin.data.vertices) == pytest.approx(len(points) / 4, rel=0.3)


def test_what_cannot_be_laid_leaves_no_trace():
    obj = finger()
    select(obj, upper(obj, 0.8))
    before = dump()
    assert "beyond the region" in refusal(bpy.ops.palpate.skin_add, source="SELECTION", method="ARRAY")
    assert changes(before, dump()) == []
    assert not bpy.ops.palpate.skin_update.poll()


def test_a_skin_that_lost_its_surface_says_so():
    finger()
    bpy.ops.palpate.skin_add(source="MESH", spacing=0.004)
    bpy.context.object.parent = None
    assert "has lost the mesh it lay on" in refusal(bpy.ops.palpate.skin_update)


def test_a_good_spacing_is_guessed():
    assert laid_sensors.usual_spacing(grid(size=0.05), bpy.context.scene) == pytest.approx(0.0035, rel=0.3)
