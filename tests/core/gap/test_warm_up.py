# SPDX-License-Identifier: GPL-3.0-or-later
"""A gain that changes after power-on is a warm-up where recordings share a clock, and elsewhere a form of drift."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.base.recording_differences import as_one_session
from palpate.core.gap.candidates.candidates import candidates
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.selection.rule_numbers import SURE


def warming(clock=True):
    """A rig of seven recordings, whose gain rises as a stretched exponential; one session with pauses, or files from zero."""
    plain, start, trials = cases.rig(trials=7, seed=4), 0.0, []
    for trial, pause in zip(plain.trials, (20.0, 8.0, 50.0, 12.0, 30.0, 15.0, 0.0), strict=True):
        time = trial.time + start
        gain = 1.0 + 0.25 * (1.0 - np.exp(-((time / 50.0) ** 0.7)))
        shown = {"time": time, "session": "bench"} if clock else {}
        trials.append(replace(trial, reading=trial.reading * gain[:, None], **shown))
        start = float(time[-1]) + pause
    return replace(plain, trials=tuple(trials))


def gains_by_themselves(rig):
    """Forms by which a gain may change by itself, among the candidates of a rig."""
    forms = candidates(predictors_of(rig.trials, rig), Model(rig.parameters))
    return {one.label for one in forms if one.name == "warm-up" or one.label == "drift/sensitivity"}


def test_it_needs_a_clock_that_goes_on():
    assert gains_by_themselves(warming()) == {"warm-up/exponential", "warm-up/rational"}
    alone = warming(clock=False)
    assert gains_by_themselves(alone) == {"drift/sensitivity"}
    assumed = as_one_session(alone)  # one of the assumptions about how recordings differ
    assert assumed is not None and gains_by_themselves(assumed) == {"warm-up/exponential", "warm-up/rational"}


@pytest.mark.long("a whole diagnosis of a session")
def test_a_gain_that_warms_up_by_a_formula_of_others_is_named():
    result = cases.diagnosed(warming())
    assert {one.name for one in result.findings if one.confidence >= SURE} == {"warm-up"} and result.verdict == "explained"
