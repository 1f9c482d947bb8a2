# SPDX-License-Identifier: GPL-3.0-or-later
"""Magnetic skins against closed forms: fields on and off the axis, their symmetries, and what moves them."""

import numpy as np
import pytest

from palpate.core.errors import ParameterError, SensorError
from palpate.core.gap.dataset.rig import grid_texels
from palpate.core.skins.magnetic_skin import (
    MU0_4PI,
    DipoleSum,
    Magnetometers,
    Magnets,
    layer_weights,
    magnetic_skin,
    pressure_below_point_load,
    texel_displacements,
)

THICKNESS = 6e-3


def random(seed=0):
    return np.random.default_rng(seed)


def dipole_field(offset, moment):
    """The flux density (T) of dipoles, written out (Jackson, Eq. 5.56): the oracle of :class:`DipoleSum`."""
    square = np.sum(offset**2, axis=-1, keepdims=True)
    along = np.sum(moment * offset, axis=-1, keepdims=True)
    return MU0_4PI * (3.0 * along * offset / square - moment) / square**1.5


def skin(rows=4, columns=4, pitch=4.7e-3, full_scale=50e-3, lift=3e-3, **changes):
    """A layer with a magnet above each of 4 × 4 magnetometers, as in a uSkin: texels are at z = 0."""
    texels = grid_texels(rows, columns, pitch, pitch)
    count = rows * columns
    place = texels.position - [0.0, 0.0, lift]
    magnets = Magnets(place, np.tile([0.0, 0.0, 4e-3], (count, 1)))
    chips = Magnetometers(
        texels.position - [0.0, 0.0, THICKNESS + 1e-3], np.tile(np.eye(3), (count, 1, 1)), full_scale, np.zeros((count, 3))
    )
    return texels, magnetic_skin(texels, changes.get("magnets", magnets), changes.get("chips", chips), THICKNESS)


def test_the_sum_of_fields_is_that_of_single_dipoles():
    at, place, moment = random(6).normal(size=(7, 3)), random(7).normal(size=(5, 4, 3)), random(8).normal(size=(4, 3))
    field, square = DipoleSum(at, moment).field(place)
    offset = at[None, :, None] - place[:, None]
    np.testing.assert_allclose(square, np.sum(offset**2, axis=3), rtol=1e-13)
    size = np.linalg.norm(dipole_field(offset, moment), axis=3).sum(axis=2, keepdims=True)
    assert (np.abs(field - dipole_field(offset, moment).sum(axis=2)) < 1e-13 * size).all()


def test_the_stress_below_a_point_load_carries_it():
    x = np.linspace(-0.3, 0.3, 1201)
    stress = pressure_below_point_load(4e-3, x[:, None] ** 2 + x[None] ** 2)
    carried = stress.sum() * (x[1] - x[0]) ** 2
    assert carried == pytest.approx(1.0, abs=2e-3)  # what lies outside: (d/R)³ / … and the sum's steps


