# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor's tactile image on its own UV map: in the files, in the material, and what is said when there is none."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, ball, keyframe, node_of, save, scene_of, start_of
from sample_bake import read_exr

from palpate.addon.display import materials
from palpate.addon.scene import participants, sensor_reader, uv_layouts
from palpate.addon.session import frame_status
from palpate.core.errors import SensorError
from palpate.core.io.bake_folder import frame_file


def tip(kind="uv_sphere", **settings):
    """Return a fingertip all around, with the UV map that Blender gives it, over a ball that is pressed into it."""
    scene = scene_of(4)
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")()
    tip = bpy.context.object
    tip.name, tip.scale = "Tip", (0.01, 0.01, 0.01)
    tip.palpate.role, tip.palpate.image_layout = "SENSOR", "UV"
    for key, value in settings.items():
        setattr(tip.palpate, key, value)
    target = ball(radius=0.01)
    target.palpate.role = "TARGET"
    keyframe(target, "location", {1: (0.0, 0.0187, 0.0), 4: (0.0, 0.017, 0.001)})
    scene.frame_set(1)
    return scene, tip


@pytest.fixture(autouse=True)
def clean():
    yield
    uv_layouts._layout.cache_clear()


@pytest.mark.parametrize("kind", ["uv_sphere", "torus", "cube", "monkey"])
def test_the_maps_that_blender_makes_can_be_used(kind):
    scene, obj = tip(kind)
    sensor, _ = sensor_reader.sensor_in_own_frame(scene, obj, participants.depsgraph_of(scene))
    assert sensor.texels.layout.map_name == "UVMap" and sensor.texels.layout.shape == (256, 256)
    assert sensor.texels.layout.mask().mean() > 0.2


@pytest.mark.parametrize("pixels", ["SMOOTH", "NEAREST"])
def test_files_and_material_show_the_force_on_the_uv_map(tmp_path, pixels):
    scene, obj = tip(image_size=200, image_filter=pixels)
    result = baked(scene, tmp_path)
    readings, texels = result.recording.at(4).sensors["Tip"], result.scenario.sensors[0].texels
    channels, about = read_exr(result.folders["Tip"] / frame_file(4))
    assert channels["R"].shape == (200, 200) and about["map"] == "UVMap"
    assert channels["R"].max() == pytest.approx(readings.normal_force.max(), rel=1e-6 if pixels == "NEAREST" else 0.15)
    if pixels == "NEAREST":
        shown = np.unique(channels["R"][texels.layout.mask()])
        assert shown == pytest.approx(np.unique(readings.normal_force.astype(np.float32)), rel=1e-6)
    # Blender's own coordinates, looked up corner by corner in what Blender's own image shows
    scene.frame_set(4)
    image = materials.find_block(bpy.data.images, obj.palpate.uid)
    node = node_of(obj, "ShaderNodeTexImage")
    assert node.image == image and node.interpolation == {"SMOOTH": "Linear", "NEAREST": "Closest"}[pixels]
    assert node.inputs["Vector"].links[0].from_node.attribute_name == "UVMap"
    assert list(obj.data.uv_layers.keys()) == ["UVMap"]
    force = np.zeros(len(obj.data.vertices))
    force[texels.vertex] = readings.normal_force
    uv = np.array([corner.vector[:] for corner in obj.data.uv_layers[0].uv])
    corner = np.array([loop.vertex_index for loop in obj.data.loops])
    column, row = np.clip(np.floor(uv * 200).astype(int), 0, 199).T
    assert channels["R"][row, column] == pytest.approx(force[corner], abs=0.2 * readings.normal_force.max())


def test_images_do_not_change_forces(tmp_path):
    recordings = []
    for layout in ("AUTO", "UV"):
        bpy.data.batch_remove(list(bpy.data.objects))
        scene, obj = tip()
        obj.palpate.image_layout = layout
        recordings.append(baked(scene, tmp_path).recording.sensors["Tip"])
    np.testing.assert_allclose(recordings[0].normal_force, recordings[1].normal_force, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(recordings[0].shear, recordings[1].shear, rtol=1e-12, atol=1e-15)


def test_without_a_map_it_is_one_sentence(tmp_path):
    scene, obj = tip()
    save(tmp_path)
    obj.palpate.image_map = "Lightmap"
    with pytest.raises(SensorError, match=r"'Tip' has no UV map 'Lightmap': choose one of 'UVMap'"):
        baked(scene)
    obj.data.uv_layers.remove(obj.data.uv_layers[0])
    with pytest.raises(SensorError, match=r"'Tip' has no UV map for its tactile image: unwrap it"):
        baked(scene)


def test_too_coarse_an_image_is_said():
    scene, obj = tip(image_size=16)
    assert any("smaller than a pixel" in warning for warning in start_of(scene).warnings)


def test_a_moved_corner_of_the_map_makes_the_bake_stale(tmp_path):
    """Settings of an image are those of tests/blender/properties/test_fingerprint.py."""
    scene, obj = tip()
    baked(scene, tmp_path)
    scene.frame_set(2)
    assert frame_status.status_of(scene).text == "Frame 2 of the bake."
    obj.data.uv_layers[0].uv[3].vector = (0.1, 0.1)
    obj.data.update()
    bpy.context.view_layer.update()
    scene.frame_set(3)
    assert "The scene has changed since this bake" in frame_status.status_of(scene).text
