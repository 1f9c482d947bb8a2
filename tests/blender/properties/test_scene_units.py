# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths, velocities and masses are typed in the scene's units, and are in SI units in every file."""

import bpy
import numpy as np
import pytest
from blender_scenes import press, reopen, save, scenario_of

from palpate.addon.properties.parameter_properties import sensor_parameters
from palpate.addon.properties.scene_units import ENDING, KINDS, name_in_units
from palpate.addon.session import transforms
from palpate.core.io.sensor_toml import SensorModel, read_sensor, write_sensor
from palpate.core.model.body import DRIVE_PARAMETERS
from palpate.core.model.sensor_parameters import SENSOR_PARAMETERS

SHOWN = {"max_penetration": 1, "x0": 1, "drive_max_speed": 1, "mass": 3}
"""Properties of an object, and the power of the unit scale with which Blender shows them."""


def set_units(system="METRIC", scale=1.0):
    own = bpy.context.scene.unit_settings
    own.system, own.scale_length = system, scale


@pytest.mark.parametrize("scale", [1.0, 0.001, 0.01, 0.0254])
@pytest.mark.parametrize("name", SHOWN)
def test_what_is_typed_in_units_of_the_scene_is_stored_in_si(name, scale):
    """Blender divides what is typed, as 12 mm, by the scale; what is stored is the number that was meant, bit for bit."""
    scene, pad, _ = press()
    set_units(scale=scale)
    own, size = pad.palpate, transforms.metres_per_unit(scene) ** SHOWN[name]
    for meant in np.random.default_rng(3).integers(1, 99999, 200) * 1e-6:
        meant = float(f"{meant:.6g}")
        setattr(own, name + ENDING, meant / size)
        assert transforms.as_typed(getattr(own, name)) == meant
        assert getattr(own, name + ENDING) == pytest.approx(meant / size, rel=2e-7)
    assert name + ENDING not in own  # the file has the SI value alone


def test_a_velocity_and_the_lengths_of_a_pattern():
    scene, pad, _ = press()
    set_units(scale=0.001)
    pad.palpate.velocity_in_units = (20.0, -5.5, 0.0)
    assert [transforms.as_typed(value) for value in pad.palpate.velocity] == [0.02, -0.0055, 0.0]
    for name in ("pitch_x", "pitch_y", "shift_x", "shift_y", "spacing", "lift"):
        setattr(pad.palpate.skin, name + ENDING, 3.4)
        assert transforms.as_typed(getattr(pad.palpate.skin, name)) == 0.0034
    scene.palpate.figures.marker_pitch_in_units = 1.5
    assert transforms.as_typed(scene.palpate.figures.marker_pitch) == 0.0015


def test_bounds_are_those_of_the_value_in_si():
    _, pad, _ = press()
    set_units(scale=0.001)
    pad.palpate.max_penetration_in_units = -3.0
    assert pad.palpate.max_penetration == 0.0


@pytest.mark.parametrize("system", ["METRIC", "IMPERIAL", "NONE"])
def test_the_units_of_a_scene_change_no_file(tmp_path, system):
    """A sensor that was described in one system is the same in each: scenario, sensor.toml and saved file."""
    scene, pad, _ = press()
    pad.palpate.max_penetration, pad.palpate.x0 = 0.0123, 0.25
    before = scenario_of(scene).digest()
    write_sensor(tmp_path / "before.toml", SensorModel("Pad", sensor_parameters(pad.palpate)))
    set_units(system)
    scene.unit_settings.length_unit = "MILLIMETERS" if system == "METRIC" else "ADAPTIVE"
    for name in ("max_penetration", "x0"):
        shown = name_in_units(pad.palpate, name, scene)
        assert shown == (name if system == "NONE" else name + ENDING)
        setattr(pad.palpate, shown, getattr(pad.palpate, shown))  # as a user who confirms a field without a change
    save(tmp_path)
    scene = reopen(tmp_path / "scene.blend")
    own = scene.objects["Pad"].palpate
    write_sensor(tmp_path / "after.toml", SensorModel("Pad", sensor_parameters(own)))
    assert (tmp_path / "after.toml").read_bytes() == (tmp_path / "before.toml").read_bytes()
    assert read_sensor(tmp_path / "after.toml").parameters.max_penetration == 0.0123
    assert scenario_of(scene).digest() == before


def test_every_parameter_with_a_unit_of_blender_is_shown_in_it():
    own = bpy.types.Object.bl_rna.properties["palpate"].fixed_type.properties
    kinds = {unit: kind for unit, (kind, _) in KINDS.items()}
    for names in (SENSOR_PARAMETERS, {f"drive_{name}": item for name, item in DRIVE_PARAMETERS.items()}):
        for name, parameter in names.items():
            if name in own and getattr(parameter, "unit", "") in kinds:
                assert own[name + ENDING].unit == kinds[parameter.unit]
