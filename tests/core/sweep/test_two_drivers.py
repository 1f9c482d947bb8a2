# SPDX-License-Identifier: GPL-3.0-or-later
"""Two commands at once in the folder of one study."""

import pytest

from palpate.attack.area import CLEAR, Case
from palpate.attack.sweep import Sweep

pytest.importorskip("distributed")


@pytest.mark.slow("starts the command three times, each with workers and processes for runs")
def test_the_second_command_says_that_there_is_another_and_the_results_are_those_of_one(tmp_path):
    area = Sweep(1, 12, tmp_path, runs=60)
    case = Case("two drivers", {"share": 0.1, "by its folder": False})
    try:
        outcome = area.attempt(case)
    finally:
        area.close()
    assert outcome.kind == CLEAR, outcome.seen
    (said, nothing), statuses = case.data["said"], case.data["statuses"]
    assert statuses == (1, 0) and "Another sweep is writing to" in said and "Another" not in nothing
