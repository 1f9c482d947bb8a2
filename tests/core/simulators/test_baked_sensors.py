# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors from a .blend and the files of its bake, without Blender."""

import os
from dataclasses import asdict, replace

import numpy as np
import pytest
from sample_bake import grid_texels, round_texels, write_sensor

import palpate as pp
from palpate.core.effects.engine.registry import effect, to_dict
from palpate.core.errors import FileError
from palpate.core.io.bake_folder import MANIFEST_NAME, UNCHANGED_NOTE, BakeOwner, read_manifest, write_manifest
from palpate.core.model.sensor_parameters import Painted, SensorParameters

EFFECTS = [to_dict(effect("creep", amount=0.2)), to_dict(effect("noise", seed=7))]
PARAMETERS = SensorParameters(k=123.0, mus=0.4)
PAINT = np.linspace(0.5, 1.5, 15)


@pytest.fixture
def blend(tmp_path):
    """A .blend that is older than its bake of two sensors, one of them painted and with effects."""
    path, folder = tmp_path / "hand.blend", tmp_path / "palpate-bake"
    path.write_bytes(b"BLENDER")
    os.utime(path, (1e9, 1e9))
    write_sensor(folder, "cap", round_texels(), sensors=("cap", "pad"))
    write_sensor(folder, "pad", grid_texels(), Painted(k=PAINT), parameters=PARAMETERS, sensors=("cap", "pad"))
    change(folder, "cap", effects=[])
    change(folder, "pad", effects=EFFECTS)
    return path


def change(folder, name, **words):
    about = {"bake_id": "ab" * 16, "scene_path": "../hand.blend"} | words
    write_manifest(folder / name, replace(read_manifest(folder / name), **about))


def test_texels_paint_parameters_and_effects_are_those_of_the_bake(blend):
    found = pp.sensors_from_blend(blend)
    assert list(found) == ["cap", "pad"]
    pad, texels = found["pad"], grid_texels()
    assert (pad.texels.position == texels.position).all() and (pad.texels.normal == texels.normal).all()
    assert asdict(pad.parameters) == asdict(PARAMETERS) and (pad.sensor.painted.k == PAINT).all()
    assert [to_dict(one) for one in pad.effects] == EFFECTS and found["cap"].effects == ()
    assert len(found["cap"].faces) == 12 and list(pp.sensors_from_blend(str(blend), "pad")) == ["pad"]


def test_the_sensor_of_a_blend_is_pressed_in_a_loop(blend):
    """A plate 1 mm deep in every texel: k times what is painted, times the depth; the creep has not begun."""
    pad = pp.sensors_from_blend(blend, "pad")["pad"].with_effects()
    plate = pp.Body.box((0.1, 0.1, 0.02), position=(0.0, 0.0, 0.009))
    pressed = pp.PressedSensor(pad, plate, 1e-3)
    contact = pressed.step((pad.position, pad.quaternion), (plate.position, plate.quaternion))
    assert contact.texels.normal_force == pytest.approx(123.0 * PAINT * 1e-3, rel=1e-9)


@pytest.mark.parametrize(
    "names, message",
    [(("pat",), "sensor 'pat' .did you mean 'pad'..: choose from cap, pad."), (("wrist",), "sensor 'wrist': choose from cap")],
)
def test_an_unknown_sensor_is_refused(blend, names, message):
    with pytest.raises(FileError, match=message):
        pp.sensors_from_blend(blend, *names)


def test_without_a_bake_the_command_is_named(blend, tmp_path):
    (tmp_path / "palpate-bake").rename(tmp_path / "elsewhere")
    with pytest.raises(FileError, match="has no bake in '.*palpate-bake': run 'palpate bake .*hand.blend', or give"):
        pp.sensors_from_blend(blend)
    change(tmp_path / "elsewhere", "pad", effects=[])
    assert list(pp.sensors_from_blend(blend, folder=tmp_path / "elsewhere")) == ["cap", "pad"]
    with pytest.raises(FileError, match="does not exist: give the path of a .blend"):
        pp.sensors_from_blend(tmp_path / "none.blend")


def test_a_blend_that_was_saved_after_its_bake_has_to_say_that_it_is_unchanged(blend, tmp_path):
    later = (tmp_path / "palpate-bake" / "pad" / MANIFEST_NAME).stat().st_mtime + 60
    os.utime(blend, (later, later))
    with pytest.raises(FileError, match="was saved after its bake in .* and may have changed: run 'palpate bake"):
        pp.sensors_from_blend(blend)
    for note, is_good in ((UNCHANGED_NOTE + "cd" * 16, False), (UNCHANGED_NOTE + "ab" * 16, True)):
        blend.write_bytes(b"BLENDER\0" + note.encode() + b"\0")
        os.utime(blend, (later, later))
        if is_good:
            assert len(pp.sensors_from_blend(blend)) == 2
        else:
            with pytest.raises(FileError, match="was saved after its bake"):
                pp.sensors_from_blend(blend)


def test_the_bake_of_another_blend_is_refused(blend, tmp_path):
    other = tmp_path / "other.blend"
    other.write_bytes(b"BLENDER")
    owner = BakeOwner(blend=other)
    for name in ("cap", "pad"):
        change(tmp_path / "palpate-bake", name, scene_path=owner.scene_path(tmp_path / "palpate-bake"))
    with pytest.raises(FileError, match="is the bake of '.*other.blend' and not of '.*hand.blend'"):
        pp.sensors_from_blend(blend)


def test_a_manifest_of_an_older_version_does_not_name_effects(blend, tmp_path):
    change(tmp_path / "palpate-bake", "cap", effects=None)
    with pytest.raises(FileError, match="of an older version and does not name the sensor's effects: run 'palpate bake"):
        pp.sensors_from_blend(blend)
    assert pp.read_bake(tmp_path / "palpate-bake")["cap"].unit == "N"


def test_an_effect_that_is_none_is_damage(blend, tmp_path):
    change(tmp_path / "palpate-bake", "pad", effects=[{"name": "crept"}])
    with pytest.raises(FileError, match="manifest.json' is damaged .There is no effect 'crept'"):
        pp.sensors_from_blend(blend, "pad")
