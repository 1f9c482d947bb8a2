# SPDX-License-Identifier: GPL-3.0-or-later
"""Stiffness and friction from measurements: known truths come back, intervals cover them, bad tables get a sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import contact_laws
from scipy.integrate import solve_ivp

from palpate.core.errors import FileError, ParameterError
from palpate.core.gap.calibration.friction import FrictionData, fit_friction, friction_over_time, read_friction, steady_friction
from palpate.core.gap.calibration.stiffness import FoamData, fit_stiffness, read_foam, texel_stiffness
from palpate.core.model.sensor_parameters import SensorParameters

PAPER = SensorParameters(sigma0=1.0, sigma1=0.1, x0=0.3, ct=0.01, mus=0.435, mud=0.23)
LOAD = 0.08


def test_equation_18_with_the_papers_inputs():
    """The print says 58.5; its own inputs give 58.39 (9810 · 0.00125 / (84 · 0.0025), by hand)."""
    assert texel_stiffness(9810.0, 0.00125, 84, 0.0025) == pytest.approx(58.392857142857, rel=1e-12)


def test_a_straight_foam_is_found_exactly():
    x = np.linspace(0.5e-3, 4e-3, 8)
    fit = fit_stiffness(FoamData(x, 3.9e6 * x), 0.00125, 84)
    assert fit.k.value == pytest.approx(3.9e6 * 0.00125 / 84, rel=1e-12)
    assert fit.dead_zone == pytest.approx(0.0, abs=1e-15)


def test_an_offset_is_found_and_called_real():
    x = np.linspace(0.5e-3, 4e-3, 12)
    rng = np.random.default_rng(5)
    fit = fit_stiffness(FoamData(x, 4e6 * (x - 0.3e-3) + rng.normal(0, 40, 12)), 0.00125, 84)
    assert fit.offset.high < 0.0 or fit.offset.low > 0.0
    assert fit.dead_zone == pytest.approx(0.3e-3, rel=0.15)
    assert fit.k_offset.low < 4e6 * 0.00125 / 84 < fit.k_offset.high
    assert fit.k.value < fit.k_offset.value  # the line through zero has to carry less
    assert not fit.stiffens


def test_foam_intervals_cover_the_truth_as_often_as_they_say():
    """1,000 noisy foams: 95 % of the intervals hold the truth, give or take three standard deviations of that count."""
    rng = np.random.default_rng(1)
    x, truth = np.linspace(1e-3, 4e-3, 6), 5e6
    held = 0
    for _ in range(1000):
        k = fit_stiffness(FoamData(x, truth * x + rng.normal(0, 300, 6)), 1.0, 1).k
        held += k.low <= truth <= k.high
    assert 930 <= held <= 970


X = np.array([1e-3, 2e-3, 3e-3])


@pytest.mark.parametrize(
    ("x", "pressure", "area", "texels", "words"),
    [
        (X, [30.0, 20.0, 10.0], 1.0, 1, "does not rise"),
        ([1e-3, 1e-3], [30.0, 20.0], 1.0, 1, "two different"),
        (X, 1e6 * X, 0.0, 84, "The sensor's area is .*finite value above zero"),
        (X, 1e6 * X, np.nan, 84, "The sensor's area is .*finite value above zero"),
        (X, 1e6 * X, 1.0, 0, "number of texels is 0"),
    ],
)
def test_foams_and_sensors_that_mean_nothing_are_refused(x, pressure, area, texels, words):
    with pytest.raises(ParameterError, match=words):
        fit_stiffness(FoamData(np.array(x), np.array(pressure)), area, texels)


def test_steady_sliding_is_what_the_bristles_settle_to():
    """Against scipy's stiff solver on Eq. 9: after 40 m of sliding at constant velocity Eq. 13 is the steady curve (1e-9)."""
    for v in (0.02, 0.1, 0.3, -0.6):
        z = solve_ivp(
            lambda _, z, v=v: contact_laws.bristle_rate(PAPER, LOAD, z, v),
            (0, 40 / abs(v)), [0.0], method="Radau", rtol=1e-10, atol=1e-13,
        ).y[0, -1]  # fmt: skip
        settled = contact_laws.friction_force(PAPER, LOAD, z, v)
        assert steady_friction(np.array([v]), LOAD, PAPER)[0] == pytest.approx(settled, abs=1e-9)


def test_friction_over_time_agrees_with_an_ode_solver():
    """A velocity that rises and falls; 2,000 samples, so that the mean of two samples is the velocity to 1e-7 N."""
    time = np.linspace(0, 4, 2001)

    def velocity(t):
        return 0.25 * np.sin(1.7 * t) + 0.05 * t

    def rate(t, z):
        return contact_laws.bristle_rate(PAPER, LOAD, z, velocity(t))

    z = solve_ivp(rate, (0, 4), [0.0], method="Radau", rtol=1e-10, atol=1e-13, t_eval=time).y[0]
    expected = contact_laws.friction_force(PAPER, LOAD, z, velocity(time))
    assert friction_over_time(time, velocity(time), LOAD, PAPER) == pytest.approx(expected, abs=1e-6)


