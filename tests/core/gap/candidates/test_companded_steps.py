# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of a converter that compands: seen, with their widths, and not seen where there are none."""

import numpy as np
import pytest

from palpate.core.effects.engine.readout_chain import readings
from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.effects.engine.specification import TransducerArray
from palpate.core.gap.candidates.candidates import Candidate
from palpate.core.gap.candidates.companded_steps import companded_steps
from palpate.core.gap.candidates.direct_estimates import power_starts

DEPTH = 3e-3


def presses(rng):
    """Return loads (t, 16) of texels under a ball, the largest about 1."""
    across = rng.uniform(0.0, 2e-3, 16) ** 2 / 16e-3
    gains = np.exp(0.1 * rng.standard_normal(16))
    parts = []
    for _ in range(5):
        depth = rng.uniform(0.4, 1.0) * DEPTH * np.sin(np.pi * np.linspace(0.0, 1.0, int(rng.integers(120, 500))))
        parts.append(gains * np.maximum(depth[:, None] - across, 0.0) / DEPTH)
    return np.concatenate(parts)


def power(steps, full, p):
    """A converter that rounds down the power p of a load, and the width of its step at a load."""

    def convert(load):
        return np.sign(load) * full * (np.floor(steps * (np.abs(load) / full) ** p) / steps) ** (1.0 / p)

    return convert, lambda load: full / steps / p * (load / full) ** (1.0 - p)


def logarithm(steps, full, mu):
    """A converter that rounds down the logarithm of a load (the μ-law), and the width of its step at a load."""

    def convert(load):
        code = np.floor(steps * np.log1p(mu * np.abs(load) / full) / np.log1p(mu))
        return np.sign(load) * full / mu * np.expm1(code / steps * np.log1p(mu))

    return convert, lambda load: np.log1p(mu) / mu * (full + mu * load) / steps


def moving(load, reading):
    """Readings at which the load changes, at most 6000, as in the gap analysis."""
    found = reading[np.abs(np.gradient(load, axis=0)) > 1e-5]
    return found[:: max(1, len(found) // 6000)]


def has_right_width(steps, values, width):
    """Whether steps are as wide as the converter's, within a tenth, at small, middle and large readings."""
    at = np.quantile(values[values > 0.02 * values.max()], (0.1, 0.5, 0.9))
    reading = at[:, None] * (1.0 + 1e-6 * np.array([-1.0, 1.0]))
    slope = np.diff(steps.even(reading), axis=1)[:, 0] / np.diff(reading, axis=1)[:, 0]
    return bool(np.all(np.abs(1.0 / (steps.frequency * slope) / width(at) - 1.0) < 0.1))


@pytest.mark.parametrize("bits", [6, 9, 12])
@pytest.mark.parametrize(("converter", "bend"), [(power, 0.5), (power, 1.6), (logarithm, 20.0), (logarithm, 255.0)])
def test_steps_behind_a_power_or_a_logarithm_are_seen(converter, bend, bits):
    """Noise of a fifth of a middle step is converted with the load."""
    rng = np.random.default_rng(bits)
    load = presses(rng)
    convert, width = converter(2.0**bits, 1.2 * load.max(), bend)
    spread = 0.2 * width(np.median(load[load > 0.0]))
    values = moving(load, convert(load + spread * rng.standard_normal(load.shape)))
    found = companded_steps(values)
    assert found and has_right_width(found[0], values, width)


@pytest.mark.parametrize("spread", [1e-5, 1e-2])
def test_no_steps_are_seen_where_there_are_none(spread):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        load = presses(rng)
        bent = load ** float(rng.uniform(0.5, 2.0))
        assert not companded_steps(moving(load, bent + spread * rng.standard_normal(load.shape)))


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
