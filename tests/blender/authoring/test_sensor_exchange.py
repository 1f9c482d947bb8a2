# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors of scenes in the files of other simulators: the sample scenes, the operator and the command."""

from __future__ import annotations

import blender_scenes as scenes
import bpy
import numpy as np
import pytest
from exported_sensors import FLOAT32

from palpate.addon.authoring import laid_sensors, sensor_exchange
from palpate.addon.scene import participants, sensor_reader
from palpate.commands import main
from palpate.core.errors import SceneError
from palpate.core.simulators.sensor_format import export_sensors


def test_a_laid_sensor_brings_the_surface_that_carries_it(scene):
    ball = scenes.ball(radius=0.02, location=(0.1, 0.2, 0.3))
    ball.scale = (2.0, 2.0, 2.0)
    ball.rotation_euler = (0.3, 0.4, 0.5)
    pattern = {"method": "ARRAY", "rows": 4, "columns": 4, "pitch_x": 0.004, "pitch_y": 0.004, "shift_x": 0.0, "shift_y": 0.0}
    pattern |= {"angle": 0.0, "spacing": 0.004, "seed": 0, "lift": 0.0}
    skin = laid_sensors.lay_texels(bpy.context, ball, "MESH", pattern)
    (item,) = sensor_exchange.sensors_on_meshes(scene)
    assert item.name == skin.name and len(item.sensor.texels) < len(item.surface.vertices)
    centre = item.surface.vertices.mean(axis=0)
    assert np.linalg.norm(item.surface.vertices - centre, axis=1) == pytest.approx(0.04, rel=1e-5)
    # texels lie on the flat faces of the surface: between the radius and the apothem of a ball of 24 × 12 faces
    away = np.linalg.norm(item.sensor.texels.position - centre, axis=1)
    assert away.max() < 0.04 * (1 + 1e-6) and away.min() > 0.04 * np.cos(np.pi / 12)


def test_names_that_are_no_sensors_are_refused(scene):
    with pytest.raises(SceneError, match="has no sensor"):
        sensor_exchange.sensors_on_meshes(scene)
    scenes.press()
    with pytest.raises(SceneError, match="no sensor 'Ball' in 'Scene': choose from 'Pad'"):
        sensor_exchange.sensors_on_meshes(bpy.context.scene, ["Ball"])


def test_the_operator_and_the_command_write_the_same(tmp_path):
    scenes.press()
    bpy.ops.object.select_all(action="DESELECT")
    path = scenes.save(tmp_path)
    assert bpy.ops.palpate.sensor_export(to="mjcf", directory=str(tmp_path / "window")) == {"FINISHED"}
    assert main(["sensor", "export", str(path), "--to", "mjcf", "--out", str(tmp_path / "line")]) == 0
    assert scenes.contents(tmp_path / "window") == scenes.contents(tmp_path / "line")


def test_the_command_says_what_is_not_expressed(tmp_path, capfd, refused):
    scenes.press()
    path = scenes.save(tmp_path)
    assert main(["sensor", "export", str(path), "--to", "mjcf", "--out", str(tmp_path / "out"), "--sensor", "Pad"]) == 0
    printed = capfd.readouterr()
    assert printed.out.splitlines()[-1] == str(tmp_path / "out" / "Pad.xml")
    assert "note: 'Pad': MuJoCo's stiffness is per mass" in printed.err
    assert "would be overwritten" in refused("sensor", "export", path, "--to", "mjcf", "--out", path)


def read_texels(obj):
    return sensor_reader.sensor_in_own_frame(bpy.context.scene, obj, participants.depsgraph_of(bpy.context.scene))[0].texels


@pytest.mark.parametrize("kind", ["mjcf", "urdf", "probes", "usd"])
def test_an_exported_sensor_comes_back_in_its_place(kind, tmp_path):
    scenes.press()
    pad = bpy.data.objects["Pad"]
    pad.location, pad.rotation_euler, pad.palpate.k = (0.1, 0.2, 0.3), (0.1, 0.2, 0.3), 70.0
    bpy.context.view_layer.update()
    (item,) = sensor_exchange.sensors_on_meshes(bpy.context.scene, ["Pad"])
    path = export_sensors([item], kind, tmp_path).files[1 if kind == "urdf" else 0]
    before = set(bpy.data.objects)
    assert bpy.ops.palpate.sensor_import(filepath=str(path)) == {"FINISHED"}
    new = bpy.context.object
    assert new not in before and new.palpate.role == "SENSOR"
    texels = read_texels(new)
    assert np.abs(texels.position - item.sensor.texels.position).max() < FLOAT32
    assert np.abs(texels.normal - item.sensor.texels.normal).max() < FLOAT32
    if kind == "urdf":  # the file says where texels are on the link, and not where the link is
        assert new.parent.name == "Pad Surface" and new.palpate.body == "PARENT"
    else:
        assert np.allclose(np.array(new.matrix_world), np.array(pad.matrix_world), atol=FLOAT32)
        assert texels.layout.shape == item.sensor.texels.layout.shape
    assert new.palpate.k == pytest.approx(70.0 if kind in ("probes", "usd") else 58.5)


