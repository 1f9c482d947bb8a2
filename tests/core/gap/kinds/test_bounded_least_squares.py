# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounded least squares from normal equations against those from the columns, which are nearly the same."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from palpate.core.gap.kinds.bounded_least_squares import bounded_minimum


@pytest.mark.parametrize("seed", range(8))
def test_the_minimum_is_that_of_scipy(seed):
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 5.0, 200)
    columns = np.stack([-np.expm1(-time / tau) for tau in np.geomspace(0.2, 8.0, 7)] + [np.ones(200)], axis=1)
    target = columns @ rng.uniform(-0.5, 1.0, 8) + 0.05 * rng.normal(size=200)
    low = np.array([0.0] * 7 + [-np.inf])
    found = bounded_minimum(columns.T @ columns, columns.T @ target, low, np.zeros(8))
    exact = lsq_linear(columns, target, (low, np.inf), method="bvls", tol=1e-14, max_iter=5000)
    assert np.all(found >= low)
    square = float(((columns @ found - target) ** 2).sum())
    # the columns are nearly parallel, so that only the function's value is determined well
    assert square <= 2.0 * exact.cost * (1.0 + 1e-6)


def test_a_column_of_zeros_stays_where_it_is():
    gram, right = np.diag([2.0, 0.0]), np.array([4.0, 0.0])
    found = bounded_minimum(gram, right, np.full(2, -9.0), np.zeros(2))
    np.testing.assert_allclose(found, [2.0, 0.0], atol=1e-6)


def test_what_the_equations_leave_open_stays_where_it_starts():
    gram, right = np.array([[1.0, 1.0], [1.0, 1.0]]), np.array([3.0, 3.0])
    found = bounded_minimum(gram, right, np.zeros(2), np.array([2.0, 0.5]))
    np.testing.assert_allclose(found, [2.25, 0.75], atol=1e-6)
    at_a_bound = bounded_minimum(gram, right, np.array([0.0, 1.0]), np.array([2.5, 1.0]))
    np.testing.assert_allclose(at_a_bound, [2.0, 1.0], atol=1e-6)
