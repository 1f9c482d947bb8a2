# SPDX-License-Identifier: GPL-3.0-or-later
"""A gain that changes after power-on is a warm-up where recordings share a clock, and elsewhere a form of drift."""

from pathlib import Path

import pytest

from palpate.benchmarks._hidden import sessions
from palpate.benchmarks._rows import sure_names
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.selection.candidates import candidates
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.recording_differences import as_one_session
from palpate.core.jobs import run_job


def gains_by_themselves(rig):
    """Forms by which a gain may change by itself, among the candidates of a rig."""
    forms = candidates(predictors_of(rig.trials, rig), Model(rig.parameters))
    return {one.label for one in forms if one.name == "warm-up" or one.label == "drift/sensitivity"}


def test_it_needs_a_clock_that_goes_on(tmp_path: Path):
    path = sessions.write(sessions.draw("warm-up", "session", 5000), tmp_path)
    rig = read_rig(path)
    assert gains_by_themselves(rig) == {"warm-up/exponential", "warm-up/rational"}
    alone = "\n".join(line for line in path.read_text().splitlines() if not line.startswith(("session", "started")))
    path.write_text(alone)
    alone_rig = read_rig(path)
    assert gains_by_themselves(alone_rig) == {"drift/sensitivity"}
    assumed = as_one_session(alone_rig)  # one of the assumptions about how recordings differ
    assert assumed is not None and gains_by_themselves(assumed) == {"warm-up/exponential", "warm-up/rational"}


@pytest.mark.long("a whole diagnosis of a session")
def test_a_gain_that_warms_up_by_a_formula_of_others_is_named(tmp_path: Path):
    case = sessions.draw("warm-up", "session", 5000)
    result = run_job(diagnose(read_rig(sessions.write(case, tmp_path))))
    assert sure_names(result) == set(case.answer) == {"warm-up"} and result.verdict == "explained"