def gentact(folder, flagged=9):
    """Save a .blend as GenTact makes it: flagged points of a mesh, with positions and normals of their own."""
    ball = scenes.ball(name="Skin", radius=0.05, location=(1.0, 0.0, 0.0))
    mesh = ball.data
    kinds = {"is_sensor": "BOOLEAN", "radii": "FLOAT", "sensor_pos": "FLOAT_VECTOR", "sensor_normal": "FLOAT_VECTOR"}
    for name, kind in kinds.items():
        mesh.attributes.new(name, kind, "POINT")
    points = np.array([vertex.co for vertex in mesh.vertices])
    top = np.argsort(-points[:, 2])[:flagged]
    for index in top:
        mesh.attributes["is_sensor"].data[index].value = True
    mesh.attributes["sensor_pos"].data.foreach_set("vector", (1.1 * points).ravel())
    mesh.attributes["sensor_normal"].data.foreach_set("vector", points.ravel())
    path = scenes.save(folder, "gentact.blend")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path, 1.1 * points[np.sort(top)]


def test_gentacts_file_gives_its_sensors_and_leaves_nothing_else(tmp_path):
    path, points = gentact(tmp_path)
    assert bpy.ops.palpate.sensor_import(filepath=str(path)) == {"FINISHED"}
    assert [obj.name for obj in bpy.data.objects] == ["Skin"]
    assert not bpy.data.libraries and not bpy.data.collections
    texels = read_texels(bpy.context.object)
    assert np.abs(texels.position - points).max() < FLOAT32
    radial = points / np.linalg.norm(points, axis=1)[:, None]
    assert np.abs(texels.normal - radial).max() < FLOAT32  # those of the file, not of the facets between the points
    bpy.context.object.scale = (1.0, 1.0, 2.0)
    bpy.context.view_layer.update()
    stretched = radial / [1.0, 1.0, 2.0]
    stretched /= np.linalg.norm(stretched, axis=1)[:, None]
    assert np.abs(read_texels(bpy.context.object).normal - stretched).max() < FLOAT32
    assert bpy.context.object.location.x == pytest.approx(1.0)


def test_a_file_without_flagged_points_changes_nothing(tmp_path):
    path, _ = gentact(tmp_path, flagged=2)
    assert "no object with three or more points" in scenes.refusal(bpy.ops.palpate.sensor_import, filepath=str(path))
    path.write_bytes(b"BLENDER")
    assert "cannot be opened by Blender" in scenes.refusal(bpy.ops.palpate.sensor_import, filepath=str(path))
    assert not bpy.data.objects and not bpy.data.libraries and not bpy.data.collections


def test_openraves_parameters_go_onto_the_object_that_is_named(tmp_path):
    scenes.press()
    path = tmp_path / "robot.xml"
    path.write_text('<AttachedSensor><link>Pad</link><sensor type="SimTactileSensor"><k>70</k></sensor></AttachedSensor>')
    bpy.context.view_layer.objects.active = None
    assert bpy.ops.palpate.sensor_import(filepath=str(path)) == {"FINISHED"}
    assert bpy.data.objects["Pad"].palpate.k == pytest.approx(70.0)
    path.write_text(path.read_text().replace("Pad", "Ball"))
    said = scenes.refusal(bpy.ops.palpate.sensor_import, filepath=str(path))
    assert "make the sensor that gets its parameters active first" in said


def test_the_command_imports_into_a_scene_that_then_bakes(tmp_path, capfd, refused):
    scenes.press()
    pad = scenes.save(tmp_path)
    assert main(["sensor", "export", str(pad), "--to", "probes", "--out", str(tmp_path / "out")]) == 0
    bpy.data.objects.remove(bpy.data.objects["Pad"])
    rest = scenes.save(tmp_path, "rest.blend")
    capfd.readouterr()
    listed = str(tmp_path / "out" / "Pad.json")
    assert main(["sensor", "import", listed, str(rest), "--save-as", str(tmp_path / "new.blend")]) == 0
    assert "'Pad': 84 vertices" in capfd.readouterr().out
    scene = scenes.reopen(tmp_path / "new.blend")
    scene.frame_set(8)
    (item,) = sensor_exchange.sensors_on_meshes(scene)
    assert len(item.sensor.texels) == 84
    said = refused("sensor", "import", listed, rest, "--sensor", "Skin")
    assert "no sensor 'Skin' in 'Pad.json': choose from 'Pad'" in said
    assert "would be overwritten" in refused("sensor", "import", rest, rest)
