# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects on readings against closed forms, SciPy and statistics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares
from scipy.signal import TransferFunction, lsim

from palpate.core.effects.engine.coupling_matrix import coupled
from palpate.core.effects.engine.readout_chain import ReadoutChain, readings
from palpate.core.effects.engine.registry import effect, form_of
from palpate.core.effects.engine.specification import TransducerArray
from palpate.core.effects.library import channel_curve
from palpate.core.effects.library.load_spreading import stretched_exponential
from palpate.core.errors import EffectError

ROWS, COLUMNS, PITCH = 14, 6, 0.0034
N = ROWS * COLUMNS
ROW, COLUMN = (grid.ravel() for grid in np.mgrid[0:ROWS, 0:COLUMNS])
POSITION = np.stack([COLUMN * PITCH, ROW * PITCH, np.zeros(N)], axis=1)
GRID = TransducerArray(POSITION, np.full(N, PITCH**2), ROW, COLUMN)
TIME = np.linspace(0.0, 10.0, 501)


def read(item, force, time=TIME, transducers=GRID):
    return readings((item,), transducers, time, np.asarray(force, float))


def image(texel, value=1.0):
    """One texel loaded, for one sample."""
    force = np.zeros((1, N))
    force[0, texel] = value
    return force


# --- formulas


