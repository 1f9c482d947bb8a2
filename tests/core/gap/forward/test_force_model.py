# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of texels with equal histories, and the velocity of an indenter where it touches them, against plain formulas."""

import numpy as np

from palpate.core.gap.forward.force_model import _equal_columns
from palpate.core.gap.forward.stimulus import split_velocities


def test_equal_columns_are_equal_in_all_arrays():
    rng = np.random.default_rng(4)
    for _ in range(20):
        # Few different columns in each array, so that some are equal in the first and differ in the last.
        arrays = [rng.normal(size=(12, 3))[:, rng.integers(0, 3, 15)] for _ in range(3)]
        columns = rng.permutation(15)[:11]
        first, group = _equal_columns(arrays, columns)
        equal = np.array([[all((a[:, i] == a[:, j]).all() for a in arrays) for i in columns] for j in columns])
        np.testing.assert_array_equal(group[:, None] == group, equal)
        np.testing.assert_array_equal(first, [np.flatnonzero(group == number)[0] for number in range(group.max() + 1)])


def test_velocities_are_split_where_something_touches():
    rng = np.random.default_rng(5)
    travel, spin, centre = rng.normal(size=(3, 6, 3))
    along, point, normal = rng.normal(size=(3, 6, 4, 3))
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    depth = np.maximum(rng.normal(size=(6, 4)), 0.0)
    rate, slide, slip = np.zeros((6, 4)), np.zeros((6, 4)), np.zeros((6, 4, 3))
    split_velocities((travel, spin, centre), along, depth, normal, point, (rate, slide, slip))
    velocity = travel[:, None] + np.cross(spin[:, None], point - centre[:, None]) + along
    inward = np.einsum("tnk,tnk->tn", velocity, normal)
    rest = velocity - inward[:, :, None] * normal
    touching = depth > 0.0
    np.testing.assert_allclose(rate, np.where(touching, inward, 0.0), rtol=1e-13)
    np.testing.assert_allclose(slip, np.where(touching[:, :, None], rest, 0.0), rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(slide, np.where(touching, np.linalg.norm(rest, axis=2), 0.0), rtol=1e-9)
