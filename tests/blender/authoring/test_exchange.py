# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors from and to files by the buttons, fits with their plots, and every operator where F3 finds it."""

import re
import tomllib

import bpy
import numpy as np
import pytest
from blender_scenes import pad_sensor, refusal
from oracles import contact_laws

from palpate.addon.authoring import exchange
from palpate.core.gap.calibration.stiffness import texel_stiffness
from palpate.core.model.sensor_parameters import SensorParameters


def sensor(**values):
    obj = pad_sensor()
    for key, value in values.items():
        setattr(obj.palpate, key, value)
    return obj


# --- files


def test_of_several_openrave_sensors_the_one_of_this_name_is_taken(tmp_path):
    first, second = sensor(k=10.0), sensor(k=20.0)
    path = str(tmp_path / "two.xml")
    for obj in (first, second):
        obj.select_set(False)
    bpy.ops.palpate.openrave_export(filepath=path)
    second.palpate.k = 1.0
    bpy.ops.palpate.openrave_import(filepath=path)
    assert second.palpate.k == 20.0
    second.name = "Other"
    assert "has 2 sensors: give the name of one, 'Pad', 'Pad.001'" in refusal(bpy.ops.palpate.openrave_import, filepath=path)
    bpy.ops.palpate.openrave_import(filepath=path, sensor="Pad")
    assert second.palpate.k == 10.0


def test_toml_there_and_back_with_effects_and_grid(tmp_path):
    path = str(tmp_path / "sensor.toml")
    bpy.ops.palpate.pad_mesh_add(rows=14, columns=6)
    pad = bpy.context.object
    pad.palpate.k, pad.palpate.unit, pad.palpate.gain = 77.7, "counts", 300.0
    bpy.ops.palpate.effect_add(effect="creep")
    before = exchange.parameters_of(pad), len(pad.palpate.effects)
    assert bpy.ops.palpate.sensor_toml_export(filepath=path) == {"FINISHED"}
    with open(path, "rb") as file:
        table = tomllib.load(file)
    assert table["sensor"]["grid"] == {"rows": 14, "columns": 6, "pitch": [0.0034, 0.0034]}
    assert table["effect"][0]["name"] == "creep"
    pad.palpate.k = 1.0
    pad.palpate.effects.clear()
    assert bpy.ops.palpate.sensor_toml_import(filepath=path) == {"FINISHED"}
    assert (exchange.parameters_of(pad), len(pad.palpate.effects)) == before
    bpy.context.view_layer.objects.active = None  # nothing active: a new pad
    assert bpy.ops.palpate.sensor_toml_import(filepath=path) == {"FINISHED"}
    new = bpy.context.object
    assert new != pad and new.palpate.role == "SENSOR"
    assert exchange.parameters_of(new) == before[0]
    assert len(new.data.vertices) == 84


def test_a_curved_sensor_has_no_grid_words(tmp_path):
    bpy.ops.palpate.pad_mesh_add(radius=0.01)
    bpy.ops.palpate.sensor_toml_export(filepath=str(tmp_path / "bent.toml"))
    assert "grid" not in tomllib.loads((tmp_path / "bent.toml").read_text(encoding="utf-8"))["sensor"]
    bpy.context.view_layer.objects.active = None
    assert "no grid to make a pad of" in refusal(bpy.ops.palpate.sensor_toml_import, filepath=str(tmp_path / "bent.toml"))


# --- fits


def test_stiffness_from_foam(tmp_path):
    pad = sensor()
    (tmp_path / "foam.csv").write_text("compression (mm),pressure (kPa)\n1,3.924\n2,7.848\n2.5,9.81\n", encoding="utf-8")
    plot = tmp_path / "fit.png"
    assert bpy.ops.palpate.stiffness_fit(filepath=str(tmp_path / "foam.csv"), plot=str(plot)) == {"FINISHED"}
    assert pad.palpate.k == pytest.approx(texel_stiffness(9810.0, 0.0025, 84, 0.0025), rel=1e-5)  # Eq. 18, 50 × 50 mm
    assert pad.palpate.cn == pytest.approx(0.01 * pad.palpate.k)
    assert plot.read_bytes()[:4] == b"\x89PNG"
    image = bpy.data.images["Palpate Stiffness Fit"]
    assert image.packed_file is not None and image.size[0] > 400
    bpy.ops.palpate.stiffness_fit(filepath=str(tmp_path / "foam.csv"))
    assert [item.name for item in bpy.data.images] == ["Palpate Stiffness Fit"]


def test_friction_from_a_curve_is_the_papers_again(tmp_path):
    """Fig. 7's curve, sampled from Table 2 at fn = 0.08 N, gives Table 2 back."""
    pad, p = sensor(mus=0.9, mud=0.8, x0=0.1, ct=0.2), SensorParameters()
    v = np.linspace(0.01, 1.5, 40)
    force = contact_laws.steady_friction(p, 0.08, v) + p.ct * v
    rows = "\n".join(f"{a},{b}" for a, b in zip(v, force, strict=True))
    (tmp_path / "friction.csv").write_text(f"velocity,force\n{rows}\n", encoding="utf-8")
    assert bpy.ops.palpate.friction_fit(filepath=str(tmp_path / "friction.csv"), normal_force=0.08) == {"FINISHED"}
    for name in ("mus", "mud", "x0", "ct"):
        assert getattr(pad.palpate, name) == pytest.approx(getattr(p, name), rel=1e-3), name
    assert "Palpate Friction Fit" in bpy.data.images


# --- where everything is found


def test_every_operator_is_in_a_menu(repository):
    """F3 finds what is in menus; what belongs to one row of a panel, or to a dialog, does not make sense there."""
    rows = {"effect_move", "effect_remove", "effect_copy", "object_activate", "preset_add", "preset_load", "face_set_choose"}
    rows |= {"log_question"}  # the dialog of Rig from Logs
    text = (repository / "panels" / "menus.py").read_text(encoding="utf-8")
    in_menus = set(re.findall(r'"palpate\.(\w+)"', text))
    assert set(dir(bpy.ops.palpate)) - in_menus - rows == set()