@pytest.mark.parametrize(
    ("name", "form", "values", "formula"),
    [
        ("saturation", "clip", {"level": 0.8}, lambda f: np.clip(f, -0.8, 0.8)),
        ("saturation", "tanh", {"level": 0.8}, lambda f: 0.8 * np.tanh(f / 0.8)),
        ("saturation", "rational", {"level": 0.8}, lambda f: f / (1 + np.abs(f) / 0.8)),
        ("saturation", "power", {"level": 0.8, "sharpness": 3.0}, lambda f: f / np.cbrt(1 + np.abs(f / 0.8) ** 3)),
        ("dead-zone", "hard", {"threshold": 0.3}, lambda f: np.sign(f) * np.maximum(np.abs(f) - 0.3, 0)),
        ("dead-zone", "soft", {"threshold": 0.3}, lambda f: np.sign(f) * f**2 / (np.abs(f) + 0.3)),
        ("dead-zone", "knee", {"threshold": 0.3, "sharpness": 2.0}, lambda f: np.sign(f) * (np.hypot(f, 0.3) - 0.3)),
        ("dead-zone", "step", {"threshold": 0.3}, lambda f: np.where(np.abs(f) > 0.3, f, 0)),
        ("offset", "common", {"offset": -0.2}, lambda f: f - 0.2),
        ("quantization", "round", {"step": 0.25}, lambda f: 0.25 * np.round(f / 0.25)),
        ("quantization", "floor", {"step": 0.25}, lambda f: 0.25 * np.floor(f / 0.25)),
        (
            "quantization",
            "companding",
            {"scale": 0.5, "growth": np.log(2.0)},
            lambda f: np.sign(f) * np.choose(np.searchsorted([0.5, 1.5], np.abs(f), "right"), [0, 0.5, 1.5]),
        ),
        (
            "quantization",
            "power",
            {"first": 0.25, "exponent": 0.5},
            lambda f: np.sign(f) * 0.25 * np.searchsorted([0.25, 1.0], np.abs(f), "right") ** 2.0,
        ),
        (
            "quantization",
            "power",
            {"first": 0.25, "exponent": 1.0, "rounding": 0.5},
            lambda f: np.sign(f) * 0.25 * np.floor(np.abs(f) / 0.25 + 0.5),
        ),
        ("quantization", "bits", {"bits": 4, "range": 2.0}, lambda f: np.round(f * 8) / 8),
        (
            "warm-up",
            "exponential",
            {"amount": 0.3, "time": 4.0, "since": 2.0},
            lambda f: f * (1.3 - 0.3 * np.exp(-(TIME[:, None] + 2) / 4)),
        ),
        (
            "warm-up",
            "rational",
            {"amount": -0.3, "time": 4.0, "since": 2.0},
            lambda f: f * (1 - 0.3 * (TIME[:, None] + 2) / (TIME[:, None] + 6)),
        ),
        ("temperature", "gain", {"gain_change": 0.02, "temperature": 30.0}, lambda f: 1.1 * f),
        ("temperature", "zero", {"zero_change": 0.02, "temperature": 10.0, "reference": 15.0}, lambda f: f - 0.1),
        (
            "temperature",
            "gain-and-zero",
            {"gain_change": -0.01, "zero_change": 0.02, "temperature": 35.0},
            lambda f: 0.9 * f + 0.2,
        ),
        ("drift", "linear", {"rate": 0.03}, lambda f: f + 0.03 * TIME[:, None]),
        ("drift", "warm-up", {"amount": 0.3, "time": 4.0}, lambda f: f + 0.3 * (1 - np.exp(-TIME[:, None] / 4))),
        (
            "drift",
            "sensitivity",
            {"amount": -0.3, "time": 4.0},
            lambda f: f * (1 - 0.3 * (1 - np.exp(-TIME[:, None] / 4))),
        ),
    ],
)
def test_formulas(name, form, values, formula):
    force = np.linspace(-0.5, 2.0, len(TIME))[:, None] * np.ones(N)
    np.testing.assert_allclose(read(effect(name, form, **values), force), formula(force), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(("name", "form"), [("saturation", "tanh"), ("saturation", "power"), ("dead-zone", "knee")])
@pytest.mark.parametrize("zero", [0.0, 2.5])
def test_zero_load_gives_the_zero_reading_and_nan_stays_nan(name, form, zero):
    force = np.full((3, N), [[0.0], [5e-324], [np.nan]])
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        found = read(effect(name, form), force, TIME[:3], replace(GRID, zero=zero))
    np.testing.assert_allclose(found, np.full((3, N), [[zero], [zero], [np.nan]]), rtol=0.0, atol=1e-300)


def test_a_recorded_temperature_counts_and_not_that_of_the_effect():
    """The gain follows a straight line of temperatures between two samples, about the reading without load."""
    array = TransducerArray(POSITION, GRID.area, gain=2.0, zero=5.0, temperature=(TIME[[0, -1]], np.array([25.0, 35.0])))
    force = np.linspace(0.0, 3.0, len(TIME))[:, None] * np.ones(N)
    warmth = (10.0 * (TIME - TIME[0]) / (TIME[-1] - TIME[0]))[:, None]
    found = read(effect("temperature", "gain-and-zero", gain_change=0.01, zero_change=0.1, gain=2.0), force, transducers=array)
    np.testing.assert_allclose(found, 5.0 + (1.0 + 0.01 * warmth) * 2.0 * force + 0.1 * warmth, rtol=1e-12)
    found = read(effect("temperature", "gain", gain_change=0.01), force, transducers=array)
    np.testing.assert_allclose(found, 5.0 + 2.0 * (1.0 + 0.01 * warmth) * force, rtol=1e-12)


def test_saturation_counts_from_the_reading_without_load():
    array = TransducerArray(POSITION, GRID.area, gain=-2.0, zero=5.0)
    force = np.linspace(0.0, 3.0, len(TIME))[:, None] * np.ones(N)
    found = read(effect("saturation", "clip", level=4.0), force, transducers=array)
    np.testing.assert_allclose(found, np.maximum(5.0 - 2.0 * force, 1.0), rtol=1e-12)


# --- with memory


TURN = 2.0 * np.pi / 0.3
LAGS = [("first-order", {"time": 0.3}, [0.3, 1.0]), ("second-order", {"time": 0.3}, [0.09, 0.6, 1.0])]
LAGS += [
    ("resonance", {"period": 0.3, "damping": damping}, [TURN**-2, 2.0 * damping / TURN, 1.0])
    for damping in (0.001, 0.05, 0.5, 0.95)
]
LAGS += [
    ("second-order-plus-dead-time", {"time": 0.3 / quality, "quality": quality, "dead_share": 0.0}, [0.09, 0.3 / quality, 1.0])
    for quality in (5.0, 0.50000005, 0.5, 0.3, 0.05)
]


@pytest.mark.parametrize(("form", "values", "denominator"), LAGS)
def test_lag_is_the_linear_system_that_it_says(form, values, denominator):
    random = np.random.default_rng(0)
    signal = np.cumsum(random.normal(size=len(TIME)))
    signal -= signal[0]
    _, expected, _ = lsim(TransferFunction([1.0], denominator), signal, TIME)
    found = read(effect("lag", form, **values), signal[:, None])
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-9 * (np.abs(expected).max() if form == "resonance" else 1.0))


STEPS = (1e-7, 9e-5, 1.1e-4, 9e-3, 1.1e-2, 50.0)
SEAMS = [(form, {"time": 1.0}, step) for form in ("first-order", "second-order") for step in (*STEPS, 0.049, 0.051)]
SEAMS += [("resonance", {"period": 1.0, "damping": 0.3}, step) for step in (1e-9, 0.0158, 0.0161, 0.3, 50.0)]
SEAMS += [
    ("second-order-plus-dead-time", {"time": 20.0, "quality": 0.05, "dead_share": 0.0}, step)
    for step in (1e-7, 4.9e-3, 5.1e-3, 1e4)
]


