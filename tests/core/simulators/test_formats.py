# SPDX-License-Identifier: GPL-3.0-or-later
"""Probe lists, URDF and USD of sensors, and the registry of formats."""

from __future__ import annotations

import json

import numpy as np
import pytest
from exported_sensors import FLOAT32, ball, pad
from scipy.spatial.transform import Rotation

from palpate.core.errors import FileError, PalpateError
from palpate.core.geometry.mesh import is_closed, mass_properties
from palpate.core.simulators.formats import urdf
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


def test_an_export_that_fails_half_way_leaves_the_earlier_one(tmp_path, monkeypatch):
    export_sensors(SENSORS, "urdf", tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(*_):
        raise FileError("'x' could not be written (no space left on device): free some space.")

    monkeypatch.setattr(urdf, "write_probe_list", full)  # the last file of a sensor
    with pytest.raises(FileError, match="no space"):
        export_sensors([pad(4, 4), ball()], "urdf", tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_macro_of_a_urdf_names_its_mesh_and_its_probes(tmp_path):
    mesh, _, macro, probes = export_sensors([ball()], "urdf", tmp_path).files
    assert json.loads(probes.read_text())["sensor"] == "Ball"
    assert probes.name in macro.read_text() and mesh.name in macro.read_text()


def test_the_archive_of_a_probe_list_has_its_arrays(tmp_path):
    item = ball()
    _, archive = export_sensors([item], "probes", tmp_path).files
    with np.load(archive) as arrays:
        for name in ("position", "normal", "tangent", "area"):
            assert np.array_equal(arrays[name], getattr(item.sensor.texels, name))


def test_roll_pitch_yaw_hold_at_gimbal_lock():
    rng = np.random.default_rng(3)
    pitch = np.repeat([1, -1], 100) * np.pi / 2
    turns = Rotation.from_euler("xyz", np.column_stack([rng.uniform(-3, 3, 200), pitch, rng.uniform(-3, 3, 200)]))
    back = Rotation.from_euler("xyz", urdf.roll_pitch_yaw(turns.as_matrix()))
    assert np.abs(back.as_matrix() - turns.as_matrix()).max() < 1e-12


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


def test_usd_says_to_all_programs_what_our_reader_does_not_ask(tmp_path):
    pytest.importorskip("pxr", reason="usd-core reads the USD: pip install usd-core")
    from pxr import Usd, UsdGeom

    item = pad(3, 3, name='a "quoted" \\ n\u00e4me')
    stage = Usd.Stage.Open(str(export_sensors([item], "usd", tmp_path).files[0]))
    root = stage.GetDefaultPrim()
    assert root.GetDisplayName() == item.name and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    points = UsdGeom.Points(stage.GetPrimAtPath(root.GetPath().AppendChild("texels")))
    primvars = UsdGeom.PrimvarsAPI(points)
    assert np.array(primvars.GetPrimvar("area").Get()) == pytest.approx(item.sensor.texels.area, rel=FLOAT32)
