# SPDX-License-Identifier: GPL-3.0-or-later
"""The map from support to confidence."""

from types import SimpleNamespace

import numpy as np
import pytest

from palpate.core.gap.selection.confidence import CALIBRATED_ODDS, SURE, UNLIKELY_CONFIDENCE, UNSURE_CONFIDENCE, probability
from palpate.core.gap.selection.findings import Finding
from palpate.core.gap.selection.verdict import _doubt_without_rivals


def test_odds_of_sure_names_are_a_multiple_of_those_of_their_support():
    for support in (0.5, 0.8, 0.95):
        confidence = probability(support)
        assert confidence / (1.0 - confidence) == pytest.approx(CALIBRATED_ODDS * support / (1.0 - support), rel=1e-12)


def test_the_map_keeps_order_ends_and_doubts():
    support = np.linspace(0.0, 1.0, 1001)
    confidence = np.array([probability(float(one)) for one in support])
    assert np.all(np.diff(confidence) > 0.0)
    assert confidence[0] == 0.0 and confidence[-1] == 1.0
    assert np.array_equal(confidence >= SURE, support >= SURE)
    assert np.array_equal(confidence[support < SURE], support[support < SURE])


def test_a_doubt_is_no_sure_name_and_one_without_a_rival_is_less_than_one_with():
    assert UNLIKELY_CONFIDENCE < UNSURE_CONFIDENCE < SURE


@pytest.mark.parametrize(("faults", "wear"), [([], UNLIKELY_CONFIDENCE), (["clock"], UNSURE_CONFIDENCE)])
def test_a_doubted_name_without_a_rival_is_less_likely_than_one_of_a_group(faults, wear):
    said = {"creep": UNSURE_CONFIDENCE, "wear": UNSURE_CONFIDENCE, "lag": 0.1, "drift": 0.9}
    findings = [Finding(i, name, "form", confidence, ()) for i, (name, confidence) in enumerate(said.items())]
    words = {"misleading_faults": faults, "contact_is_early": False}
    result = SimpleNamespace(findings=findings, ambiguous=[("creep", "softening")], **words)
    _doubt_without_rivals(result)
    assert {one.name: one.confidence for one in result.findings} == {**said, "wear": wear}
