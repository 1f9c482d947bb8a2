# SPDX-License-Identifier: GPL-3.0-or-later
"""Read-outs: each method against its closed form, and what is said of simulated skins with several signed channels."""

from dataclasses import replace

import numpy as np
import pytest

import palpate as pp
from palpate.benchmarks._recordings import Recording
from palpate.commands import main
from palpate.core.gap.calibration.readout import _forward_check, _reasons, _usable_times, readout_data
from palpate.core.gap.calibration.readout_methods import forward_curves, forward_inverse, gaussian_process, memory_of, ridge
from palpate.core.gap.dataset.rig import read_rig

GAIN = np.array([1.0, -0.4, 0.7, -1.2])
SAMPLES = 120
CURVE = np.array([0.2, 0.5, -0.3, 0.1])
SENSOR = 'grid = { rows = 1, columns = 4, pitch = 0.01 }\nunit = "uT"'


def press(seed, scale=10.0, late=0.0, offset=0.0, noise=0.004, share=1.0):
    """Times, forces (N) and four signed channels of 40 s; with `late` (s) a share of them trails as behind a low pass."""
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.15, 0.25, SAMPLES))
    force = scale * np.maximum(0.0, np.sin(2 * np.pi * time / random.uniform(6.0, 9.0) + random.uniform(0.0, 6.0))) ** 2
    seen = force[:, None] / 10.0
    seen = seen + (share * memory_of(time, seen, (late,)) if late else 0.0)
    readings = 100.0 * (seen * GAIN + seen**2 * CURVE + noise * random.normal(size=(len(time), 4))) + offset
    return time, force, readings


def write_rig(folder, recordings, uses):
    trials = [
        (f"press_{i}", use, {"time": time, "force": force} | {f"texel_{j}": one for j, one in enumerate(readings.T)})
        for i, ((time, force, readings), use) in enumerate(zip(recordings, uses, strict=True))
    ]
    return Recording("rig", SENSOR, trials).write(folder)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("readout")
    return pp.fit_readout(write_rig(folder, [press(i) for i in range(4)], ["fit", "fit", "fit", "check"]))


# --- methods


def test_memory_is_a_low_pass_whatever_the_steps():
    """A step behind a low pass is 1 − exp(−t/τ); what is returned is this less the step."""
    time = np.concatenate([[0.0], np.cumsum(np.random.default_rng(0).uniform(0.01, 0.5, 40))])
    step = np.concatenate([[0.0], np.ones(40)])[:, None]
    found = memory_of(time, step, (1.5, 0.2))
    np.testing.assert_allclose(found[1:, 0], -np.exp(-time[1:] / 1.5), atol=1e-14)
    np.testing.assert_allclose(found[1:, 1], -np.exp(-time[1:] / 0.2), atol=1e-14)
    step[20] = np.nan
    found = memory_of(time, step, (1.5,))
    assert np.isnan(found[20, 0]) and np.isfinite(np.delete(found[:, 0], 20)).all()


def test_the_ridge_is_least_squares_of_second_degree():
    random = np.random.default_rng(1)
    readings, memory = random.normal(size=(200, 3)), random.normal(size=(200, 3))
    targets = np.stack(
        [1.0 + readings[:, 0] - 2.0 * readings[:, 1] * readings[:, 2] + 0.3 * memory[:, 1], readings[:, 2] ** 2], 1
    )
    value, deviation = ridge(readings, memory, targets, 1e-14)(readings, memory)
    np.testing.assert_allclose(value, targets, atol=1e-9)
    assert deviation.max() < 1e-9
    shrunk, _ = ridge(readings, memory, targets, 1e12)(readings, memory)
    np.testing.assert_allclose(shrunk, np.broadcast_to(targets.mean(axis=0), shrunk.shape), atol=1e-9)


