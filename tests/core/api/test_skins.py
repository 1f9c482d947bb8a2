# SPDX-License-Identifier: GPL-3.0-or-later
"""Magnetic skins from scripts: what a recording shows through them, and arguments that cannot be."""

import numpy as np
import pytest

import palpate as pp
from palpate.core.response.layer import texel_displacements


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


def test_fields_of_the_surroundings_and_offsets_add(pressed):
    pad, rec = pressed
    plain = rec.channels(skin(pad)).values
    earth = np.tile([2e-5, 0.0, -4e-5], (len(rec), 1))
    np.testing.assert_allclose(rec.channels(skin(pad), ambient=earth).values - plain, earth[:, None] + 0 * plain, atol=1e-16)
    np.testing.assert_allclose(rec.channels(skin(pad, offset=1e-4)).values - plain, 1e-4, atol=1e-16)
    clipped = rec.channels(skin(pad, full_scale=plain.max() * 0.99))
    assert clipped.clipped.any() and "clipped there" in clipped.said()


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


def test_another_sensor_and_a_stiffness_that_cannot_be(pressed):
    _, rec = pressed
    other = pp.Sensor.grid(2, 2, 4e-3)
    with pytest.raises(pp.PalpateError, match="the skin has 4 texels"):
        rec.channels(skin(other))
    with pytest.raises(pp.PalpateError, match="shear_stiffness is 0"):
        rec.channels(skin(pressed[0]), shear_stiffness=0.0)
