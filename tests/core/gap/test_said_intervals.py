# SPDX-License-Identifier: GPL-3.0-or-later
"""Intervals and confidences in words."""

import pytest

from palpate.core.gap.fitting.intervals import ParameterInterval
from palpate.core.gap.report.html_report import _value_and_ends
from palpate.core.gap.report.sentences import NOT_IDENTIFIABLE, interval_text, said_confidence


@pytest.mark.parametrize(("value", "low", "high", "bounds", "is_told"), [
    (0.4, 0.3, 0.5, (0.0, 0.95), True),
    (0.95, 0.8, 0.95, (0.0, 0.95), True),  # at one end of its bounds alone
    (0.95, 0.0, 0.95, (0.0, 0.95), False),
    (1.0, 0.01, 30.0, (0.0, 1e6), False),  # the order of magnitude is open
    (-1.0, -1.5, -0.5, (-10.0, 10.0), True),
])  # fmt: skip
def test_an_interval_that_fills_its_bounds_is_not_told(value, low, high, bounds, is_told):
    text = interval_text(ParameterInterval(0, "amount", value, low, high, bounds))
    assert text == (
        f"{value:.4g} ({low:.4g} … {high:.4g})"
        if is_told
        else f"not identifiable from these recordings; sensor.toml has {value:.4g}"
    )


@pytest.mark.parametrize(("confidence", "said"), [(0.25, "25%"), (0.985, "98%"), (0.99, "99%"), (0.9996, "over 99%")])
def test_no_confidence_is_said_as_certain(confidence, said):
    assert said_confidence(confidence) == said


def test_the_report_states_no_value_that_the_recordings_leave_open():
    assert _value_and_ends(0.95, NOT_IDENTIFIABLE) == ("–", NOT_IDENTIFIABLE)
    assert _value_and_ends(0.95, "0.9 … 1") == ("0.95", "0.9 … 1")