def test_the_gaussian_process_is_its_formula():
    """Mean and variance by an inverse written out (Rasmussen and Williams, Eq. 2.25 and 2.26), and sure only near samples."""
    x = np.linspace(-2.0, 2.0, 25)[:, None]
    y = np.sin(2.0 * x)
    none, at = np.zeros((25, 0)), np.array([[0.3], [1.234], [40.0]])
    value, deviation = gaussian_process(x, none, y, 0.5, 1e-3)(at, np.zeros((3, 0)))
    size = np.sqrt(np.mean(x**2))
    one, other = np.arcsinh(2.0 * at / size), np.arcsinh(2.0 * x / size)
    covariance = np.exp(-0.5 * (other - other.T) ** 2 / 0.25) + 1e-3 * np.eye(25)
    cross = np.exp(-0.5 * (one - other.T) ** 2 / 0.25)
    standard = (y - y.mean()) / y.std()
    weights = np.linalg.solve(covariance, standard)
    np.testing.assert_allclose(value, y.mean() + y.std() * cross @ weights, atol=1e-9)
    left = 1.001 - np.sum(cross @ np.linalg.inv(covariance) * cross, axis=1)
    amplitude = np.sqrt(np.mean(standard * weights)) * y.std()
    np.testing.assert_allclose(deviation[:, 0], amplitude * np.sqrt(left), rtol=1e-6)
    assert abs(value[0, 0] - np.sin(0.6)) < 0.02 and deviation[2, 0] > 10.0 * deviation[0, 0]


def test_the_direction_of_readings_forgets_their_size():
    random = np.random.default_rng(2)
    angle, size = random.uniform(0.0, np.pi, 150), random.uniform(0.5, 5.0, 150)
    readings = size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    none = np.zeros((150, 0))
    predict = gaussian_process(readings[:100], none[:100], angle[:100, None], 2.0, 1e-4, by_direction=True)
    value, _ = predict(readings[100:], none[100:])
    assert np.sqrt(np.mean((value[:, 0] - angle[100:]) ** 2)) < 0.03


def test_the_inverse_of_a_linear_model_is_generalised_least_squares():
    """Value (gᵀ Σ⁻¹ r) / (gᵀ Σ⁻¹ g) and deviation 1 / √(gᵀ Σ⁻¹ g), with errors that channels share."""
    random = np.random.default_rng(3)
    force = random.uniform(0.0, 10.0, 4000)
    mixing = np.array([[0.1, 0.05, 0.0, 0.0], [0.0, 0.2, 0.1, 0.0], [0.0, 0.0, 0.05, 0.0], [0.1, 0.1, 0.1, 0.3]])
    readings = force[:, None] * GAIN + random.normal(size=(4000, 4)) @ mixing
    value, deviation = forward_inverse(readings, np.zeros((4000, 0)), force[:, None])(readings, np.zeros((4000, 0)))
    inverse = np.linalg.inv(mixing.T @ mixing + 1e-4 * np.diag(readings.var(axis=0)))
    best = readings @ inverse @ GAIN / (GAIN @ inverse @ GAIN)
    inner = (force > 0.5) & (force < 9.5)  # at the ends a polynomial is free
    assert np.abs(value[inner, 0] - best[inner]).max() < 0.03
    assert np.median(deviation[inner]) == pytest.approx(1.0 / np.sqrt(GAIN @ inverse @ GAIN), rel=0.05)


def test_a_curve_has_a_share_of_what_the_channel_remembers():
    """A polynomial of the force and a part of its low pass are found exactly, and hold for another course of the force."""
    (time, force, _), (other_time, other, _) = press(4), press(5, scale=8.0)

    def channels(time, force):
        past = memory_of(time, force[:, None], (1.0, 10.0))
        straight, bent = (0.5 + 0.02 * force) * (force + past[:, 0]), 2.0 - force + 0.1 * force**3 - 0.2 * past[:, 1]
        return past, np.stack([straight, bent], axis=1)

    past, readings = channels(time, force)
    other_past, expected = channels(other_time, other)
    np.testing.assert_allclose(forward_curves(readings, force, past)(other, other_past), expected, atol=1e-9)


# --- rigs


@pytest.mark.parametrize("late", [0.0, 10.0])
def test_the_forward_model_creeps_where_the_skin_does(tmp_path, late):
    """Of channels of which a tenth trails, its error is that of the noise (0.2 % of the range), as of those that do not."""
    recordings = [press(i, late=late, share=0.1) for i in range(4)]
    data = readout_data(read_rig(write_rig(tmp_path, recordings, ["fit", "fit", "fit", "check"])))
    noise = 0.4 / np.ptp(recordings[3][2])
    assert 0.8 * noise < _forward_check(data, _usable_times(data)) < 1.3 * noise


