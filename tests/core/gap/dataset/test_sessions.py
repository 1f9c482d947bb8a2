# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a session are put on one clock; whatever contradicts itself gets a sentence."""

import numpy as np
import pytest
from rig_files import RIG, refusal, table, write

from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.dataset.trial import ONE_CLOCK, UNKNOWN_PAUSE

LENGTH = 19 * 0.02


def with_words(first, second, top=""):
    """The rig with words added to its two trials, and above them all."""
    text = RIG.replace('file = "press.csv"', f'file = "press.csv"\n{first}')
    return text.replace('file = "again.csv"', f'file = "again.csv"\n{second}').replace("[sensor]", f"{top}\n[sensor]", 1)


def begins(folder, rig, **files):
    found = read_rig(write(folder, rig, **files))
    return [float(trial.time[0]) for trial in found.trials], [trial.session for trial in found.trials], found.warnings


def test_without_sessions_nothing_goes_on(tmp_path):
    assert begins(tmp_path, RIG)[:2] == ([0.0, 0.0], ["", ""])


@pytest.mark.parametrize(
    ("words", "pause"),
    [
        (("started = 100", "started = 160.5"), 60.5),
        (('started = "2026-05-04T09:30:00"', 'started = "2026-05-04T10:30:00"'), 3600.0),
        (("started = 2026-05-04T09:30:00Z", 'started = "2026-05-04T12:30:00+02:00"'), 3600.0),
    ],
)
def test_starts_give_the_pauses(tmp_path, words, pause):
    first, second = (f'session = "morning"\n{word}' for word in words)
    starts, names, warnings = begins(tmp_path, with_words(first, second), again=table(start=5.0))
    np.testing.assert_allclose(starts, [0.0, pause])
    assert names == ["morning"] * 2 and not warnings


def test_the_order_of_starts_counts_and_not_that_of_listing(tmp_path):
    starts, *_ = begins(tmp_path, with_words('session = "s"\nstarted = 9.0', 'session = "s"\nstarted = 2.0'))
    np.testing.assert_allclose(starts, [7.0, 0.0])


def test_unknown_pauses_are_assumed_and_said(tmp_path):
    starts, _, warnings = begins(tmp_path, with_words('session = "s"', 'session = "s"'))
    np.testing.assert_allclose(starts, [0.0, LENGTH + UNKNOWN_PAUSE])
    assert "pauses of session 's'" in warnings[0]


def test_time_stamps_that_go_on_are_one_session(tmp_path):
    starts, names, warnings = begins(tmp_path, RIG, again=table(start=40.0))
    np.testing.assert_allclose(starts, [0.0, 40.0])
    assert names == [ONE_CLOCK] * 2 and "one session" in warnings[0]
    _, names, warnings = begins(tmp_path, with_words("", "", 'clock = "absolute"'), again=table(start=40.0))
    assert names == [ONE_CLOCK] * 2 and not warnings
    starts, names, warnings = begins(tmp_path, with_words("", "", 'clock = "own"'), again=table(start=40.0))
    np.testing.assert_allclose(starts, [0.0, 40.0])  # recordings keep their order on a common clock
    assert names == ["", ""] and not warnings


def test_forces_and_depths_have_no_common_state(tmp_path):
    rig = with_words('session = "s"', 'session = "s"')
    assert "known force" in refusal(tmp_path, rig, press=table(names=("force",)), again=table(names=("depth",)))
    starts, names, _ = begins(tmp_path, RIG, press=table(names=("force",)), again=table(names=("depth",), start=40.0))
    assert names == ["", ""] and starts == [0.0, 40.0]