@pytest.mark.parametrize(("form", "values", "step"), SEAMS)
def test_lag_has_no_seam_between_its_series_and_its_formula(form, values, step):
    """One step against a thousand small ones, over a ramp."""
    coarse, fine = np.array([0.0, step]), np.linspace(0.0, step, 1001)
    item = effect("lag", form, **values)
    one, many = (read(item, (time / step)[:, None], time)[-1, 0] for time in (coarse, fine))
    assert one == pytest.approx(many, rel=1e-6, abs=1e-18)


def test_lag_starts_at_rest():
    assert np.abs(read(effect("lag", "resonance", period=0.5, damping=0.1), np.full((501, 1), 3.0)) - 3.0).max() < 1e-12
    for form in ("first-order", "second-order", "dead-time"):
        np.testing.assert_allclose(read(effect("lag", form, time=0.5), np.full((501, 1), 3.0)), 3.0, rtol=1e-12)
    delayed = effect("lag", "second-order-plus-dead-time", time=0.5, quality=0.8, dead_share=0.3)
    np.testing.assert_allclose(read(delayed, np.full((501, 1), 3.0)), 3.0, rtol=1e-12)


def test_dead_time():
    signal = np.sin(TIME)[:, None]
    found = read(effect("lag", "dead-time", time=0.5), signal)[:, 0]
    np.testing.assert_allclose(found[TIME >= 0.5], np.sin(TIME[TIME >= 0.5] - 0.5), atol=6e-5)  # linear between samples
    assert (found[TIME < 0.5] == 0.0).all()


@pytest.mark.parametrize("quality", [0.2, 0.5, 1.5])
def test_second_order_plus_dead_time_is_both(quality):
    """SciPy's linear system of its own τ behind a dead time of six samples; a ramp comes late by the mean delay."""
    mean, share = 0.3, 0.4
    own = (1.0 - share) * mean * quality
    item = effect("lag", "second-order-plus-dead-time", time=mean, quality=quality, dead_share=share)
    signal = np.sin(3.0 * TIME)
    _, expected, _ = lsim(TransferFunction([1.0], [own**2, own / quality, 1.0]), signal, TIME)
    found = read(item, signal[:, None])[:, 0]
    np.testing.assert_allclose(found[6:], expected[:-6], atol=1e-9)
    assert (found[:6] == 0.0).all()
    late = TIME[-1] - read(item, TIME[:, None])[-1, 0]
    assert late == pytest.approx(mean, rel=1e-4)  # after thirty mean delays


def test_without_quality_it_is_a_first_order():
    signal = np.sin(3.0 * TIME)[:, None]
    expected = read(effect("lag", "first-order", time=0.3), signal)
    found = read(effect("lag", "second-order-plus-dead-time", time=0.3, quality=0.0, dead_share=0.0), signal)
    np.testing.assert_allclose(found, expected, atol=1e-7)  # its faster stage takes 3e-9 s


def test_second_order_plus_dead_time_follows_other_lags():
    """Moving means of a converter, and a filter behind a dead time: what is left is at most the form's own φ."""
    form = form_of("lag", "second-order-plus-dead-time")
    signal = np.interp(TIME, [0.5, 0.8, 1.5, 1.8, 2.5, 3.5, 4.0, 4.2], [0.0, 1.0, 1.0, 0.0, 0.0, 0.7, 0.7, 0.0])[:, None]
    delayed = read(effect("lag", "dead-time", time=0.1), signal)
    means = [signal]
    for _ in range(3):
        means.append(uniform_filter1d(means[-1], 15, axis=0, origin=7, mode="nearest"))
    for law in (means[1], means[3], read(effect("lag", "first-order", time=0.2), delayed)):
        assert np.square(law - signal).sum() > 0.02 * np.square(signal).sum()

        def left(numbers, law=law):
            item = effect("lag", form.name, time=numbers[0], quality=numbers[1], dead_share=numbers[2])
            return (read(item, signal) - law).ravel()

        fit = least_squares(left, [0.1, 0.5, 0.2], bounds=([0.0, 0.0, 0.0], [10.0, 5.0, 1.0]))
        assert np.square(fit.fun).sum() < form.error * np.square(law - signal).sum()


def test_a_reading_that_goes_on_rising():
    step = np.where(TIME > 0, 1.0, 0.0)[:, None]
    time = TIME.copy()
    time[1:] -= TIME[1] - 1e-9  # the load comes on within a nanosecond
    found = read(effect("creep", "rising-exponential", amount=0.3, time=2.0), step, time)[1:, 0]
    np.testing.assert_allclose(found, 1 + 0.3 * (1 - np.exp(-time[1:] / 2.0)), atol=1e-8)
    found = read(effect("creep", "rising-logarithmic", amount=0.1, time=0.5), step, time)[1:, 0]
    np.testing.assert_allclose(found, 1 + 0.1 * np.log10(1 + time[1:] / 0.5), atol=1e-3)


