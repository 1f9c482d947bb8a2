# SPDX-License-Identifier: GPL-3.0-or-later
"""Probe lists, URDF and USD of sensors, and the registry of formats."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from exported_sensors import FLOAT32, ball, pad
from scipy.spatial.transform import Rotation

from palpate.core.errors import FileError, PalpateError
from palpate.core.geometry.mesh import is_closed, mass_properties
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.simulators.formats.urdf import roll_pitch_yaw
from palpate.core.simulators.sensor_format import export_sensors, formats, written_formats
from palpate.core.simulators.sensor_on_mesh import identifiers, thickened

SENSORS = (pad(), pad(radius=0.02, name="Bent"), ball())


def test_every_format_is_registered_once():
    assert list(formats()) == ["contact", "mjcf", "openrave", "probes", "urdf", "usd"]
    assert all(item.title and item.description and (item.write or item.read) for item in formats().values())


def test_an_unknown_format_is_refused(tmp_path):
    with pytest.raises(PalpateError, match="not written as 'dae': choose from contact, mjcf, openrave, probes, urdf, usd"):
        export_sensors(SENSORS, "dae", tmp_path)


@pytest.mark.parametrize("kind", written_formats())
def test_sensors_of_one_name_leave_the_earlier_export(kind, tmp_path):
    export_sensors([pad()], kind, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    with pytest.raises(PalpateError, match="Two of the sensors have the same name"):
        export_sensors([pad(), pad(4, 4)], kind, tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before
    written = export_sensors([pad(name="a b"), pad(4, 4, name="a_b")], kind, tmp_path)  # URDF's names have no blanks
    assert len(written.files) == 2 * len({path.name.partition(".")[2] for path in written.files})


@pytest.mark.parametrize("kind", written_formats())
def test_all_sensors_are_written_and_the_next_export_replaces_them(kind, tmp_path):
    written = export_sensors(SENSORS, kind, tmp_path)
    assert all(path.is_file() for path in written.files)
    assert {path.name.split(".")[0] for path in written.files} == {"Pad", "Bent", "Ball"}
    assert all(any(f"'{item.name}'" in note for note in written.notes) for item in SENSORS)
    before = {path: path.read_bytes() for path in written.files}
    again = export_sensors(SENSORS, kind, tmp_path)
    assert {path: path.read_bytes() for path in again.files} == before
    (one, *_) = (item for item in SENSORS if item.name == "Ball")
    rest = export_sensors([one], kind, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir() if not path.name.startswith(".")) == sorted(
        path.name for path in rest.files
    )


@pytest.mark.parametrize("kind", written_formats())
def test_a_full_disk_leaves_the_earlier_export(kind, tmp_path, monkeypatch):
    export_sensors(SENSORS, kind, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    module = __import__(f"palpate.core.simulators.formats.{kind}", fromlist=["_"])
    writers = ("write_xml", "write_probe_list", "write_openrave", "write_text", "atomic_write")
    writer = next(name for name in writers if hasattr(module, name))
    calls = []

    def fails_at_the_second(*given, **options):
        calls.append(given)
        if len(calls) > 1:
            raise FileError("'x' could not be written (no space left on device): free some space.")
        return real(*given, **options)

    real = getattr(module, writer)
    monkeypatch.setattr(module, writer, fails_at_the_second)
    with pytest.raises(FileError, match="no space"):
        export_sensors([pad(4, 4), ball()], kind, tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("item", SENSORS, ids=lambda item: item.name)
def test_probe_lists_hold_every_number(item, tmp_path):
    text, archive = export_sensors([item], "probes", tmp_path).files
    listed = json.loads(text.read_text(encoding="utf-8"))
    assert SensorParameters(**listed["parameters"]) == item.sensor.parameters
    assert listed["frame"]["position"] == item.position.tolist()
    with np.load(archive) as arrays:
        for name in ("position", "normal", "tangent", "area"):
            ours = getattr(item.sensor.texels, name)
            assert np.array_equal(np.array(listed[name]), ours) and np.array_equal(arrays[name], ours)
        assert listed["units"]["area"] == "m2"
        assert ("row" in listed) == ("row" in arrays) == hasattr(item.sensor.texels.layout, "row")
        if "row" in listed:
            assert listed["row"] == item.sensor.texels.layout.row.tolist()
        assert ("factor_k" in listed) == (item.sensor.painted.k is not None)


def origins(robot):
    """Return positions and rotations of a URDF's fixed joints, as its specification defines them."""
    found = [joint.find("origin").attrib for joint in robot.iter("joint")]
    turns = Rotation.from_euler("xyz", [[float(value) for value in one["rpy"].split()] for one in found])
    return np.array([[float(value) for value in one["xyz"].split()] for one in found]), turns.as_matrix()


