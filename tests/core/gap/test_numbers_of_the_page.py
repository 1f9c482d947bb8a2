# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/gap.md states thresholds, keys and limits of the source, and the page of results the counts of its own tables."""

import re
from fractions import Fraction

import pytest

from palpate.core.gap.kinds.decision_numbers import LEAST_SHARE_TOLD
from palpate.core.gap.selection import check_recordings, confidence, forward_selection, verdict

SHARES = {Fraction(1, 2): "half", Fraction(1, 4): "a quarter", Fraction(1, 5): "a fifth", Fraction(1, 10): "a tenth"}


def in_words(share: float) -> str:
    return SHARES[Fraction(share).limit_denominator(100)]


@pytest.fixture(scope="module")
def page(repository):
    return " ".join((repository / "docs" / "gap.md").read_text(encoding="utf-8").split())


def test_thresholds_are_those_of_the_source(page):
    assert f"An effect, or a pair, must close {in_words(forward_selection.FIRST_LEAST_SHARE)} of the gap" in page
    assert f"may join by {in_words(forward_selection.LEAST_SHARE_OF_FORCES)} of the forces' gap alone" in page
    assert "another kind leaves less than twice its error" in page and confidence.CLEAR_LEAD == 2.0
    assert f"Each must close {in_words(forward_selection.NEXT_LEAST_SHARE)} of the remaining gap" in page
    assert f"close at least {in_words(check_recordings.CHECK_CLOSED)} of their squared gap" in page
    assert f"Names with {confidence.SURE:g} or more are findings" in page
    assert f"at most {verdict.RIVAL_RATIO:g} times its error (`ambiguous`, at most {confidence.UNSURE_CONFIDENCE:g};" in page
    assert f"A doubt without a rival has at most {confidence.UNLIKELY_CONFIDENCE:g}." in page
    assert f"closes less than {in_words(confidence.SMALL_SHARE)} of the gap" in page
    assert f"Kinds with less than {in_words(LEAST_SHARE_TOLD)} left are listed" in page


def test_counts_of_the_results_add_up(repository):
    text = (repository / "docs" / "gap-results.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in text.splitlines()]
    hidden = {row[0].strip("`"): row for row in rows if len(row) == 8 and re.fullmatch(r"`\w+`", row[0])}
    for kind in ("own", "other", "third", "none", "two", "three", "outside"):
        _, cases, _, _, first, second, both, _ = hidden[kind]
        right = sum(int(re.match(r"(\d+) right", cell).group(1)) for cell in (first, second))
        assert both == f"{100 * right / (1.5 * int(cases)):.0f} %", kind
    one = [sum(int(re.match(r"\d+", cell).group()) for cell in hidden[kind][4:6]) for kind in ("own", "other", "third")]
    assert f"Of the 330 cases with\none effect {sum(one)} are right" in text
    wrong = sum(int(count) for row in hidden.values() for count in re.findall(r"(\d+) wrong", " ".join(row[4:6])))
    assert wrong == 4 and "Four of the 585 have a wrong name" in text
    bins = [re.match(r"(\d+) of (\d+)", row[2]).groups() for row in rows if len(row) == 4 and "–" in row[0]]
    assert sum(int(count) for _, count in bins) == 239
    sure = [(int(right), int(count)) for right, count in bins[2:]]
    assert f"right in {sum(right for right, _ in sure)} of {sum(count for _, count in sure)} cases" in text