@pytest.mark.slow("a read-out tries all candidates, each on parts that are left out")
def test_a_read_out_reaches_the_noise_and_its_intervals_hold(fitted):
    """Noise of 0.4 % in four channels, of which each tells a force of 10 N: no read-out can do better than 0.02 N."""
    assert fitted.data.targets == ("force",) and [one.name for one in fitted.data.check] == ["press_3"]
    assert fitted.best.check[0] < 0.05 and 0.9 <= fitted.best.coverage[0] <= 1.0
    assert {one.name for one in fitted.results} == {
        "forward model, inverted",
        "ridge, second degree",
        "Gaussian process",
    }
    assert fitted.forward_check < 0.01 and len(fitted.reasons) <= 1  # two samples of the check exceed 9.999 N
    assert fitted.best.score <= min(one.score + one.score_error for one in fitted.results)


def test_an_estimate_has_gaps_where_readings_have(fitted):
    time, force, readings = press(17)
    readings[5:9, 2] = np.nan
    found = fitted.estimate(time, readings)
    assert np.isnan(found.value[5:9]).all() and np.isfinite(np.delete(found.value, range(5, 9), axis=0)).all()
    known = np.isfinite(found.value[:, 0])
    assert np.sqrt(np.mean((found.value[known, 0] - force[known]) ** 2)) < 0.06
    assert (found.low[known] <= found.value[known]).all() and (found.value[known] <= found.high[known]).all()
    assert found.low[known].min() >= 0.0  # a force of contact is never negative
    with pytest.raises(pp.PalpateError, match=r"readings of the shape \(120, 3\) do not fit: give \(T, 4\)"):
        fitted.estimate(time, readings[:, :3])


@pytest.mark.long("a read-out tries all candidates, each on parts that are left out")
def test_a_sensor_that_trails_is_remembered(tmp_path):
    recordings = [press(i, late=0.3) for i in range(4)]
    fit = pp.fit_readout(write_rig(tmp_path, recordings, ["fit", "fit", "fit", "check"]))
    assert fit.best.times and fit.best.check[0] < 0.25
    (inverse,) = [one for one in fit.results if one.name == "forward model, inverted"]
    assert inverse.check[0] > 4.0 * fit.best.check[0]  # nothing is remembered there


def test_where_it_fails_is_said(fitted):
    (check,) = fitted.data.check

    def reasons(targets):
        changed = replace(fitted.data, check=(replace(check, targets=targets),))
        return " ".join(_reasons(changed, fitted.best.estimate))

    assert "beyond what was fitted (" in reasons(1.4 * check.targets)
    assert "off on average, more than half of its error" in reasons(check.targets + 1.0)


def test_rigs_without_what_it_needs(tmp_path):
    time, force, readings = press(0)
    rig = pp.read_rig(write_rig(tmp_path, [(time, force, np.column_stack([readings[:, :3], 0 * time + 7.0]))], ["fit"]))
    data = readout_data(rig)
    assert list(data.channels) == [0, 1, 2] and "1 channel never change and are not used: texel_3" in data.notes[0]
    with pytest.raises(pp.PalpateError, match="share no force, depth or place that changes"):
        pp.fit_readout(write_rig(tmp_path, [(time, 0 * force + 1.0, readings)], ["fit"]))
    with pytest.raises(pp.PalpateError, match="have 40 samples with all readings and force: a read-out needs 60"):
        pp.fit_readout(write_rig(tmp_path, [(time[:40], force[:40], readings[:40])], ["fit"]))
    with pytest.raises(pp.PalpateError, match="No channel of 'rig' changes"):
        pp.fit_readout(write_rig(tmp_path, [(time, force, 0 * readings + 3.0)], ["fit"]))


@pytest.mark.long("a read-out tries all candidates, each on parts that are left out")
def test_the_command_prints_a_table_and_draws(tmp_path, capsys):
    rig = write_rig(tmp_path, [press(i) for i in range(3)], ["fit", "fit", "check"])
    assert main(["fit", "readout", str(rig), "--plot", str(tmp_path / "readout.png")]) == 0
    said = capsys.readouterr().out
    assert "force from 4 channels, fitted to 2 recordings and checked on 1" in said
    assert said.count("* ") >= 2 and "ridge, second degree" in said and "of the readings' range on the check" in said
    assert (tmp_path / "readout.png").stat().st_size > 10_000
