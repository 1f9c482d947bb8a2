# SPDX-License-Identifier: GPL-3.0-or-later
"""A texel that jumps in one check recording is set aside and said; what an effect explains, or makes worse, is not."""

import json
from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect
from palpate.core.gap.fitting.least_squares import TrialView
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.report import sentences, summary
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection import verdict
from palpate.core.gap.selection.confidence import SURE, probability
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.outlying_channels import outlying_channels, without_channels
from palpate.core.jobs import run_job

TEXEL = 7
SATURATION = effect("saturation", "rational", level=0.25)


def changed(rig, name, texels, reading):
    """A rig in which some texels of one recording read something else; `reading` is a function of what they read."""
    trials = []
    for trial in rig.trials:
        if trial.name == name:
            table = trial.reading.copy()
            table[:, texels] = reading(table[:, texels])
            trial = replace(trial, reading=table)
        trials.append(trial)
    return replace(rig, trials=tuple(trials))


def jumps(table):
    """To another level for the second half."""
    return table + 3.0 * (np.arange(len(table)) > len(table) // 2)[:, None]


def views_of(rig, use):
    return [TrialView(Predictor(trial, rig), noise=(1e-3, 1.0)) for trial in rig.of(use)]


def saturating(**words):
    return cases.rig(contact=lambda f, t: f / (1.0 + 4.0 * f), seed=4, stated=80.0, **words)


@pytest.mark.parametrize(("recording", "texels", "reading", "is_set_aside"), [
    ("t3", [TEXEL], jumps, True),
    ("t3", [TEXEL], lambda table: table, False),  # nothing jumps
    ("t0", [TEXEL], jumps, False),  # what jumps while it is fitted belongs to the fit
    ("t3", [1, 5, 7, 11], jumps, False),  # then it is another recording, not a channel
])  # fmt: skip
def test_one_channel_of_one_check_recording_is_set_aside(recording, texels, reading, is_set_aside):
    rig = changed(saturating(trials=4, seconds=5.0), recording, texels, reading)
    base = Model(rig.parameters)
    found = outlying_channels(views_of(rig, "fit"), views_of(rig, "check"), base, base.with_effect(SATURATION))
    assert [(one.recording, one.texel) for one in found] == ([("t3", TEXEL)] if is_set_aside else [])
    assert all(one.times > 10.0 for one in found)
    left = without_channels(views_of(rig, "check"), found)
    missing = [np.isnan(view.predictor.trial.reading).all(axis=0).nonzero()[0].tolist() for view in left]
    assert missing == ([[TEXEL]] if is_set_aside else [[]])


def test_an_error_that_rises_is_never_hidden():
    """The texel jumps as well, but the amended model makes the recording as a whole worse."""
    rig = changed(saturating(trials=4, seconds=5.0), "t3", [TEXEL], jumps)
    base = Model(replace(rig.parameters, k=0.5 * rig.parameters.k))
    worse = base.with_effect(effect("saturation", "rational", level=0.02))
    fitted, check = views_of(rig, "fit"), views_of(rig, "check")
    assert sum(view.squares(view.residual(worse)).sum() for view in check) > sum(
        view.squares(view.residual(base)).sum() for view in check
    )
    assert not outlying_channels(fitted, check, base, worse)
    assert not outlying_channels(fitted, check, base, base)  # and without an effect there is nothing to hold it against


def test_a_name_stays_sure_beside_a_texel_that_jumps_in_a_check_recording(monkeypatch):
    rig = changed(saturating(trials=4, seconds=8.0), "t3", [TEXEL], jumps)
    supports = []
    monkeypatch.setattr(verdict, "probability", lambda support: supports.append(support) or probability(support))
    result = run_job(diagnose(rig))
    assert [(one.recording, one.texel) for one in result.outlying] == [("t3", TEXEL)]
    (found,) = result.findings
    assert found.name == "saturation" and found.confidence >= SURE
    assert found.confidence in [round(probability(support), 3) for support in supports], (
        "a sure name has a calibrated confidence"
    )
    assert result.verdict == "explained" and result.check.closed[0] > 0.9
    errors = gap_errors(result)
    said = [text for text in sentences.warnings(result) if f"Texel {TEXEL} of the check recording 't3'" in text]
    assert len(said) == 1
    found = summary.summary(result, errors)
    json.dumps(found, allow_nan=False)
    assert [one["outlying_texels"] for one in found["check"]] == [[TEXEL]]
    assert errors.amended["check"] > 3.0 * errors.amended["fit"]  # the errors still have it
