# SPDX-License-Identifier: GPL-3.0-or-later
"""Magnetic skins from scripts: what a recording shows through them, and arguments that cannot be."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from sample_bake import read_image
from scipy.spatial.transform import Rotation

import palpate as pp
from palpate.core.skins.magnetic_skin import texel_displacements


@pytest.fixture(scope="module")
def pressed():
    pad = pp.Sensor.grid(3, 3, 4e-3, k=400.0)
    down = np.stack([np.linspace(0, 2e-3, 12), np.zeros(12), np.full(12, 7.2e-3)], axis=1)
    return pad, pp.simulate(pad, pp.Body.sphere(8e-3), motion=down, fps=30)


def skin(pad, **changes):
    words = {
        "magnets": pad.texels.position - [0, 0, 3e-3],
        "moments": [0, 0, 4e-3],
        "magnetometers": pad.texels.position - [0, 0, 7e-3],
        "thickness": 6e-3,
    }
    return pp.magnetic_skin(pad, **(words | changes))


def test_a_recording_through_a_skin(pressed):
    pad, rec = pressed
    own, before = skin(pad), rec.reading.tobytes()
    seen = rec.channels(own, shear_stiffness=300.0)
    assert seen.values.shape == (len(rec), 9, 3) and seen.unit == "T" and not seen.clipped.any()
    expected = own.readings(texel_displacements(pad.texels, rec.depth, rec.shear, 300.0))
    np.testing.assert_array_equal(seen.values, expected.values)
    assert np.abs(rec.channels(own).values - seen.values).max() > 0.0  # shear is seen
    assert seen.values[-1, 4, 2] > own.field_at_rest()[4, 2]  # the magnet in the middle has come nearer
    assert rec.reading.tobytes() == before and rec.reading.shape == (len(rec), 9)
    earth = np.tile([2e-5, 0.0, -4e-5], (len(rec), 1))  # of the surroundings; it adds up with the offset
    shifted = rec.channels(skin(pad, offset=1e-4), shear_stiffness=300.0, ambient=earth).values - seen.values
    np.testing.assert_allclose(shifted, 1e-4 + earth[:, None] + 0.0 * shifted, atol=1e-16)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"magnets": [[0, 0]]}, "magnets has the shape"),
        ({"moments": [[0, 0, 1e-3]]}, "moments has the shape"),
        ({"moments": [0, 0, float("nan")]}, "moments is NaN"),
        ({"thickness": 0.0}, "thickness is 0: give a finite number above zero"),
        ({"full_scale": "much"}, "full_scale is 'much': give a number"),
        ({"axes": np.eye(3)}, "axes has the shape"),
        ({"offset": [1.0, 2.0]}, "offset has the shape"),
        ({"thickness": 2e-3}, "Magnet 0 is 3 mm below the texels and the layer is 2 mm thick"),
    ],
)
def test_arguments_that_cannot_be(pressed, changes, sentence):
    with pytest.raises(pp.PalpateError, match=sentence):
        skin(pressed[0], **changes)


def test_a_skin_without_magnetometers_is_refused(pressed):
    with pytest.raises(pp.PalpateError, match="needs moments, magnetometers and a thickness: give them, or .* one of uskin"):
        pp.magnetic_skin(pressed[0], pressed[0].texels.position - [0, 0, 3e-3], [0, 0, 4e-3])


def test_another_sensor_and_a_stiffness_that_cannot_be(pressed):
    _, rec = pressed
    other = pp.Sensor.grid(2, 2, 4e-3)
    with pytest.raises(pp.PalpateError, match="the skin has 4 texels"):
        rec.channels(skin(other))
    with pytest.raises(pp.PalpateError, match="shear_stiffness is 0"):
        rec.channels(skin(pressed[0]), shear_stiffness=0.0)


@pytest.mark.parametrize(("name", "magnets", "chips"), [("uskin", 16, 16), ("eflesh", 5, 5), ("anyskin", 36, 5)])
def test_a_preset_is_a_whole_skin_in_the_frame_of_its_pad(name, magnets, chips):
    """Of a turned and shifted pad all turn with it, so that readings stay; a press in the middle changes them symmetrically."""
    plain = pp.Sensor.grid(9, 9, 2.5e-3)
    own = pp.magnetic_skin(plain, name)
    assert own.magnets.place.shape == (magnets, 3) and own.magnetometers.place.shape == (chips, 3)
    turn = Rotation.from_rotvec([0.3, -1.2, 0.7]).as_matrix()
    texels, shift = plain.texels, [0.1, 0.2, 0.3]
    moved = {key: getattr(texels, key) @ turn.T for key in ("position", "normal", "tangent")}
    turned = replace(texels, **(moved | {"position": moved["position"] + shift}))
    other = pp.magnetic_skin(SimpleNamespace(texels=turned), name)
    press = np.zeros((1, 81, 3))
    press[0, 40] = [2e-4, 0.0, -1e-3]
    np.testing.assert_allclose(other.readings(press @ turn.T).values, own.readings(press).values, rtol=1e-9, atol=1e-12)
    press[0, 40, 0] = 0.0
    change = (own.readings(press).values[0] - own.field_at_rest())[:, :2]
    assert np.abs(change.sum(axis=0)).max() < 1e-9 * np.abs(change).max()


def test_what_a_preset_gives_may_be_replaced():
    pad = pp.Sensor.grid(9, 9, 2.5e-3)
    twice = pp.magnetic_skin(pad, "uskin", moments=[0.0, 0.0, 8e-3]).field_at_rest()
    np.testing.assert_allclose(twice, 2.0 * pp.magnetic_skin(pad, "uskin").field_at_rest(), rtol=1e-14)
    assert pp.magnetic_skin(pad, "uskin", full_scale=1e-3).magnetometers.full_scale == 1e-3


@pytest.mark.parametrize(
    ("pad", "name", "sentence"),
    [
        (pp.Sensor.grid(9, 9, 2.5e-3), "usking", "There is no skin 'usking'.* there are uskin, eflesh, anyskin"),
        (
            pp.Sensor.grid(4, 4, 2e-3),
            "uskin",
            "The pad covers 8 × 8 mm and the magnets of the skin 'uskin' lie within 14.1 × 14.1 mm",
        ),
    ],
)
def test_presets_that_cannot_be_used(pad, name, sentence):
    with pytest.raises(pp.PalpateError, match=sentence):
        pp.magnetic_skin(pad, name)


def test_a_vector_image_shows_changes_from_rest(pressed):
    pad, rec = pressed
    own = skin(pad)
    seen = rec.channels(own, shear_stiffness=300.0)
    figure = pp.draw_channels(own, seen, frames=(5, -1))
    first, last, bar = figure.axes
    assert first.get_title() == "frame 5" and last.get_title() == f"frame {len(rec) - 1}" and "mT" in bar.get_ylabel()
    dots, arrows = last.collections
    change = 1e3 * (seen.values[-1] - seen.values[0])
    np.testing.assert_allclose(dots.get_array(), change[:, 2])
    np.testing.assert_allclose(np.stack([arrows.U, arrows.V], axis=1), change[:, :2])
    low, high = dots.get_clim()
    both = 1e3 * (seen.values[[5, -1]] - seen.values[0])
    assert low == -high and high == pytest.approx(np.abs(both[..., 2]).max())
    longest = np.linalg.norm(both[..., :2], axis=-1).max()
    assert arrows.scale * 0.9 * 4.0 == pytest.approx(longest) and f"longest arrow {longest:.3g} mT" in bar.get_ylabel()
    with pytest.raises(pp.PalpateError, match="frame 99 is none of the 12 of the recording"):
        pp.draw_channels(own, seen, frames=(99,))
    with pytest.raises(pp.PalpateError, match="A vector image has the shape"):
        pp.draw_channels(pp.magnetic_skin(pp.Sensor.grid(9, 9, 2.5e-3), "eflesh"), seen)


def test_channels_are_saved_as_vector_images(pressed, tmp_path):
    pad, rec = pressed
    seen = rec.channels(skin(pad))
    paths = pp.save_channels(seen, tmp_path / "images", 3, 3)
    assert [path.name for path in paths] == [f"field_{frame:04d}.exr" for frame in range(len(rec))]
    channels, attributes = read_image(paths[-1])
    assert set(channels) == {"field.X", "field.Y", "field.Z"}
    for axis, name in enumerate(("field.X", "field.Y", "field.Z")):
        np.testing.assert_array_equal(channels[name][::-1].ravel(), seen.values[-1, :, axis].astype(np.float32))
    assert attributes["palpate.unit"] == "T" and attributes["palpate.frame"] == str(len(rec) - 1)
    (tmp_path / "images" / "field_0099.exr").write_bytes(b"of the user")
    shorter = replace(seen, values=seen.values[:1], clipped=seen.clipped[:1])
    pp.save_channels(shorter, tmp_path / "images", 3, 3)
    assert sorted(path.name for path in (tmp_path / "images").glob("*.exr")) == ["field_0000.exr", "field_0099.exr"]
    with pytest.raises(pp.PalpateError, match="4 × 4 places has 48 channels and these readings have 27"):
        pp.save_channels(seen, tmp_path / "other", 4, 4)
    with pytest.raises(pp.PalpateError, match="rows is 0"):
        pp.save_channels(seen, tmp_path / "other", 0, 9)
