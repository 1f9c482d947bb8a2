# SPDX-License-Identifier: GPL-3.0-or-later
"""Laws on forces against closed forms, and against SciPy where there is none."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import erf

from palpate.core.effects.engine.contact_forces import friction_factors, normal_forces
from palpate.core.effects.engine.registry import actual_placement, effect
from palpate.core.model.sensor_parameters import SensorParameters

K = 1000.0
SPRING = SensorParameters(k=K, cn=0.0)
TIME = np.linspace(0.0, 20.0, 2001)


def force(item, depth, slide=None, time=TIME, parameters=SPRING):
    """One texel's force over time."""
    slide = None if slide is None else np.asarray(slide, float)[:, None]
    return normal_forces((item,), parameters, time, np.asarray(depth, float)[:, None], slide)[:, 0]


def ramp_and_hold(at=1.0, depth=0.002):
    """Pressed in over a second, then held."""
    return depth * np.clip(TIME / at, 0.0, 1.0)


def wave(depth=0.002):
    return depth * np.maximum(np.sin(1.3 * TIME) + 0.4 * np.sin(4.1 * TIME), 0.0)


# --- stiffening: closed formulas


def test_stiffening():
    d = np.linspace(0.0, 0.006, len(TIME))
    np.testing.assert_allclose(
        force(effect("stiffening", "polynomial", depth=0.004, exponent=1.5), d), K * d * (1 + (d / 0.004) ** 1.5), rtol=1e-12
    )
    np.testing.assert_allclose(
        force(effect("stiffening", "exponential", depth=0.004), d), K * 0.004 * np.expm1(d / 0.004), rtol=1e-8, atol=1e-15
    )
    np.testing.assert_allclose(
        force(effect("stiffening", "foam", depth=0.01, exponent=2.0), d), K * d / (1 - (d / 0.01) ** 2), rtol=1e-12
    )
    width = 0.002 / 3.0
    bent = 1.5 * width * (np.logaddexp(0.0, (d - 0.002) / width) - np.logaddexp(0.0, -3.0))
    spring = effect("stiffening", "bilinear", depth=0.002, growth=1.5, sharpness=3.0)
    np.testing.assert_allclose(force(spring, d), K * (d + bent), rtol=1e-9, atol=1e-15)
    sharp = effect("stiffening", "bilinear", depth=0.002, growth=1.5, sharpness=60.0)  # w ln 2 beside the corner at most
    corner = K * (d + 1.5 * np.maximum(d - 0.002, 0.0))
    np.testing.assert_allclose(force(sharp, d), corner, rtol=0, atol=1.01 * K * 1.5 * 0.002 / 60.0 * np.log(2.0))


@pytest.mark.parametrize(("form", "edge"), [("exponential", 30.0), ("foam", 0.95)])
def test_stiffening_goes_on_straight_where_its_formula_would_run_away(form, edge):
    """The factor has no kink at the edge, and a force far past it is large but finite."""
    item = effect("stiffening", form, depth=0.001)
    around = edge * 0.001 * (1.0 + 1e-6 * np.array([-1.0, 0.0, 1.0]))
    low, middle, high = force(item, around, time=np.arange(3.0)) / around
    assert (high - middle) == pytest.approx(middle - low, rel=1e-3)
    assert np.isfinite(force(item, [0.0, 1.0, 1.0], time=np.arange(3.0))).all()


# --- creep: the step response is the definition, a ramp is its integral


@pytest.mark.parametrize("time", [0.05, 0.7, 5.0])
def test_creep_after_a_ramp(time):
    """``τ q̇ = f − q`` for a ramp that is then held, which the filter follows exactly."""
    depth, full = ramp_and_hold(), K * 0.002
    q = np.where(
        TIME <= 1.0,
        full * (TIME - time * (1 - np.exp(-TIME / time))),
        full * (1 - time * (np.exp((1 - TIME) / time) - np.exp(-TIME / time))),
    )
    found = force(effect("creep", amount=0.4, time=time), depth)
    np.testing.assert_allclose(found, K * depth - 0.4 * q, rtol=0, atol=1e-12)