def test_play_keeps_its_distance():
    """On a long way up and down the mean element trails by the force that was given."""
    signal = np.concatenate([np.linspace(0, 2, 251), np.linspace(2, 0.5, 250)])[:, None]
    found = read(effect("hysteresis", "play", share=0.5, force=0.1), signal)[:, 0]
    assert found[250] == pytest.approx(2 - 0.5 * 0.1)
    assert found[-1] == pytest.approx(0.5 + 0.5 * 0.1)
    assert found[255] == pytest.approx(signal[255, 0] * 0.5 + 0.5 * (2 - 0.1))  # all stand still at first


def test_relays_close_their_loop_at_zero():
    """Relays, switched one by one, do what the four elements do; a loop to X encloses ``a · mean of w (X − w)``."""
    widths = -np.log1p(-(np.arange(4) + 0.5) / 4)
    widths *= 0.2 / widths.mean()
    signal = np.interp(np.arange(1201), [0, 300, 450, 700, 1000, 1200], [0.0, 1.7, 0.6, 2.0, 0.0, 1.0])
    found = read(effect("hysteresis", "preisach", share=0.6, force=0.2), signal[:, None], np.arange(1201.0))[:, 0]
    off = (np.arange(20000) + 0.5) * 1e-4  # from zero to the largest load, for each width
    mean = np.zeros(len(signal))
    for width in widths:
        state = np.zeros(len(off), bool)
        for i, load in enumerate(signal):
            state = (state & (load > off)) | (load > off + width)
            mean[i] += state.sum() * 1e-4 / 4
    np.testing.assert_allclose(found, 0.4 * signal + 0.6 * mean, atol=2e-4)  # two relays
    assert found[1000] == 0.0
    loop = np.concatenate([np.linspace(0, 2, 4001), np.linspace(2, 0, 4001)])
    found = read(effect("hysteresis", "preisach", share=0.6, force=0.2), loop[:, None], np.arange(8002.0))[:, 0]
    enclosed = -0.5 * np.sum((found[1:] + found[:-1]) * np.diff(loop))
    assert enclosed == pytest.approx(0.6 * np.mean(widths * (2.0 - widths)), rel=1e-6)


def test_trailing_reading():
    signal = np.concatenate([np.linspace(0, 2, 251), np.linspace(2, 0.5, 250)])[:, None]
    found = read(effect("hysteresis", "trailing", width=0.1, force=0.05), signal)[:, 0]
    up = 1 - np.exp(-signal[:251, 0] / 0.05)
    down = -1 + (up[-1] + 1) * np.exp(-(2 - signal[251:, 0]) / 0.05)
    np.testing.assert_allclose(found, signal[:, 0] * (1 - 0.1 * np.concatenate([up, down])), rtol=1e-9)


# --- mixes


@pytest.mark.parametrize(
    ("form", "weight"),
    [
        ("gaussian", lambda r: np.exp(-(r**2) / (2 * 0.003**2))),
        ("exponential", lambda r: np.exp(-r / 0.003)),
        ("half-space", lambda r: (1 + r**2 / 0.003**2) ** -2.5),
    ],
)
def test_a_spread_load_keeps_its_sum_and_has_the_right_shape(form, weight):
    texel = 7 * COLUMNS + 3
    found = read(effect("load-spreading", form, **{"thickness" if form == "half-space" else "width": 0.003}), image(texel))[0]
    assert found.sum() == pytest.approx(1.0, rel=1e-12)
    distance = np.linalg.norm(POSITION - POSITION[texel], axis=1)
    np.testing.assert_allclose(found / found[texel], weight(distance), rtol=1e-12)
    random = np.random.default_rng(0).random((5, N))
    np.testing.assert_allclose(read(effect("load-spreading", form), random).sum(axis=1), random.sum(axis=1), rtol=1e-12)


@pytest.mark.parametrize(("shape", "width"), [(0.8, 0.002), (1.5, 0.003), (4.0, 0.006)])
def test_a_stretched_exponential_has_the_right_shape_and_loses_what_falls_beyond_the_rim(shape, width):
    """Its weights are those of an endless lattice: the sum over a far larger one is one."""
    texel = 7 * COLUMNS + 3
    found = read(effect("load-spreading", "stretched-exponential", width=width, shape=shape, lost=1.0), image(texel))[0]
    distance = np.linalg.norm(POSITION - POSITION[texel], axis=1)
    np.testing.assert_allclose(
        found / found[texel], np.exp(-((distance / width) ** shape)), rtol=1e-12, atol=np.finfo(float).eps
    )
    lattice = PITCH * np.arange(-200.0, 201.0)
    whole = np.exp(-((np.hypot(lattice[:, None], lattice) / width) ** shape)).sum()
    assert found[texel] == pytest.approx(1.0 / whole, rel=1e-6)
    assert found.sum() < 1.0


