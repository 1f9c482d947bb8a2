# SPDX-License-Identifier: GPL-3.0-or-later
"""Coupling matrices: the sparse form equals the dense one, and pairs of points are those of all distances."""

import numpy as np
import pytest

from palpate.core.effects.engine.coupling_matrix import coupled, coupling_matrix, nearest_distance, pairs_within


def test_the_near_part_of_a_matrix_does_what_the_whole_does(monkeypatch):
    weight, reach = lambda r: np.where(r <= 0.008, np.exp(-r / 0.003), 0.0), 0.008  # noqa: E731
    random = np.random.default_rng(3)
    position, area, signal = random.uniform(0, 0.05, (84, 3)), random.uniform(1, 2, 84), random.random((4, 84))
    for areas in (area, None):
        whole = coupling_matrix(position, weight, reach, areas)
        monkeypatch.setattr("palpate.core.effects.engine.coupling_matrix.LARGEST_DENSE", 0)
        near = coupling_matrix(position, weight, reach, areas)
        monkeypatch.undo()
        assert not isinstance(near, np.ndarray)
        np.testing.assert_allclose(coupled(signal, near), coupled(signal, whole), rtol=1e-12)


def test_texels_without_a_signal_add_nothing_to_a_product():
    random = np.random.default_rng(4)
    signal, matrix = random.random((40, 12)), random.random((12, 12))
    signal[:, [0, 3, 4, 11]] = 0.0
    signal[7, 5] = np.nan
    for loaded in (signal, signal[:9], np.zeros_like(signal)):
        np.testing.assert_allclose(coupled(loaded, matrix), loaded @ matrix.T, rtol=1e-13)


def test_pairs_of_points():
    position = np.random.default_rng(5).uniform(-1, 1, (200, 3))
    distance = np.linalg.norm(position[:, None] - position, axis=2)
    first, second, found = pairs_within(position, 0.4)
    expected = np.argwhere(distance <= 0.4)
    np.testing.assert_array_equal(np.stack([first, second], axis=1), expected)
    np.testing.assert_allclose(found, distance[first, second])
    np.fill_diagonal(distance, np.inf)
    assert nearest_distance(position) == pytest.approx(np.median(distance.min(axis=1)))
    grid = 0.0034 * np.stack(np.mgrid[0:14, 0:6, 0:1], axis=-1).reshape(-1, 3)
    assert nearest_distance(grid) == pytest.approx(0.0034)
    assert nearest_distance(np.linspace(0, 1, 5)[:, None] * [1.0, 0, 0]) == pytest.approx(0.25)