def test_creep_with_two_times_is_the_sum_of_two():
    """What the first takes and what the second takes add up, for any motion."""
    depth = wave()
    both = force(effect("creep", "two-exponentials", amount=0.3, time=0.5, amount_2=0.2, time_2=6.0), depth)
    one = force(effect("creep", amount=0.3, time=0.5), depth) - K * depth
    other = force(effect("creep", amount=0.2, time=6.0), depth) - K * depth
    np.testing.assert_allclose(both, np.maximum(K * depth + one + other, 0.0) * (depth > 0), atol=1e-12)


@pytest.mark.parametrize(
    ("form", "response"),
    [
        ("logarithmic", lambda t: 1 - 0.1 * np.log10(1 + t / 0.2)),
        ("power", lambda t: 1 - 0.5 * (1 - (1 + t / 0.2) ** -0.4)),
    ],
)
def test_slow_creep_follows_its_law_over_four_decades(form, response):
    """Fourteen exponentials stand for a spectrum: the step response is right to 0.1 % of the force."""
    time = np.concatenate([[0.0, 1e-9], np.geomspace(1e-3, 2000.0, 300)])
    depth = np.where(time > 0, 0.002, 0.0)
    values = {"amount": 0.1} if form == "logarithmic" else {"amount": 0.5, "exponent": 0.4}
    found = force(effect("creep", form, time=0.2, **values), depth, time=time)[2:]
    np.testing.assert_allclose(found / (K * 0.002), response(time[2:]), atol=1e-3)


def test_creep_recovers_while_nothing_touches():
    """Pressed again long after, the force is as at first; pressed soon, it is less."""
    first = (TIME > 1) & (TIME < 6)
    again = (TIME > 8) & (TIME < 9)
    late = TIME > 18
    found = force(effect("creep", amount=0.4, time=1.0), 0.002 * (first | again | late))
    starts = [found[np.flatnonzero(phase)[0]] for phase in (first, again, late)]
    assert starts[1] < 0.97 * starts[0]
    assert starts[2] == pytest.approx(starts[0], rel=1e-3)


# --- hysteresis: SciPy on the differential equations, and loops


def integrate(rate_of_z, signal, z0=0.0):
    """z over TIME for ``ż = rate_of_z(z, x, ẋ)`` where x is linear between samples."""
    z, found = z0, [z0]
    for before, after, dt in zip(signal[:-1], signal[1:], np.diff(TIME)):
        speed = (after - before) / dt
        done = solve_ivp(
            lambda t, y, b=before, v=speed: [rate_of_z(y[0], b + v * t, v)],
            (0, dt),
            [z],
            rtol=1e-9,
            atol=1e-12,
            max_step=dt / 3,
        )
        z = done.y[0, -1]
        found.append(z)
    return np.array(found)


def cycle(depth=0.002):
    """In, a part of the way back, in again, out: always in touch until the end."""
    return depth * np.interp(TIME, [0, 4, 7, 12, 20], [0.0, 0.9, 0.4, 1.0, 1e-6])