def test_a_stretched_exponential_loses_the_share_that_it_states():
    loads, words = np.eye(N), {"width": 0.006, "shape": 1.2}
    kept, half, gone = (
        read(effect("load-spreading", "stretched-exponential", lost=lost, **words), loads).sum(axis=1)
        for lost in (0.0, 0.5, 1.0)
    )
    np.testing.assert_allclose(kept, 1.0, rtol=1e-12)
    np.testing.assert_allclose(1.0 - half, 0.5 * (1.0 - gone), rtol=1e-9)


def test_a_rim_that_reflects_gives_each_texel_what_it_takes():
    """Texels give to each other alike, and a load that is the same everywhere stays so, at corners, too."""
    weights = read(
        effect("load-spreading", "stretched-exponential", width=0.006, shape=1.2, lost=0.0, reflected=1.0), np.eye(N)
    )
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(weights, weights.T, atol=1e-15)


def test_a_rim_that_reflects_is_that_of_diffusion():
    """Heat that leaves at no rim, exp(−tL) of the lattice's Laplacian L: what is left of its effect, as a share of squares."""
    near = np.abs(POSITION[:, None] - POSITION).sum(axis=2) < 1.5 * PITCH
    laplacian = np.diag(near.sum(axis=1)) - near
    diffused = expm(-laplacian.astype(float))
    words = {"width": 1.78 * PITCH, "shape": 1.79, "lost": 0.0, "reflected": 1.0}
    found = read(effect("load-spreading", "stretched-exponential", **words), np.eye(N))
    kernel = np.exp(-((np.linalg.norm(POSITION[:, None] - POSITION, axis=2) / (1.78 * PITCH)) ** 1.79))
    left, without_reflection = (np.square(one - diffused).sum() for one in (found, kernel / kernel.sum(axis=0)))
    whole = np.square(diffused - np.eye(N)).sum()
    assert left < 2e-4 * whole < 1e-3 * whole < without_reflection


@pytest.mark.parametrize("shape", [0.4, 2.0, 8.0])
def test_a_rim_reflects_between_texels_at_any_places(shape):
    position = np.random.default_rng(3).uniform(0.0, 0.02, (60, 3))
    array = TransducerArray(position, np.full(60, 4e-6))
    weights = stretched_exponential({"width": 0.004, "shape": shape, "lost": 0.0, "reflected": 1.0}, array)
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, atol=1e-9)
    np.testing.assert_allclose(coupled(np.ones((1, 60)), weights), 1.0, atol=1e-9)


def test_a_stretched_exponential_couples_pairs_within_its_reach_alone():
    """Of many texels a list of all pairs would not fit into memory."""
    y, x = np.mgrid[0:50, 0:50] * 0.002
    position = np.stack([x.ravel(), y.ravel(), np.zeros(2500)], axis=1)
    array = TransducerArray(position, np.full(2500, 4e-6))
    found = stretched_exponential({"width": 0.003, "shape": 2.0, "lost": 1.0, "reflected": 0.0}, array)
    assert found.nnz < 2500 * 270  # texels within 6 widths
    np.testing.assert_allclose(found.sum(axis=0)[25 * 50 + 25], 1.0, rtol=1e-9)
    found = stretched_exponential({"width": 0.003, "shape": 2.0, "lost": 0.0, "reflected": 1.0}, array)
    np.testing.assert_allclose(coupled(np.ones((1, 2500)), found), 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.sum(axis=0), 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    "law",
    [
        lambda x: x**0.4,
        lambda x: np.tanh(5.0 * x),
        lambda x: -np.log1p(5.0 * x),
        lambda x: 1.0 / (1.5 - x) ** 3 - 1.0 / 1.5**3,
        lambda x: np.sin(2.0 * np.pi * x),
        lambda x: np.maximum(x - 0.2, 0.0),
    ],
)
def test_the_free_curve_of_a_channel_follows_other_curves(law):
    """The share of squares that it leaves is far below the error that it states."""
    load = np.concatenate([np.zeros(200), np.linspace(0.0, 1.0, 400)])
    values = np.linalg.lstsq(np.vander(load, 6, increasing=True), law(load), rcond=None)[0]
    words = dict(zip(channel_curve.POWERS, values.tolist(), strict=True))
    found = read(effect("channel-curve", "quintic", **words), load[:, None] * np.ones(N), np.linspace(0.0, 6.0, 600))[:, 0]
    assert np.square(found - law(load)).sum() < 0.0011 * np.square(law(load)).sum()
    assert form_of("channel-curve", "quintic").error == 0.005