def test_the_papers_curve_gives_its_parameters_back():
    v = np.linspace(0.01, 1.5, 40)
    fit = fit_friction(FrictionData(v, steady_friction(v, LOAD, PAPER)), LOAD)
    for name in ("mus", "mud", "x0", "ct"):
        assert getattr(fit.parameters, name) == pytest.approx(getattr(PAPER, name), rel=1e-6), name


@pytest.mark.parametrize(("true", "sigma0"), [(1.0, 3.0), (1.0, 3000.0), (40.0, 1.0)])
def test_a_recording_from_rest_gives_the_bristles_too(true, sigma0):
    """Whatever stiffness the search begins with: from one start it may end in a local minimum."""
    sensor = replace(PAPER, sigma0=true)
    time = np.linspace(0, 6, 600)
    velocity = 0.3 * np.abs(np.sin(time)) * time / 3
    fit = fit_friction(
        FrictionData(velocity, friction_over_time(time, velocity, LOAD, sensor), time),
        LOAD,
        SensorParameters(sigma0=sigma0, sigma1=0.02),
    )
    for name in ("mus", "mud", "x0", "ct", "sigma0", "sigma1"):
        assert getattr(fit.parameters, name) == pytest.approx(getattr(sensor, name), rel=1e-4), name


def test_friction_intervals_cover_the_truth():
    """200 noisy curves, 95 % intervals of the four values: at least 90 % hold the truth (linearised, so not exactly 95 %)."""
    rng = np.random.default_rng(3)
    v = np.linspace(0.01, 1.2, 60)
    clean = steady_friction(v, LOAD, PAPER)
    held = dict.fromkeys(("mus", "mud", "x0", "ct"), 0)
    for _ in range(200):
        fit = fit_friction(FrictionData(v, clean + rng.normal(0, 2e-4, len(v))), LOAD)
        for name in held:
            held[name] += fit.estimates[name].low <= getattr(PAPER, name) <= fit.estimates[name].high
    assert min(held.values()) >= 180 and max(held.values()) <= 200, held


def test_what_a_curve_cannot_tell_is_said():
    """All samples far above the Stribeck velocity: nothing there depends on mus or x0."""
    v = np.linspace(3.0, 5.0, 30)
    noise = np.random.default_rng(0).normal(0, 1e-4, 30)
    fit = fit_friction(FrictionData(v, steady_friction(v, LOAD, PAPER) + noise), LOAD)
    assert {"mus", "x0"} & set(fit.unidentifiable)


def test_columns_in_other_units(tmp_path):
    path = tmp_path / "foam.csv"
    path.write_text("# made by hand\ncompression (mm);mass_g;note\n1.0;120;a\n2.0;240;b\n", encoding="utf-8")
    data = read_foam(path, weight_area=804.25e-6)
    assert data.compression == pytest.approx([1e-3, 2e-3])
    assert data.pressure == pytest.approx([0.12 * 9.80665 / 804.25e-6, 0.24 * 9.80665 / 804.25e-6])


@pytest.mark.parametrize(
    ("read", "content", "words"),
    [
        (read_foam, "compression,pressure\n1,x\n", "Line 2 of"),
        (read_foam, "compression,depth\n1,2\n", "exactly one of the columns"),
        (read_foam, "pressure,force\n1,2\n", "no column 'compression'"),
        (read_foam, "compression,mass\n1,2\n", "on which area"),
        (read_foam, b"\x89PNG\r\n\xff\xfe\x00\x80", "not a text file"),
        (read_foam, None, "no file"),
        (read_friction, "velocity\n1\n", "no column 'force'"),
        (read_friction, "velocity,force\n1,2\n", "needs 5 or more"),
        (read_friction, "time,velocity,force\n" + "0,1,1\n" * 6, "does not increase at measurement 2"),
    ],
)
def test_bad_tables_get_a_sentence(tmp_path, read, content, words):
    path = tmp_path / "table.csv"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(FileError, match=words):
        read(path)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_foam_that_stiffens_has_no_dead_zone(tmp_path, sign):
    """F = 20 x / (1 − (x/10)²) N, x in mm: it begins at zero, and bends upwards; testing machines write both below zero."""
    x = np.linspace(0.0, 3.0, 61)
    force = 20.0 * x / (1.0 - (x / 10.0) ** 2)
    path = tmp_path / "foam.csv"
    path.write_text("Extension (mm),Load (N)\n" + "".join(f"{sign * a:.4f},{sign * b:.4f}\n" for a, b in zip(x, force)))
    fit = fit_stiffness(read_foam(path, weight_area=1e-3), 1e-3, 100)
    assert fit.dead_zone == 0.0 and fit.stiffens and fit.is_turned == (sign < 0.0)
    assert fit.k.value == pytest.approx(float(x @ force / (x @ x)) * 10.0, rel=1e-3)