def test_duhem_hysteresis():
    depth = cycle()
    z = integrate(lambda z, d, v: (np.sign(v) - z) * abs(v) / 3e-4, depth)
    found = force(effect("hysteresis", "duhem", width=0.2, depth=3e-4), depth)
    np.testing.assert_allclose(found, K * depth * (1 + 0.2 * z), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("beta", [0.5, 0.8, 1.0])
def test_bouc_wen_hysteresis(beta):
    depth = cycle()
    elastic, limit = K * depth, 0.3
    z = integrate(lambda z, f, v: v - (beta * abs(v) * z + (1 - beta) * v * abs(z)) / limit, elastic)
    found = force(effect("hysteresis", "bouc-wen", share=0.5, force=limit, beta=beta), depth)
    np.testing.assert_allclose(found, np.maximum(0.5 * elastic + 0.5 * z, 0.0), rtol=1e-6, atol=1e-6)


def test_maxwell_slip_hysteresis_dissipates_what_slips():
    """In a closed loop each element takes four times its threshold times the way that it slips."""
    share, limit, top, low = 0.5, 0.1, 2.0, 1.0
    path = np.concatenate([np.linspace(0, top, 501), np.linspace(top, low, 500), np.linspace(low, top, 1000)])
    elastic = path[: len(TIME)]
    found = force(effect("hysteresis", "maxwell-slip", share=share, force=limit), elastic / K)
    loop = slice(500, len(TIME))
    lost = -np.sum(0.5 * (found[loop][1:] + found[loop][:-1]) * np.diff(elastic[loop])) / K
    thresholds = limit * np.array([0.4, 0.8, 1.2, 1.6])
    expected = share * np.mean(2 * thresholds * (top - low - 2 * thresholds)) / K
    assert abs(lost) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("form", ["duhem", "bouc-wen", "maxwell-slip"])
def test_hysteresis_takes_energy_and_forgets_on_release(form):
    depth = np.concatenate([cycle()[:-1], [0.0]])
    found = force(effect("hysteresis", form), depth)
    assert np.sum(0.5 * (found[1:] + found[:-1]) * np.diff(depth)) > 1e-4 * K * 0.002**2
    twice = normal_forces((effect("hysteresis", form),), SPRING, np.arange(2.0 * len(TIME)), np.tile(depth, 2)[:, None])[:, 0]
    np.testing.assert_allclose(twice[: len(TIME)], twice[len(TIME) :], atol=1e-12)


# --- softening and wear


def test_ogden_roxburgh_softening():
    depth = wave()
    work = 0.5 * K * depth**2
    most = np.maximum.accumulate(work)
    eta = 1 - 0.3 * erf((1 - work / np.maximum(most, 1e-300)) / 0.6)
    found = force(effect("softening", "ogden-roxburgh", share=0.3, width=0.6), depth)
    np.testing.assert_allclose(found, K * depth * eta, rtol=1e-12, atol=1e-15)


def test_softening_by_the_largest_depth_and_by_the_way_so_far():
    depth = wave()
    most = np.maximum.accumulate(depth)
    found = force(effect("softening", "peak", share=0.4, depth=0.001), depth)
    np.testing.assert_allclose(found, K * depth * (1 - 0.4 * (1 - np.exp(-most / 0.001))), rtol=1e-12)
    way = np.cumsum(np.maximum(np.diff(depth, prepend=0.0), 0.0))
    found = force(effect("softening", "path", share=0.4, path=0.01), depth)
    np.testing.assert_allclose(found, K * depth * (1 - 0.4 * (1 - np.exp(-way / 0.01))), rtol=1e-12)


def test_wear_by_load():
    """After m pressings of peak P the sum of loads is m P."""
    m, peak = 10, 2.0
    depth = peak / K * np.abs((TIME * m / 20.0 + 0.5) % 1 * 2 - 1)
    depth = peak / K * (1 - np.abs((TIME * m / 20.0) % 1 * 2 - 1))
    last = np.flatnonzero(np.isclose(depth, peak / K))[-1]
    found = force(effect("wear", "exponential", life=50.0), depth)
    step = peak * 2 * m / len(TIME)  # a sample's load wears from the next sample on
    assert found[last] == pytest.approx(peak * np.exp(-m * peak / 50.0), rel=1.5 * step / 50.0)
    found = force(effect("wear", "linear", life=50.0), depth)
    assert found[last] == pytest.approx(peak * (1 - m * peak / 50.0), rel=1.5 * step / 30.0)


def test_wear_by_dose():
    """Under a constant depth the elastic force that wears is constant, whatever is left of it: ``k d exp(-k d t / L)``."""
    found = force(effect("wear", "dose", life=50.0), np.full(len(TIME), 0.002))
    step = TIME[1] - TIME[0]  # a sample's load wears from the next sample on
    np.testing.assert_allclose(found[1:], K * 0.002 * np.exp(-K * 0.002 * (TIME[1:] - step) / 50.0), rtol=1e-9)


def test_wear_by_rubbing():
    """At constant depth and speed what is gone grows evenly: it is the elastic force that rubs, ``δ = κ k d s``."""
    way = 1e-3
    found = force(effect("wear", "archard", rate=1e-4), np.full(len(TIME), 0.002), np.full(len(TIME), way))
    gone = 1e-4 * K * 0.002 * way * np.arange(len(TIME))
    np.testing.assert_allclose(found, K * np.maximum(0.002 - gone, 0.0), rtol=1e-9)


def test_wear_by_work():
    """Held, each step of rubbing takes the same share; pressed without rubbing, the load's work on the spring, ``k d²/2``."""
    way, life = 1e-3, 0.05
    found = force(effect("wear", "work", life=life), np.full(len(TIME), 0.002), np.full(len(TIME), way))
    # The first step goes in as well: what it wears off acts from the next one on, like all that comes later.
    first = K * 0.002 * np.hypot(way, 0.002)
    expected = np.exp(-(first + K * 0.002 * way * np.arange(len(TIME) - 1)) / life)
    np.testing.assert_allclose(found[1:], K * 0.002 * expected, rtol=1e-9)
    depth = np.linspace(0.0, 0.003, 20001)
    depth = np.append(depth, depth[-1])
    done = force(effect("wear", "work", life=life), depth, time=np.arange(len(depth)) * 1e-3)[-1]
    assert done == pytest.approx(K * 0.003 * np.exp(-K * 0.003**2 / 2 / life), rel=1e-4)


# --- adhesion


def test_adhesion():
    depth = cycle()
    found = force(effect("adhesion", "constant", pull=0.1, depth=1e-4), depth)
    np.testing.assert_allclose(found, K * depth - 0.1 * (1 - np.exp(-depth / 1e-4)), rtol=1e-9, atol=1e-12)
    u = integrate(lambda u, d, v: (float(v < 0) - u) * abs(v) / 2e-4, depth)
    found = force(effect("adhesion", "unloading", pull=0.1, depth=2e-4), depth)
    np.testing.assert_allclose(found, (K * depth - 0.1 * u) * (depth > 0), rtol=1e-6, atol=1e-7)
    assert found.min() < -0.09
    c = 1 - np.exp(-TIME / 3.0)
    found = force(effect("adhesion", "dwell", pull=0.1, depth=2e-4, time=3.0), depth)
    shifted = 1 - np.exp(-(TIME - TIME[1] + TIME[1]) / 3.0)
    np.testing.assert_allclose(found, (K * depth - 0.1 * u * np.minimum(c, shifted)) * (depth > 0), rtol=1e-2, atol=2e-4)


def test_a_cohesive_zone_takes_the_work_of_adhesion():
    """Pulled out from far above the zone: the traction of Xu and Needleman, whose work is e F D, and no jump at the end."""
    pull, zone = 0.1, 1e-4
    depth = np.concatenate([np.linspace(0.0, 30 * zone, 501), np.linspace(30 * zone, 0.0, 1500)])
    lost = K * depth - force(effect("adhesion", "cohesive", pull=pull, depth=zone), depth)
    assert np.abs(lost[:501]).max() == 0.0  # on the way in there is nothing to part
    x, turned = depth[501:] / zone, 1 - np.exp(-(30 - depth[501:] / zone))
    np.testing.assert_allclose(lost[501:], pull * turned * x * np.exp(1 - x), rtol=1e-9, atol=1e-13)
    work = 0.5 * np.sum((lost[501:] + lost[500:-1]) * -np.diff(depth[500:]))
    assert work == pytest.approx(np.e * pull * zone, rel=1e-3)  # trapezia of 0.02 D
    assert abs(lost[-2]) < 0.06 * pull


def test_a_pull_that_relaxes():
    """Drawn out evenly it comes to v/(v + D/τ) of the cohesive zone's traction; at rest it fades within τ."""
    pull, zone, time, step = 0.1, 1e-4, 0.05, 1e-3
    depth = np.concatenate([np.linspace(0.0, 3e-3, 101), np.linspace(3e-3, 3e-4, 2001)[1:], np.full(200, 3e-4)])
    item = effect("adhesion", "relaxing", pull=pull, depth=zone, time=time)
    lost = K * depth - force(item, depth, time=step * np.arange(len(depth)))
    x, parting = depth / zone, 2.7e-3 / 2000 / step
    share = parting / (parting + zone / time)
    np.testing.assert_allclose(lost[1500:2101], (pull * share * x * np.exp(1 - x))[1500:2101], rtol=1e-6, atol=1e-12)
    assert np.abs(lost[:101]).max() == 0.0
    np.testing.assert_allclose(lost[2101:], lost[2100] * np.exp(-step * np.arange(1, 201) / time), rtol=1e-9)


def test_adhesion_ends_with_the_contact():
    depth = np.where(TIME < 10, cycle(), 0.0)
    assert (force(effect("adhesion"), depth)[TIME >= 10] == 0.0).all()


# --- friction and place


def test_friction_laws():
    speed, load = np.array([0.0, 0.005, 0.01, 0.1]), np.array([0.5, 1.0, 2.0, 3.0])
    x = speed / 0.01
    for form, more, shape in (
        ("gaussian", {}, np.exp(-(x**2))),
        ("exponential", {}, np.exp(-x)),
        ("rational", {}, 1 / (1 + x**2)),
        ("stretched", {"exponent": 0.7}, np.exp(-(x**0.7))),
    ):
        factor, viscous = friction_factors((effect("stribeck", form, rise=0.7, speed=0.01, **more),), speed, load)
        np.testing.assert_allclose(factor, 1 + 0.7 * shape, rtol=1e-12)
        assert not viscous.any()
    for form, values, expected in (
        ("linear", {"viscosity": 0.3}, 0.3 * speed),
        ("load", {"viscosity": 0.3}, 0.3 * load * speed),
        ("power", {"drag": 0.3, "exponent": 0.5}, 0.3 * speed**0.5),
    ):
        factor, viscous = friction_factors((effect("viscous-friction", form, **values),), speed, load)
        np.testing.assert_allclose(viscous * speed, expected, rtol=1e-12)
        assert (factor == 1.0).all()
    both = (effect("stribeck", rise=1.0), effect("stribeck", rise=0.5), effect("viscous-friction"))
    assert friction_factors(both, np.zeros(1), np.ones(1)) == (3.0, 0.05)


def test_misalignment_is_a_rigid_motion():
    random = np.random.default_rng(0)
    position = random.normal(size=(20, 3))
    normal = np.tile([0.0, 0.0, 1.0], (20, 1))
    tangent = np.tile([1.0, 0.0, 0.0], (20, 1))
    found, up, across = actual_placement((effect("misalignment", "shift", x=0.01, y=-0.02),), position, normal, tangent)
    np.testing.assert_allclose(found - position, np.tile([0.01, -0.02, 0.0], (20, 1)), atol=1e-15)
    found, up, across = actual_placement(
        (effect("misalignment", "turn", x=0.0, y=0.0, about_z=0.3),), position, normal, tangent
    )
    middle = position.mean(axis=0)
    turn = np.array([[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]])
    np.testing.assert_allclose(found, middle + (position - middle) @ turn.T, atol=1e-14)
    np.testing.assert_allclose(across, tangent @ turn.T, atol=1e-15)
    found, up, across = actual_placement(
        (effect("misalignment", "tilt", about_x=0.2, about_y=0.1, z=0.001),), position, normal, tangent
    )
    np.testing.assert_allclose(
        np.linalg.norm(found[:, None] - found, axis=2), np.linalg.norm(position[:, None] - position, axis=2)
    )
    np.testing.assert_allclose(up[0] @ [0, 0, 1], np.cos(0.2) * np.cos(0.1), rtol=1e-12)