def test_crosstalk():
    texel = 7 * COLUMNS + 3
    found = read(effect("crosstalk", "neighbours", share=0.1), image(texel))[0].reshape(ROWS, COLUMNS)
    expected = np.zeros((ROWS, COLUMNS))
    expected[7, 3] = 1.0
    expected[6, 3] = expected[8, 3] = expected[7, 2] = expected[7, 4] = 0.1
    np.testing.assert_allclose(found, expected, atol=1e-15)
    found = read(effect("crosstalk", "lines", share=0.6), image(texel))[0].reshape(ROWS, COLUMNS)
    assert found[7, 0] == pytest.approx(0.6 / COLUMNS) and found[0, 3] == pytest.approx(0.6 / ROWS)
    assert found[7, 3] == pytest.approx(1 + 0.6 / COLUMNS + 0.6 / ROWS) and found[0, 0] == 0.0
    found = read(effect("crosstalk", "common", share=0.5), image(texel))[0]
    assert found[0] == pytest.approx(0.5 / N)
    found = read(effect("crosstalk", "previous", share=0.3), image(texel))[0]
    np.testing.assert_allclose(found, image(texel)[0] + 0.3 * np.eye(N)[texel + 1], atol=1e-15)
    found = read(effect("crosstalk", "wires", share=0.2, fall=0.5), image(texel))[0].reshape(ROWS, COLUMNS)
    row, column = np.divmod(texel, COLUMNS)
    along, across = (0.2 * 0.5 ** (np.abs(np.arange(n) - at) - 1.0) for n, at in ((COLUMNS, column), (ROWS, row)))
    along[column] = across[row] = 1.0
    np.testing.assert_allclose(found, np.outer(across, along), atol=1e-15)  # a column's wire carries what a row's has leaked
    many = read(effect("crosstalk", "wires", share=0.2, fall=0.5), np.tile(image(texel), (N, 1)), np.arange(N) * 0.1)
    np.testing.assert_allclose(many[-1].reshape(ROWS, COLUMNS), found, atol=1e-15)  # one product of all pairs


def test_a_cover_beyond_the_rim_loses_what_falls_outside():
    """The array is a part of a large one: the same readings as if the texels outside were there and were not read."""
    wide, inner, pitch = 37, 5, 0.003  # few enough for a matrix of all pairs
    y, x = np.mgrid[0:wide, 0:wide] * pitch
    everywhere = np.stack([x.ravel(), y.ravel(), np.zeros(wide * wide)], axis=1)
    first = (wide - inner) // 2
    inside = (np.arange(wide) >= first) & (np.arange(wide) < first + inner)
    kept = (inside[:, None] & inside[None]).ravel()
    loads = np.zeros((1, wide * wide))
    loads[0, kept] = np.random.default_rng(1).random(inner**2)
    for width in (0.5 * pitch, 1.2 * pitch):
        spread = [
            readings(
                (effect("load-spreading", form, width=width),),
                TransducerArray(place, np.full(len(place), pitch**2)),
                np.zeros(1),
                load,
            )
            for form, place, load in (("gaussian", everywhere, loads), ("open", everywhere[kept], loads[:, kept]))
        ]
        np.testing.assert_allclose(spread[1][0], spread[0][0, kept], rtol=1e-6)
        assert spread[1].sum() < 0.95 * loads.sum()


def test_lines_need_rows_and_columns():
    with pytest.raises(EffectError, match="rows and columns"):
        read(effect("crosstalk", "lines"), image(0), np.zeros(1), TransducerArray(POSITION, GRID.area, name="pad"))


# --- texels by themselves


