# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact law against the plain formulas of the paper, and against scipy's stiff solvers."""

import numpy as np
import pytest
from oracles import contact_laws
from scipy.integrate import solve_ivp

from palpate.core.laws import friction, normal_force
from palpate.core.laws.contact_law import contact_law
from palpate.core.model.sensor_parameters import SensorParameters

PAPER = SensorParameters()  # Table 2; Fig. 7 was drawn with these and fn = 0.08 N
LAW = contact_law(PAPER)


def test_normal_force_never_pulls():
    for rate in (0.0, 0.5):
        expected = contact_laws.normal_force(PAPER, 1e-3, rate)
        assert normal_force.normal_force(1e-3, rate, LAW) == pytest.approx(expected, rel=1e-15)
    assert normal_force.normal_force(1e-3, -100.0, LAW) == 0.0


@pytest.mark.parametrize("speed", [0.0, 1e-3, 0.05, 0.3, 1.0, 5.0])
def test_steady_state_is_the_friction_curve_of_fig_7(speed):
    """At steady sliding ż = 0, so ft = g(v) sign(v) + ct v (Eq. 9 and 13); reached by the step itself to 1e-9."""
    fn = 0.08
    assert friction.stribeck_coefficient(speed**2, LAW) * fn == pytest.approx(
        contact_laws.steady_friction(PAPER, fn, speed), rel=1e-14
    )
    z = 0.0
    for _ in range(400):
        keep, gain = friction.bristle_step(speed**2, fn, 0.1, LAW)
        z = friction.next_deflection(keep, z, gain, speed)
    if speed > 0:
        rate = friction.bristle_rate(z, speed, speed**2, fn, LAW)
        expected = contact_laws.steady_friction(PAPER, fn, speed) + PAPER.ct * speed
        assert friction.friction_force(z, rate, speed, LAW) == pytest.approx(expected, rel=1e-9 if speed > 0.01 else 0.6)
    else:
        assert z == 0.0


@pytest.mark.parametrize("dt", [1e-6, 1e-3, 0.1, 100.0])
def test_bristle_step_is_the_exact_solution_at_constant_velocity(dt):
    """Against scipy's Radau at 1e-11, for steps from far below to far above the bristle's own time."""
    fn, speed, z0 = 0.08, 0.2, 0.004
    exact = solve_ivp(
        lambda _, z: contact_laws.bristle_rate(PAPER, fn, z, speed), (0, dt), [z0], method="Radau", rtol=1e-11, atol=1e-15
    )
    keep, gain = friction.bristle_step(speed**2, fn, dt, LAW)
    assert friction.next_deflection(keep, z0, gain, speed) == pytest.approx(exact.y[0, -1], rel=1e-8)


@pytest.mark.parametrize("dt", [1e-4, 1e-2, 0.1, 1.0])
@pytest.mark.parametrize("forces", [(0.04, 0.12), (0.12, 0.04), (0.0, 0.08)])
def test_bristles_follow_a_force_that_changes_in_the_step(dt, forces):
    """Against scipy's Radau along an even change of the force, for steps that keep all of a deflection to some that keep none.

    The step takes the decay at its mean, so that it is no exact solution: it is off by 4.5 % of the largest deflection at most,
    where a step under the mean force alone is off by 31 %.
    """
    before, after = forces
    speed = 0.2
    exact = solve_ivp(
        lambda t, z: contact_laws.bristle_rate(PAPER, max(before + (after - before) * t / dt, 1e-9), z, speed),
        (0, dt), [0.0], method="Radau", rtol=1e-10, atol=1e-15,
    ).y[0, -1]  # fmt: skip
    keep, gain = friction.ramped_bristle_step(speed**2, before, after, dt, LAW)
    largest = friction.max_bristle_deflection(max(forces), LAW)
    assert gain * speed == pytest.approx(exact, abs=0.05 * largest)
    steady = friction.ramped_bristle_step(speed**2, after, after, dt, LAW)
    assert steady == pytest.approx(friction.bristle_step(speed**2, after, dt, LAW), rel=1e-12)


def test_bristles_hold_nothing_without_normal_force_or_friction():
    assert friction.ramped_bristle_step(1.0, 0.0, 0.0, 1e-3, LAW) == (0.0, 0.0)
    assert friction.bristle_step(1.0, 0.0, 1e-3, LAW) == (0.0, 0.0)
    slippery = LAW._replace(mus=0.0, mud=0.0)
    assert friction.bristle_step(1.0, 1.0, 1e-3, slippery) == (0.0, 0.0)
    assert friction.max_bristle_deflection(1.0, slippery) == 0.0


def test_sticking_is_for_ever():
    """At zero velocity the bristle keeps every bit, whatever the step: no creep can come from the law itself."""
    keep, gain = friction.bristle_step(0.0, 0.5, 1e-3, LAW)
    assert keep == 1.0
    assert gain == 1e-3


def test_relaxation_is_exp_to_rounding():
    """Against numpy's exp and expm1, from nothing to far beyond what doubles tell from zero."""
    for x in [0.0, 5e-324, 1e-300, *np.logspace(-20, 6, 521)]:
        left, mean = friction.decay_and_mean(x)
        assert left == pytest.approx(np.exp(-x), rel=0, abs=5e-16)
        assert mean == pytest.approx(-np.expm1(-x) / x if x else 1.0, rel=2e-15)
        assert 0.0 <= left <= 1.0
