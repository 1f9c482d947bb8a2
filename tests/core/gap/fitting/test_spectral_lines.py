# SPDX-License-Identifier: GPL-3.0-or-later
"""A line in the noise at rest is found where it is, and coloured noise is none."""

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.fitting.least_squares import TrialView
from palpate.core.gap.fitting.residual_tests import strongest_line
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job


def line_in(rig, deviation):
    views = [TrialView(Predictor(trial, rig), noise=(deviation, 1.0)) for trial in rig.of("fit")]
    return strongest_line(views, Model(rig.parameters))


def hum(amplitude, frequency):
    """Every texel at a phase of its own, so that the mean of all shows nothing."""
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, cases.ROWS * cases.COLUMNS)
    return lambda reading, time: reading + amplitude * np.sin(2 * np.pi * frequency * time[:, None] + phase)


def test_a_line_is_found_with_frequency_and_amplitude():
    found = line_in(cases.rig(change=hum(0.01, 7.3), seed=21), 1e-3)
    assert found.frequency == pytest.approx(7.3, abs=0.04)  # half the distance of two frequencies of a trial
    assert found.amplitude == pytest.approx(0.01, rel=0.15)  # a frequency between two loses some of it


@pytest.mark.parametrize("colour", [0.0, 0.9])
@pytest.mark.parametrize("seed", range(5))
def test_noise_has_no_line(colour, seed):
    assert line_in(cases.rig(seed=30 + seed, colour=colour), 1e-3) is None


@pytest.mark.long("a whole diagnosis")
def test_hum_of_many_phases_is_unexplained():
    result = run_job(diagnose(cases.rig(change=hum(0.01, 7.3), seed=22)))
    assert result.verdict == "unexplained" and not result.findings and result.line is not None