def test_listed_values():
    factor = np.linspace(0.5, 1.5, N)
    force = np.random.default_rng(0).random((9, N))
    np.testing.assert_allclose(read(effect("gain-mismatch", "listed", factor=factor), force, TIME[:9]), force * factor)
    curves = effect("gain-mismatch", "curved", factor=factor, curvature=factor - 1.0)
    np.testing.assert_allclose(read(curves, force, TIME[:9]), factor * (force + (factor - 1.0) * force**2))
    powers = effect("gain-mismatch", "random-power", spread=0.2, force=0.5, seed=3)
    found = read(powers, force, TIME[:9])
    exponent = np.log(found / 0.5) / np.log(force / 0.5)  # the same at all forces, another in each texel
    np.testing.assert_allclose(exponent, np.broadcast_to(exponent[0], exponent.shape), rtol=1e-6)
    assert np.log(exponent[0]).std() == pytest.approx(0.2, rel=0.25)
    np.testing.assert_allclose(read(powers, np.full((2, N), 0.5), TIME[:2]), 0.5)
    np.testing.assert_allclose(read(effect("offset", "listed", offset=factor), force, TIME[:9]), force + factor)
    for zero in (0.0, 2.5):  # without load each texel has its whole offset
        found = read(effect("offset", "relieved", offset=factor, level=0.5), force, TIME[:9], replace(GRID, zero=zero))
        np.testing.assert_allclose(found, zero + force + factor * np.exp(-force / 0.5))
    moved = factor * (TIME[:9, None] / 60.0) ** 0.5
    np.testing.assert_allclose(read(effect("drift", "listed", amount=factor, exponent=0.5), force, TIME[:9]), force + moved)
    straight = read(effect("drift", "shifted-power", amount=12.0, time=30.0, exponent=1.0), force, TIME[:9])
    np.testing.assert_allclose(straight, read(effect("drift", "linear", rate=0.2), force, TIME[:9]))
    found = read(effect("drift", "shifted-power", amount=0.3, time=7.0, exponent=0.0), force, TIME[:9])
    np.testing.assert_allclose(found, force + 0.3 * np.log1p(TIME[:9, None] / 7.0) / np.log1p(60.0 / 7.0))
    dead = (np.arange(N) % 5 == 0).astype(float)
    np.testing.assert_allclose(read(effect("dead-texels", "listed", dead=dead), force, TIME[:9]), force * (1 - dead))
    found = read(effect("dead-texels", "held", dead=dead, level=0.01 * np.arange(N)), force, TIME[:9])
    np.testing.assert_allclose(found, np.where(dead > 0, 0.01 * np.arange(N), force))


def test_a_gradient_of_gains():
    found = read(effect("gain-mismatch", "gradient", along_x=0.2, along_y=-0.1), np.ones((1, N)))[0].reshape(ROWS, COLUMNS)
    assert found[0, 0] == pytest.approx(1 - 0.2 + 0.1) and found[-1, -1] == pytest.approx(1 + 0.2 - 0.1)


MANY = TransducerArray(np.zeros((40_000, 3)), np.ones(40_000))


def test_chance_has_the_distribution_that_it_says():
    """40,000 texels: standard errors are below 0.75 % of the spread."""
    one, level = np.ones((1, 40_000)), np.zeros(1)
    gains = np.log(read(effect("gain-mismatch", spread=0.3), one, level, MANY)[0])
    assert gains.mean() == pytest.approx(0, abs=0.006) and gains.std() == pytest.approx(0.3, rel=0.02)
    offsets = read(effect("offset", "random", spread=0.3), one, level, MANY)[0] - 1
    assert offsets.mean() == pytest.approx(0, abs=0.006) and offsets.std() == pytest.approx(0.3, rel=0.02)
    assert abs(np.corrcoef(gains, offsets)[0, 1]) < 0.02  # one seed, two purposes
    dead = read(effect("dead-texels", share=0.2), one, level, MANY)[0] == 0
    assert dead.mean() == pytest.approx(0.2, abs=0.01)
    stuck = read(effect("dead-texels", "stuck", share=0.2, level=7.0), one, level, MANY)[0] == 7
    np.testing.assert_array_equal(stuck, dead)


def test_noise():
    """500 × 84 numbers: mean, spread, kurtosis, and no correlation in time or between texels."""
    force = np.full((len(TIME), N), 2.0)
    white = read(effect("noise", "white", spread=0.1, seed=1), force) - 2
    assert white.mean() == pytest.approx(0, abs=0.002) and white.std() == pytest.approx(0.1, rel=0.02)
    assert (white**4).mean() / 0.1**4 == pytest.approx(3, abs=0.15)
    assert abs((white[1:] * white[:-1]).mean()) < 2e-4 and abs((white[:, 1:] * white[:, :-1]).mean()) < 2e-4
    proportional = read(effect("noise", "proportional", share=0.05, seed=1), force) - 2
    assert proportional.std() == pytest.approx(0.1, rel=0.02)
    coloured = read(effect("noise", "coloured", spread=0.1, time=0.2, seed=1), force) - 2
    assert coloured.std() == pytest.approx(0.1, rel=0.05)
    near, far = ((coloured[lag:] * coloured[:-lag]).mean() / 0.01 for lag in (1, 30))
    assert near > 0.9 and abs(far) < 0.1


