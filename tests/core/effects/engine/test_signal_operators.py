# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators with memory: closed forms, and laws that they keep."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from palpate.core.effects.engine import signal_operators as operators


def _up_and_down(count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """(2 count,) a triangle from 0 to 1 and back; which samples fall."""
    rise = np.linspace(0.0, 1.0, count)
    return np.concatenate([rise, rise[::-1]])[:, None], np.arange(2 * count) >= count


def test_a_stop_slips_at_its_threshold_on_the_way_up_and_at_its_negative_on_the_way_down():
    x, falls = _up_and_down()
    out = operators.stop(x, 0.2)[:, 0]
    np.testing.assert_allclose(out[~falls], np.minimum(x[~falls, 0], 0.2), atol=1e-12)
    np.testing.assert_allclose(out[falls & (x[:, 0] > 0)], np.maximum(x[falls & (x[:, 0] > 0), 0] - 0.8, -0.2), atol=1e-12)


def test_relays_trail_by_their_width_on_the_way_up_and_by_nothing_on_the_way_down():
    x, falls = _up_and_down()
    out = operators.relays(x, 0.3)[:, 0]
    np.testing.assert_allclose(out[~falls], np.maximum(x[~falls, 0] - 0.3, 0.0), atol=1e-12)
    np.testing.assert_allclose(out[falls], np.minimum(x[falls, 0], 0.7), atol=1e-12)


@pytest.mark.parametrize(("operator", "up", "down"), [(operators.branch, 1.0, -1.0), (operators.falling, 0.0, 1.0)])
def test_branches_are_reached_exponentially_along_the_path(operator, up, down):
    x, falls = _up_and_down()
    out, length = operator(x, 0.1)[:, 0], 0.1
    np.testing.assert_allclose(out[~falls], up * -np.expm1(-x[~falls, 0] / length), atol=1e-12)
    top = up * -np.expm1(-1.0 / length)
    touching = falls & (x[:, 0] > 0)
    path = 1.0 - x[touching, 0]
    np.testing.assert_allclose(out[touching], down + (top - down) * np.exp(-path / length), atol=1e-12)
    assert out[-1] == 0.0  # without load


def test_a_low_pass_is_that_of_the_differential_equation_at_uneven_times():
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.01, 0.1, 60))
    x = np.cumsum(rng.normal(size=(60, 1)), axis=0)
    for at_rest in (True, False):
        start = 0.0 if at_rest else x[0, 0]

        def rate(t, q):
            return (np.interp(t, time, x[:, 0]) - q) / 0.3

        exact = solve_ivp(rate, (time[0], time[-1]), [start], "RK45", time, max_step=1e-3, rtol=1e-9)
        np.testing.assert_allclose(operators.low_pass(x, time, 0.3, at_rest)[:, 0], exact.y[0], atol=1e-5)


def test_a_delay_moves_a_straight_line_along():
    time = np.sort(np.random.default_rng(5).uniform(0.0, 4.0, 80))
    late = operators.delayed(time[:, None].copy(), time, 0.25)[:, 0]
    np.testing.assert_allclose(late, np.maximum(time - 0.25, time[0]), atol=1e-12)