def test_a_layer_that_is_pressed_evenly_moves_evenly():
    """The strain of a layer on a rigid base is the same at all depths: a point at half of it moves half as much."""
    texels = grid_texels(12, 12, 2e-3, 2e-3)
    place = np.array([[0.0, 0.0, -1.5e-3], [2e-3, 1e-3, -3e-3], [0.0, 0.0, -6e-3]])
    moved = layer_weights(texels, place, THICKNESS) @ np.tile([0.0, 3e-4, -1e-3], (len(texels), 1))
    np.testing.assert_allclose(moved[:, 2], [-0.75e-3, -0.5e-3, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved[:, 1], [0.225e-3, 0.15e-3, 0.0], atol=1e-15)


def test_a_magnet_that_comes_near_is_seen_as_the_dipole_says():
    texels, one = skin(rows=1, columns=1)
    displacement = np.zeros((3, 1, 3))
    displacement[1, 0, 2], displacement[2, 0, 0] = -1e-3, 1e-3
    values = one.readings(displacement).values[:, 0]
    moment = 4e-3
    assert values[0, 2] == pytest.approx(2 * MU0_4PI * moment / 4e-3**3, rel=1e-12)
    assert values[1, 2] == pytest.approx(2 * MU0_4PI * moment / 3.5e-3**3, rel=1e-12)  # half of the layer's motion
    assert values[0, 0] == 0.0 and values[2, 0] > 0.0  # below a magnet that moved along +x the field points along +x


def test_blocks_of_frames_give_the_same_bytes(monkeypatch):
    _, own = skin()
    displacement = 3e-4 * random(5).normal(size=(40, 16, 3))
    whole = own.readings(displacement).values
    monkeypatch.setattr("palpate.core.skins.magnetic_skin.BLOCK_NUMBERS", 16 * 16 * 7)
    assert own.readings(displacement).values.tobytes() == whole.tobytes()


def test_an_ambient_field_is_shared_and_turned_into_the_axes_of_each_chip():
    texels, _ = skin()
    turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    chips = Magnetometers(
        texels.position - [0.0, 0.0, 7e-3], np.stack([np.eye(3)] * 15 + [turned]), 50e-3, np.full((16, 3), 1e-6)
    )
    _, own = skin(chips=chips)
    ambient = np.array([[3e-5, -1e-5, 4e-5]])
    rest = np.zeros((1, 16, 3))
    added = own.readings(rest, ambient).values - own.readings(rest).values
    np.testing.assert_allclose(added[0, 3], ambient[0], atol=1e-17)
    np.testing.assert_allclose(added[0, 15], [-1e-5, -3e-5, 4e-5], atol=1e-17)
    np.testing.assert_allclose(own.readings(rest).values[0] - own.field_at_rest(), 1e-6, atol=1e-17)


def test_what_exceeds_the_range_is_clipped_and_said():
    _, own = skin(full_scale=12.6e-3)
    press = np.zeros((5, 16, 3))
    press[2:, 5, 2] = -2e-3
    found = own.readings(press)
    assert np.abs(found.values).max() == 12.6e-3 and found.clipped[2:, 5, 2].all() and not found.clipped[:2].any()
    assert found.said() == "channel z of magnetometer 5: beyond the range in 3 frames, and clipped there."
    assert skin()[1].readings(press).said() == ""


def test_displacements_follow_depth_and_shear():
    texels = grid_texels(1, 2, 1e-3, 1e-3)
    moved = texel_displacements(texels, np.array([[1e-3, 2e-3]]), np.array([[[0.1, 0.2], [0.0, 0.0]]]), 100.0)
    np.testing.assert_allclose(moved, [[[1e-3, 2e-3, -1e-3], [0.0, 0.0, -2e-3]]], atol=1e-18)


def magnets_at(place, moment=(0.0, 0.0, 4e-3)):
    return Magnets(np.array([place], float), np.array([moment], float))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"magnets": magnets_at([0.0, 0.0, -7e-3])}, "Magnet 0 is 7 mm below the texels and the layer is 6 mm thick"),
        ({"magnets": magnets_at([0.0, 0.0, -3e-3], (np.nan, 0.0, 0.0))}, "moments of magnets .* give finite numbers"),
        ({"magnets": Magnets(np.zeros((2, 3)), np.zeros((1, 3)))}, "moments of magnets"),
        (
            {"chips": Magnetometers(np.array([[0.0, 0.0, -3.1e-3]]), np.eye(3)[None], 0.05, np.zeros((1, 3)))},
            "inside its chip: place it higher",
        ),
        ({"full_scale": 0.0}, "give metres and tesla above zero"),
    ],
)
def test_skins_that_cannot_be(changes, sentence):
    with pytest.raises(SensorError, match=sentence):
        skin(rows=1, columns=1, **changes)


def test_displacements_that_cannot_be():
    _, own = skin()
    with pytest.raises(ParameterError, match=r"the skin has 16 texels: give \(T, 16, 3\)"):
        own.readings(np.zeros((2, 15, 3)))
    with pytest.raises(ParameterError, match="not numbers"):
        own.readings(np.full((2, 16, 3), np.nan))
    deep = np.zeros((1, 16, 3))
    deep[0, :, 2] = -8e-3
    with pytest.raises(ParameterError, match="inside its chip"):
        own.readings(deep)