@pytest.mark.parametrize("item", SENSORS, ids=lambda item: item.name)
def test_urdf_has_a_frame_at_every_texel(item, tmp_path):
    mesh, robot, macro, probes = export_sensors([item], "urdf", tmp_path).files
    position, turn = origins(ElementTree.parse(robot))
    assert np.abs(position - item.sensor.texels.position).max() < 1e-12
    assert np.abs(turn - item.frames).max() < 1e-10  # twelve digits of angles
    import trimesh

    assert len(trimesh.load_mesh(mesh).faces) == len(item.mesh.triangles)
    assert json.loads(probes.read_text())["sensor"] == item.name
    assert probes.name in macro.read_text() and mesh.name in macro.read_text()


def test_roll_pitch_yaw_hold_at_gimbal_lock():
    rng = np.random.default_rng(3)
    turns = Rotation.from_euler(
        "xyz", np.column_stack([rng.uniform(-3, 3, (200, 1)), np.repeat([1, -1], 100) * np.pi / 2, rng.uniform(-3, 3, 200)])
    )
    frames = turns.as_matrix()
    back = Rotation.from_euler("xyz", roll_pitch_yaw(frames)).as_matrix()
    assert np.abs(back - frames).max() < 1e-12


def test_a_thickened_sheet_is_closed_and_has_the_volume():
    item = pad()
    solid = thickened(item.mesh, 0.003)
    assert is_closed(solid.triangles)
    _, inertia, _ = mass_properties(solid, 1.0, "pad")
    width, length = 5 * 0.0034, 13 * 0.0034
    assert inertia[2, 2] == pytest.approx((width**2 + length**2) / 12, rel=1e-9)
    assert inertia[0, 0] == pytest.approx((0.003**2 + length**2) / 12, rel=1e-9)


def test_identifiers_are_unique():
    names = ["Index finger", "Index_finger", "3", "\u00e4"]
    assert list(identifiers(names).values()) == ["Index_finger", "Index_finger_2", "s_3", "s__"]


@pytest.mark.parametrize("item", SENSORS, ids=lambda item: item.name)
def test_urdf_is_read_by_a_urdf_library(item, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason="yourdfpy reads the URDF: pip install yourdfpy")
    robot = yourdfpy.URDF.load(str(export_sensors([item], "urdf", tmp_path).files[1]))
    link = robot.base_link
    poses = np.array([robot.get_transform(joint.child, link) for joint in robot.robot.joints])
    assert len(poses) == len(item.sensor.texels)
    assert np.abs(poses[:, :3, 3] - item.sensor.texels.position).max() < FLOAT32
    assert np.abs(poses[:, :3, :3] - item.frames).max() < FLOAT32
    assert np.abs(np.array(robot.scene.bounds)[1] - item.mesh.vertices.max(axis=0)).max() < FLOAT32


@pytest.mark.parametrize("item", [*SENSORS, pad(3, 3, name='a "quoted" \\ n\u00e4me')], ids=lambda item: item.name)
def test_usd_is_read_by_usd_core(item, tmp_path):
    pytest.importorskip("pxr", reason="usd-core reads the USD: pip install usd-core")
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(export_sensors([item], "usd", tmp_path).files[0]))
    root = stage.GetDefaultPrim()
    assert root.GetDisplayName() == item.name and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    points = UsdGeom.Points(stage.GetPrimAtPath(root.GetPath().AppendChild("texels")))
    assert np.abs(np.array(points.GetPointsAttr().Get()) - item.sensor.texels.position).max() < FLOAT32
    assert np.abs(np.array(points.GetNormalsAttr().Get()) - item.sensor.texels.normal).max() < FLOAT32
    primvars = UsdGeom.PrimvarsAPI(points)
    assert np.abs(np.array(primvars.GetPrimvar("tangent").Get()) - item.sensor.texels.tangent).max() < FLOAT32
    assert np.array(primvars.GetPrimvar("area").Get()) == pytest.approx(item.sensor.texels.area, rel=FLOAT32)
    assert root.GetAttribute("palpate:k").Get() == item.sensor.parameters.k
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(root.GetPath().AppendChild("surface")))
    assert len(mesh.GetFaceVertexCountsAttr().Get()) == len(item.mesh.triangles)
    turn = np.array(UsdGeom.Xformable(root).GetLocalTransformation())
    assert np.allclose(turn[3, :3], item.position)
    assert np.allclose(turn[:3, :3].T, Rotation.from_quat(np.roll(item.quaternion, -1)).as_matrix())
