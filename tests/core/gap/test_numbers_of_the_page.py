# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/gap.md states thresholds, keys and limits of the source, and the page of results the counts of its own tables."""

import re
from fractions import Fraction

import pytest

from palpate.core.gap.planning.separation import LEAST_SHARE
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
    assert f"Kinds with less than {in_words(LEAST_SHARE)} left are listed" in page


def test_counts_of_the_results_add_up(repository):
    text = (repository / "docs" / "gap-results.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in text.splitlines()]
    hidden = {row[0].strip("`"): row for row in rows if len(row) == 8 and re.fullmatch(r"`\w+`", row[0])}
    count = {kind: tuple(int(row[i]) for i in (1, 4, 5)) for kind, row in hidden.items()}
    assert {"own", "other", "third", "none", "two", "three", "outside"} <= set(count)
    for kind, (cases, right, _) in count.items():
        assert hidden[kind][6] == f"{100 * right / cases:.0f} %", kind
    flat = " ".join(text.split())
    cases, right, wrong = (sum(one[i] for one in count.values()) for i in range(3))
    assert f"{wrong} of the {cases} cases have a wrong name ({100 * wrong / cases:.1f} %" in flat
    one = [count[kind] for kind in ("own", "other", "third")]
    assert f"Of the {sum(c for c, _, _ in one)} cases with one effect {sum(r for _, r, _ in one)} are right" in flat
    bins = [re.match(r"(\d+) of (\d+)", row[2]).groups() for row in rows if len(row) == 4 and "–" in row[0]]
    names = sum(int(count) for _, count in bins)
    assert f"({names} names, doubts included)" in flat
    sure = [(int(right), int(count)) for right, count in bins[2:]]
    assert f"right in {sum(right for right, _ in sure)} of {sum(count for _, count in sure)} cases" in text
