# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of a converter that compands: seen, with their widths, and not seen where there are none."""

import numpy as np
import pytest

from benchmarks import companding
from palpate.core.effects.engine.readout_chain import readings
from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.effects.engine.specification import TransducerArray
from palpate.core.gap.selection.candidates import Candidate
from palpate.core.gap.selection.companded_steps import companded_steps
from palpate.core.gap.selection.direct_estimates import power_starts


@pytest.mark.parametrize("seed", range(12))
def test_steps_behind_a_power_or_a_logarithm_are_seen(seed):
    kind, values, _, width = companding.with_steps(seed)
    found = companded_steps(values)
    assert found, f"behind a {kind}"
    assert companding.has_right_width(found[0], values, width)


@pytest.mark.parametrize("noisy", [True, False])
def test_no_steps_are_seen_where_there_are_none(noisy):
    for seed in range(10):
        assert not companded_steps(companding.without_steps(seed, noisy))


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
