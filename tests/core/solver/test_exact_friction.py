# SPDX-License-Identifier: GPL-3.0-or-later
"""LuGre friction through the whole solver against its formulas and scipy's stiff ODE solver; discs that turn and slide."""

import numpy as np
import pytest
from oracles.friction import (
    DISC,
    break_away,
    disc_load,
    disc_resistance,
    hysteresis,
    lag,
    limit_curve,
    pulled,
    steady_state,
)


# ---- steady sliding ----
@pytest.mark.parametrize("speed", [1e-4, 1e-3, 1e-2, 2e-2, 0.1, 1.0, 10.0])
def test_steady_sliding_follows_the_curve(speed):
    """g(v) + ct v to 1e-9, from deep in the Stribeck range to far above it; sixty bristle lengths leave e^-60 of the start."""
    assert steady_state(speed) < 1e-9


# ---- a given motion ----
def relative(drag, steps):
    _, shear, expected = drag(steps)
    return np.abs(shear - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize(("drag", "bar"), [(hysteresis, 2e-4), (lag, 2e-3)])
def test_smooth_motions_follow_scipy_to_the_first_order(drag, bar):
    """A motion sampled at steps has its velocity half a step late, so errors halve with the step; both bars are twice what
    was measured (9e-5 and 1.5e-3 at 1,200 steps). What is left when the first order is taken out is ten times less."""
    coarse, fine = relative(drag, 600), relative(drag, 1200)
    assert coarse / fine == pytest.approx(2.0, abs=0.05)
    assert fine < bar


# ---- a mass on a spring ----
def test_stick_slip_follows_scipy():
    """A block drawn by a spring sticks and slips, several times; errors halve with the step, and what is left without the
    first order (twice the finer less the coarser) is below 1.5 % of a slip (measured: 0.7 %)."""
    _, coarse, _, expected, _, spring = pulled(0.01, 2.0, 2e-4)
    _, fine, friction, _, expected_friction, _ = pulled(0.01, 2.0, 1e-4)
    assert spring[1:].min() > 0.0
    advance = np.diff(expected)
    slips = np.flatnonzero((advance[1:] > 1e-4) & (advance[:-1] <= 1e-4))
    assert len(slips) >= 3
    slip = 4e-3  # metres
    assert np.abs(coarse - expected).max() / np.abs(fine - expected).max() == pytest.approx(2.0, abs=0.1)
    assert np.abs(fine - expected).max() < 0.1 * slip
    assert np.abs(2 * fine - coarse - expected).max() < 0.015 * slip
    held = expected_friction.max()
    assert friction.max() == pytest.approx(held, rel=1e-3)


def test_break_away_comes_sooner_the_faster_the_load_grows():
    """Largest friction before slip at 0.5, 2, 10 and 50 N/s, as scipy's; steps in proportion to the time it takes."""
    forces = np.array([break_away(rate, 2e-4 / rate) for rate in (0.5, 2.0, 10.0, 50.0)])
    np.testing.assert_allclose(forces[:, 0], forces[:, 1], rtol=1e-4)
    assert (np.diff(forces[:, 0]) < -0.03).all()


# ---- torsion ----
def test_a_turning_disc_is_held_by_two_thirds_of_mu_f_r():
    """Edge effects of square texels on a round contact are 1 % at 64 a side and fall with the order of its edge, 1.5."""
    errors = [abs(disc_resistance(0.0, 1.0, n)[0][1] / (disc_load(n) * DISC) - 2 / 3) * 1.5 for n in (32, 64, 128)]
    assert errors[1] < 0.01
    assert errors[2] < 0.004


@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.3, 0.6, 1.0, 1.5, 3.0, 10.0])
def test_sliding_and_turning_at_once_stay_on_the_limit_curve(ratio):
    """Speed : spin · R in every proportion. Each texel is slowed against its own velocity (1e-3: the disc moves a little while
    the bristles follow), and their sum lies on the integrated curve (1 %: square texels on a round edge, 96 a side)."""
    measured, summed = disc_resistance(ratio * DISC, 1.0, 96)
    size = np.array([disc_load(96), disc_load(96) * DISC])
    np.testing.assert_allclose(measured / size, summed / size, atol=5e-3)
    np.testing.assert_allclose(measured / size, limit_curve(ratio * DISC, 1.0), atol=0.01)
