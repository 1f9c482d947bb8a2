# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel's study: what is right-clicked gets its name and range, and the file says what the panel shows."""

import bpy
import pytest
from blender_scenes import cube, press_and_drop, refusal, save, scenario_of

from palpate.addon.study import property_path, study_settings
from palpate.core.errors import PalpateError
from palpate.core.study.presses import PRESS_PARAMETERS
from palpate.core.study.study_file import plan_for, read_study


@pytest.fixture
def shown():
    """A pad with an effect, a free cube, and a driven one."""
    scene, pad, _, _, free = press_and_drop()
    bpy.context.view_layer.objects.active = pad
    bpy.ops.palpate.effect_add(effect="creep")
    driven = cube("Slider", (0.4, 0.0, 0.0))
    driven.palpate.role, driven.palpate.body = "TARGET", "DRIVEN"
    driven.palpate.drive_control = "VELOCITY"
    free.palpate.velocity = (0.1, 0.0, 0.0)
    return scene, pad, free, driven


def path(owner, key, index=-1):
    found = property_path.path_of(owner, key, index)
    assert found.startswith("bpy.data.")
    return found


def test_properties_get_the_names_that_the_solver_knows(shown):
    scene, pad, free, driven = shown
    creep = pad.palpate.effects[0]
    wanted = {
        path(pad.palpate, "k"): "Pad.k",
        path(pad.palpate, "normal_law"): "Pad.normal_law",
        path(creep, "creep_exponential_amount"): "Pad.effect.creep.amount",
        path(creep, "use"): "Pad.effect.creep",
        path(creep, "creep_form"): "Pad.effect.creep.form",
        path(free.palpate, "mass"): "Cube.mass",
        path(free.palpate, "velocity", 0): "Cube.velocity.x",
        path(driven.palpate, "drive_damping"): "Slider.drive.damping",
        path(driven.palpate, "drive_speed"): "Slider.drive.target",
        path(scene, "gravity", 2): "gravity.z",
        path(free, "scale", 1): 'bpy.data.objects["Cube"].scale[1]',
        path(driven.palpate, "mass"): "Slider.mass",
    }
    assert {one: study_settings.entry_for(one).name for one in wanted} == wanted


def test_every_entry_is_a_name_of_the_study_of_this_scene(shown, tmp_path):
    """Whatever the panel writes, the reader of studies understands."""
    scene, pad, free, driven = shown
    creep = pad.palpate.effects[0]
    chosen = [(pad.palpate, "k"), (pad.palpate, "normal_law"), (creep, "use"), (free.palpate, "velocity")]
    chosen += [(driven.palpate, key) for key in ("drive_damping", "drive_speed", "mass")]
    for owner, key in (*chosen, (creep, "creep_exponential_amount"), (scene, "gravity")):
        assert bpy.ops.palpate.study_vary(path=path(owner, key)) == {"FINISHED"}
    own = scene.palpate.study
    names = [item.name for item in own.variables]
    assert names[3:6] == ["Cube.velocity.x", "Cube.velocity.y", "Cube.velocity.z"]
    stiffness = own.variables["Pad.k"]
    assert (stiffness.low, stiffness.high) == pytest.approx((pad.palpate.k * 0.5, pad.palpate.k * 1.5))
    assert stiffness.unit == "N/m"
    save(tmp_path)
    own.file, own.samples, own.seed = str(tmp_path / "study.toml"), 7, 3
    stiffness.distribution = "LOG_UNIFORM"
    assert bpy.ops.palpate.study_write() == {"FINISHED"}
    study = read_study(tmp_path / "study.toml")
    design = study.design
    assert (study.scenes, design.kind, design.samples, design.seed) == (("scene.blend",), "latin-hypercube", 7, 3)
    plan = plan_for(study, scenario_of(scene))
    assert list(plan.varied) == names
    assert plan.varied["Pad.k"].kind == "log-uniform"
    assert plan.varied["Pad.normal_law"].words == ("linear", "hunt-crossley")
    assert plan.varied["Pad.effect.creep"].words == (True, False)


def test_presses_and_a_grid_are_written_as_the_panel_shows_them(shown, tmp_path):
    scene, pad, _, _ = shown
    own = scene.palpate.study
    save(tmp_path)
    own.file, own.use_press, own.slide, own.images = str(tmp_path / "s"), True, 2e-3, True
    tables = study_settings.study_tables(scene)
    assert tables["press"] == {"depth": {"uniform": [0.5e-3, 2e-3]}, "slide": {"uniform": [0.0, 2e-3]}}
    own.press_by, own.twist, own.slide = "FORCE", 0.5, 0.0
    assert study_settings.study_tables(scene)["press"] == {"force": {"uniform": [0.5, 2.0]}, "twist": {"uniform": [-0.5, 0.5]}}
    own.use_press, own.design = False, "GRID"
    study_settings.vary(scene, path(pad.palpate, "k"))
    item = own.variables[0]
    item.levels, item.distribution, item.mean, item.deviation = 3, "NORMAL", 60.0, 5.0
    bpy.ops.palpate.study_write()
    study = read_study(tmp_path / "s.toml")
    assert study.vary == {"Pad.k": {"normal": [60.0, 5.0], "levels": 3}}
    assert (study.design.kind, study.images, study.press) == ("grid", True, None)


def test_undo_and_mistakes(shown, tmp_path):
    scene, pad, _, _ = shown
    bpy.ops.palpate.study_vary(path=path(pad.palpate, "k"))
    assert "varies in the study already" in refusal(bpy.ops.palpate.study_vary, path=path(pad.palpate, "k"))
    with pytest.raises(RuntimeError, match="did you mean"):
        bpy.ops.palpate.study_vary(path='bpy.data.objects["Pad"].scle[0]')
    assert "save the .blend first" in refusal(bpy.ops.palpate.study_write)
    assert bpy.ops.palpate.study_remove(index=0) == {"FINISHED"}
    assert not scene.palpate.study.variables
    save(tmp_path)
    with pytest.raises(PalpateError, match="varies nothing"):
        study_settings.write_study(scene)
    assert "no report" in refusal(bpy.ops.palpate.study_report)


def test_numbers_of_presses_have_the_units_of_the_file(shown):
    own = shown[0].palpate.study.bl_rna.properties
    for name in ("depth_low", "depth_high", "force_low", "force_high", "slide", "tilt", "twist"):
        unit = PRESS_PARAMETERS[name.partition("_")[0]].unit
        assert own[name].name.endswith(f"({unit})")