def test_a_random_walk():
    """Increments are independent and their variance is the time between; both also across a power of two of seconds."""
    time = np.linspace(0.0, 10.0, 201)
    found = readings((effect("drift", "random-walk", spread=0.1, seed=4),), MANY, time, np.zeros((201, 4000)))
    assert (found[0] == 0).all()
    assert found[-1].std() == pytest.approx(0.1 * np.sqrt(10), rel=0.05)
    steps = np.diff(found, axis=0)
    np.testing.assert_allclose(steps.std(axis=1), 0.1 * np.sqrt(0.05), rtol=0.06)
    for moment in (40, 80, 160):  # 2, 4 and 8 s
        assert abs(np.corrcoef(steps[moment - 1], steps[moment])[0, 1]) < 0.06


@pytest.mark.parametrize(("name", "form"), [("noise", "white"), ("noise", "coloured"), ("drift", "random-walk")])
def test_any_moment_can_be_asked_for_by_itself(name, form):
    item, force = effect(name, form, seed=9), np.ones((len(TIME), N))
    whole = read(item, force)
    for i in (500, 3, 77):
        np.testing.assert_array_equal(ReadoutChain((item,), GRID).step(TIME[i], force[i]), whole[i])


# --- channels of magnetometers


@pytest.mark.parametrize(("form", "names"), [("linear", ""), ("quadratic", "second"), ("cubic", "second third")])
def test_each_channel_has_a_polynomial_of_its_own(form, names):
    """Against numpy's polynomials, with either sign, before a gain and a zero."""
    random = np.random.default_rng(4)
    values = {name: random.normal(size=N) for name in ("offset", "factor", *names.split())}
    force = np.linspace(-0.5, 2.0, len(TIME))[:, None] * np.ones(N)
    array = TransducerArray(POSITION, GRID.area, gain=-3.0, zero=7.0)
    found = read(effect("channel-curve", form, **values), force, transducers=array)
    for texel in (0, 17, N - 1):
        expected = np.polynomial.Polynomial([values[name][texel] for name in values])(force[:, texel])
        np.testing.assert_allclose(found[:, texel], 7.0 - 3.0 * expected, rtol=1e-11, atol=1e-11)


def test_a_quintic_contains_the_others():
    force = np.linspace(-0.5, 2.0, len(TIME))[:, None] * np.ones(N)
    values = {"factor": -0.4, "offset": 0.1, "second": 0.3, "third": -0.2}
    less, more = (read(effect("channel-curve", form, **values), force) for form in ("cubic", "quintic"))
    np.testing.assert_array_equal(less, more)
    bent = read(effect("channel-curve", "quintic", **values, fourth=0.01, fifth=-0.02), force)
    np.testing.assert_allclose(bent - less, 0.01 * force**4 - 0.02 * force**5, atol=1e-12)


def test_a_magnetometer_that_is_mounted_askew_shows_a_turned_field():
    from scipy.spatial.transform import Rotation

    field = np.random.default_rng(5).normal(size=(len(TIME), N))
    found = read(effect("axis-coupling", "rotation", x=0.3, y=-0.2, z=1.1), field)
    turned = Rotation.from_rotvec([0.3, -0.2, 1.1]).apply(field.reshape(-1, 3))
    np.testing.assert_allclose(found, turned.reshape(field.shape), atol=1e-13)


def test_soft_iron_couples_alike_in_both_directions():
    for i, j, share in ((0, 1, 0.2), (1, 2, -0.3), (0, 2, 0.1)):
        assert read(effect("axis-coupling", "soft-iron", xy=0.2, yz=-0.3, xz=0.1), image(6 + i))[0, 6 + j] == share
        assert read(effect("axis-coupling", "soft-iron", xy=0.2, yz=-0.3, xz=0.1), image(6 + j))[0, 6 + i] == share


def test_all_magnetometers_share_the_ambient_field():
    force = np.random.default_rng(6).normal(size=(len(TIME), N))
    array = TransducerArray(POSITION, GRID.area, gain=2.0, zero=1.0)
    plain = read(effect("ambient-field", "linear", x=0.0, y=0.0, z=0.0), force, transducers=array)
    for form, factor in (("constant", 1.0), ("linear", TIME[:, None])):
        found = read(effect("ambient-field", form, x=0.3, y=-0.2, z=0.5), force, transducers=array)
        expected = np.tile([0.3, -0.2, 0.5], N // 3) * factor
        np.testing.assert_allclose(found - plain, np.broadcast_to(expected, force.shape), atol=1e-12)


@pytest.mark.parametrize(("name", "form"), [("axis-coupling", "soft-iron"), ("ambient-field", "linear")])
def test_channels_that_do_not_come_in_threes_are_refused(name, form):
    array = TransducerArray(POSITION[:4], GRID.area[:4], name="fingertip")
    with pytest.raises(EffectError, match=f"'{name}' of sensor 'fingertip' needs three channels .* has 4 channels: use"):
        read(effect(name, form), np.ones((len(TIME), 4)), transducers=array)
