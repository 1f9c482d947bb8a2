# SPDX-License-Identifier: GPL-3.0-or-later
"""The smooth surface of penetration: even depths stay, wide dents keep their lowest point, nothing is negative."""

import numpy as np
import pytest

from palpate.core.geometry.grid_layout import smooth_depth


def test_an_even_depth_stays_and_a_wide_dent_keeps_its_lowest_point():
    row, column = np.linspace(0, 15, 61), np.linspace(19, 0, 77)
    np.testing.assert_allclose(smooth_depth(np.full((16, 20), 2e-3), row, column), 2e-3, rtol=1e-12)
    y, x = np.mgrid[:16, :20]
    dent = np.maximum(3.0 - ((x - 9) ** 2 + (y - 7) ** 2) / 12.0, 0.0)
    assert smooth_depth(dent, row, column).max() == pytest.approx(3.0, rel=0.03)
    single = np.zeros((16, 20))
    single[7, 9] = 1.0
    surface = smooth_depth(single, row, column)
    assert 0.75 < surface.max() <= 1.0 and surface.min() == 0.0
    assert np.unravel_index(surface.argmax(), surface.shape) == (28, 40)


@pytest.mark.parametrize("shape", [(2, 2), (2, 7), (9, 7)])
def test_a_slope_stays_a_slope_away_from_the_borders(shape):
    rows, columns = (np.linspace(0, size - 1, 9) for size in shape)
    slope = 1.0 + np.add.outer(0.1 * np.arange(shape[0]), 0.2 * np.arange(shape[1]))
    found = smooth_depth(slope, rows, columns)
    expected = 1.0 + np.add.outer(0.1 * rows, 0.2 * columns)
    np.testing.assert_allclose(found, expected, atol=0.15)  # at a border the correction has neighbours on one side only
    if min(shape) > 6:
        assert found[4, 4] == pytest.approx(expected[4, 4], abs=0.02)
