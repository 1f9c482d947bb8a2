# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of a converter that compands: seen, with their widths, and not seen where there are none."""

import numpy as np
import pytest

from palpate.core.effects.engine.readout_chain import readings
from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.effects.engine.specification import TransducerArray
from palpate.core.gap.selection.candidates import Candidate
from palpate.core.gap.selection.companded_steps import companded_steps
from palpate.core.gap.selection.direct_estimates import power_starts

MIDDLE_DEPTH = 3e-3


def presses(rng):
    """Return loads (t, n) of a few texels under a ball, the largest about 1: smooth presses and cycles."""
    texels, number = int(rng.choice([1, 4, 16, 40])), int(rng.integers(3, 8))
    across = rng.uniform(0.0, 2e-3, texels) ** 2 / 16e-3
    gains = np.exp(0.1 * rng.standard_normal(texels))
    parts = []
    for _ in range(number):
        t = np.linspace(0.0, 1.0, int(rng.integers(120, 500)))
        depth = rng.uniform(0.4, 1.0) * MIDDLE_DEPTH * np.sin(np.pi * t) ** float(rng.choice([1.0, 2.0]))
        parts.append(gains * np.maximum(depth[:, None] - across, 0.0) / MIDDLE_DEPTH)
    return np.concatenate(parts)


def converter(rng, kind, full):
    """Return a converter of loads up to `full`, and the width of its step at a load."""
    steps = 2.0 ** int(rng.integers(6, 13))
    if kind in ("square root", "power"):
        p = 0.5 if kind == "square root" else float(rng.uniform(0.5, 2.0))
        rounding = float(rng.choice([0.0, 0.5]))

        def convert(load):
            code = np.floor(steps * (np.abs(load) / full) ** p + rounding)
            return np.asarray(np.sign(load) * full * (code / steps) ** (1.0 / p))

        return convert, lambda load: full / steps / p * (load / full) ** (1.0 - p)
    mu = 255.0 if kind == "mu-law" else float(np.exp(rng.uniform(np.log(5.0), np.log(300.0))))

    def compand(load):
        code = np.floor(steps * np.log1p(mu * np.abs(load) / full) / np.log1p(mu))
        return np.asarray(np.sign(load) * full / mu * np.expm1(code / steps * np.log1p(mu)))

    return compand, lambda load: np.log1p(mu) / mu * (full + mu * load) / steps


def moving(load, reading):
    """Readings at which the load changes, at most 6000, as in the gap analysis."""
    found = reading[np.abs(np.gradient(load, axis=0)) > 1e-5]
    return found[:: max(1, len(found) // 6000)]


def with_steps(seed):
    """Return the kind of a companding converter, readings behind it, and the width of a step at a reading."""
    rng = np.random.default_rng([7, seed])
    kind = ("square root", "power", "logarithm", "mu-law")[seed % 4]
    load = presses(rng)
    convert, width = converter(rng, kind, float(load.max()) * float(rng.uniform(1.0, 1.6)))
    spread = rng.uniform(0.05, 0.5) * float(width(np.median(load[load > 0.0])))
    return kind, moving(load, convert(load + spread * rng.standard_normal(load.shape))), width


def has_right_width(steps, values, width):
    """Whether steps are as wide as the converter's, within a tenth, at small, middle and large readings."""
    at = np.quantile(values[values > 0.02 * values.max()], (0.1, 0.5, 0.9))
    reading = at[:, None] * (1.0 + 1e-6 * np.array([-1.0, 1.0]))
    slope = np.diff(steps.even(reading), axis=1)[:, 0] / np.diff(reading, axis=1)[:, 0]
    return bool(np.all(np.abs(1.0 / (steps.frequency * slope) / width(at) - 1.0) < 0.1))


def without_steps(seed, noisy):
    """Return readings with noise alone, or with hardly any."""
    rng = np.random.default_rng([8, seed, noisy])
    load = presses(rng)
    spread = 10.0 ** rng.uniform(-3.0, -1.5) if noisy else 10.0 ** rng.uniform(-6.0, -4.0)
    bent = load ** float(rng.uniform(0.5, 2.0))
    return moving(load, bent + spread * rng.standard_normal(load.shape))


@pytest.mark.parametrize("seed", range(12))
def test_steps_behind_a_power_or_a_logarithm_are_seen(seed):
    kind, values, width = with_steps(seed)
    found = companded_steps(values)
    assert found, f"behind a {kind}"
    assert has_right_width(found[0], values, width)


@pytest.mark.parametrize("noisy", [True, False])
def test_no_steps_are_seen_where_there_are_none(noisy):
    for seed in range(10):
        assert not companded_steps(without_steps(seed, noisy))


def test_readings_that_are_written_with_few_decimals_have_even_steps():
    rng = np.random.default_rng(3)
    found = companded_steps(np.round(rng.uniform(0.0, 1.0, 4000) ** 2, 3))
    assert found[0].bend == pytest.approx(0.0, abs=0.003) and found[0].first == pytest.approx(1e-3, rel=0.02)


@pytest.mark.parametrize("exponent", [0.5, 0.8, 1.6])
def test_few_levels_behind_a_power_are_read_off(exponent):
    """The effect with the values that were read off has the same levels."""
    levels = 7.0 + 0.02 * np.arange(12) ** (1.0 / exponent)
    found, other = power_starts(levels, 7.0, Candidate(kind_of("quantization"), form_of("quantization", "power")))
    assert found.values["exponent"] == pytest.approx(exponent, rel=0.02)
    assert found.values["first"] == pytest.approx(0.02, rel=0.05)
    assert (found.values["rounding"], other.values["rounding"]) == (0.0, 0.5)
    exact = effect("quantization", "power", first=0.02, exponent=exponent)
    load = np.linspace(0.0, levels[-1] - 7.0 + 1e-6, 20001)[:, None]
    pad = TransducerArray(np.zeros((1, 3)), np.ones(1), zero=7.0)
    shown = readings((exact,), pad, np.arange(20001.0), load)
    np.testing.assert_allclose(np.unique(np.round(shown, 9)), levels, atol=1e-8)
