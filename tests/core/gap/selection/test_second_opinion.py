# SPDX-License-Identifier: GPL-3.0-or-later
"""Doubts of the search by formulas are settled by kinds that need no formula, as far as the library's forms bear them out."""

from dataclasses import replace
from types import SimpleNamespace

import gap_cases as cases
import pytest

from palpate.core.effects.engine.registry import effect
from palpate.core.gap.forward.predictor import predictors_of
from palpate.core.gap.kinds.decision import Decision, NamedKind
from palpate.core.gap.selection import diagnosis
from palpate.core.gap.selection.base_model import prepared
from palpate.core.gap.selection.confidence import UNLIKELY_CONFIDENCE, UNSURE_CONFIDENCE
from palpate.core.gap.selection.findings import Finding
from palpate.core.gap.selection.kind_choice import choose_kinds
from palpate.core.gap.selection.verdict import _doubt_without_rivals


def _finished(steps):
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def _base(rig):
    """A search that has nothing but the fitted base model."""
    predictors = predictors_of(rig.trials, rig)
    return diagnosis._search_of(rig, predictors, *prepared(rig, predictors), [])


@pytest.fixture(scope="module")
def creeping():
    return _base(cases.rig(contact=cases.relaxing(0.3), trials=4, seconds=8.0))


def _saying(kinds):
    """A choice of kinds that says these, each clear."""

    def choose(*_):
        yield "kinds", 0.5
        return Decision(
            SimpleNamespace(kinds=frozenset(kinds)), tuple(NamedKind(kind, 2.0, (), {"drift": 9.0}) for kind in kinds)
        )

    return choose


def test_dead_texels_do_not_hide_a_kind():
    def broken(reading, time):
        out = reading.copy()
        out[:, [reading.shape[1] // 2, reading.shape[1] // 2 - 2]] = 0.0
        return out

    search = _base(cases.rig(contact=cases.relaxing(0.3), change=broken, trials=4, seconds=8.0))
    said = _finished(choose_kinds(search.views, search.result.base, search.result.noise))
    assert said.clear.keys() == {"creep"} and said.clear["creep"].support > 1.0
    assert all(times > 1.0 for times in said.clear["creep"].leaves.values())


def test_a_kind_that_a_form_bears_out_is_named(creeping, monkeypatch):
    doubted = Finding(0, "lag", "second-order", UNSURE_CONFIDENCE, ("creep",))
    monkeypatch.setattr(creeping.result, "findings", [doubted])
    monkeypatch.setattr(creeping.result, "ruled_out", [("wear", "alone it closes 3%"), ("creep", "it does not")])
    second = _finished(diagnosis._second_opinion(creeping))
    assert second is not creeping and second.result.verdict == "explained" and not second.result.ambiguous
    (found,) = second.result.findings
    assert found.name == "creep" and found.confidence > 0.8 and found.next_best in second.result.chosen_kinds["creep"].leaves
    assert dict(second.result.ruled_out) == {"lag": diagnosis.NOT_NEEDED, "wear": "alone it closes 3%"}
    assert creeping.result.findings == [doubted] and not creeping.result.chosen_kinds  # what was said first is left alone


@pytest.mark.parametrize("kinds", [("lag",), ()])
def test_what_the_forms_do_not_bear_out_changes_nothing(creeping, monkeypatch, kinds):
    """A lag does not close half of what a creep leaves."""
    monkeypatch.setattr(diagnosis, "choose_kinds", _saying(kinds))
    assert _finished(diagnosis._second_opinion(creeping)) is creeping


def test_of_several_kinds_those_are_named_that_the_forms_bear_out(creeping, monkeypatch):
    """Beside a creep nothing is left for a saturation, which is not named. A name that was sure is not given up for this."""
    monkeypatch.setattr(diagnosis, "choose_kinds", _saying(("creep", "saturation")))
    assert [one.name for one in _finished(diagnosis._second_opinion(creeping)).result.findings] == ["creep"]
    monkeypatch.setattr(creeping.result, "findings", [Finding(0, "wear", "work", 0.9, ())])
    assert _finished(diagnosis._second_opinion(creeping)) is creeping


@pytest.mark.parametrize(("unclear", "times", "kept"), [("drift", 1.5, False), ("drift", 2.5, True), ("lag", 2.5, False)])
def test_an_effect_that_both_searches_have_is_not_lost_where_much_more_is_left(creeping, monkeypatch, unclear, times, kept):
    """As where a drift explains recordings, in doubt, and the kinds are clear about a creep alone that does half of it."""
    choose = _saying(("creep",))

    def with_unclear(*_):
        decision = yield from choose()
        yield "kinds", 1.0
        return replace(decision, chosen=SimpleNamespace(kinds=frozenset(("creep", unclear))))

    monkeypatch.setattr(diagnosis, "choose_kinds", with_unclear)
    doubted = Finding(0, "drift", "linear", UNSURE_CONFIDENCE, ("creep",))
    monkeypatch.setattr(creeping.result, "findings", [doubted])
    plain = creeping.result.best
    monkeypatch.setattr(diagnosis, "_left", lambda _, found: 1.0 if found is plain else times)
    assert (_finished(diagnosis._second_opinion(creeping)) is creeping) == kept


def test_a_sure_name_of_which_the_kinds_know_nothing_is_not_given_up(creeping, monkeypatch):
    """All kinds that are said are borne out, but nothing in these recordings shows the friction that was sure before."""
    monkeypatch.setattr(diagnosis, "choose_kinds", _saying(("creep",)))
    doubted = Finding(0, "lag", "second-order", UNSURE_CONFIDENCE, ())
    for sure, kept in (("viscous-friction", True), ("stiffening", False)):
        monkeypatch.setattr(creeping.result, "findings", [doubted, Finding(1, sure, "form", 0.9, ())])
        assert (_finished(diagnosis._second_opinion(creeping)) is creeping) == kept


@pytest.mark.parametrize(
    ("name", "form", "confidence", "cycles", "asked"),
    [
        ("hysteresis", "play", UNSURE_CONFIDENCE, 5, True),
        ("hysteresis", "play", 0.9, 5, False),  # it is sure
        ("hysteresis", "play", UNSURE_CONFIDENCE, 1, False),  # the recordings lack what tells it
        ("stribeck", "gaussian", UNSURE_CONFIDENCE, 5, False),  # the search by kinds knows no friction
        ("gain-mismatch", "listed", UNSURE_CONFIDENCE, 5, False),  # numbers of single texels absorb what others leave
    ],
)
def test_kinds_are_asked_only_for_doubts_that_they_can_settle(creeping, monkeypatch, name, form, confidence, cycles, asked):
    result = creeping.result
    values = {"factor": (1.0,) * (cases.ROWS * cases.COLUMNS)} if name == "gain-mismatch" else {}
    model = result.base.model.with_effect(effect(name, form, **values))
    monkeypatch.setattr(result, "best", replace(result.base, model=model))
    monkeypatch.setattr(result, "findings", [Finding(0, name, form, confidence, ())])
    monkeypatch.setattr(result, "coverage", replace(result.coverage, cycles=cycles))
    assert diagnosis._is_doubtful(result) == asked


def test_what_is_sure_already_is_not_fitted_again(creeping, monkeypatch):
    monkeypatch.setattr(diagnosis, "choose_kinds", _saying(("creep",)))
    monkeypatch.setattr(creeping.result, "findings", [Finding(0, "creep", "exponential", 0.9, ())])
    monkeypatch.setattr(diagnosis, "_select_effects", None)  # would fail if it was called
    assert _finished(diagnosis._second_opinion(creeping)) is creeping


@pytest.mark.parametrize(("faults", "wear"), [([], UNLIKELY_CONFIDENCE), (["clock"], UNSURE_CONFIDENCE)])
def test_a_doubted_name_without_a_rival_is_less_likely_than_one_of_a_group(faults, wear):
    said = {"creep": UNSURE_CONFIDENCE, "wear": UNSURE_CONFIDENCE, "lag": 0.1, "drift": 0.9}
    findings = [Finding(i, name, "form", confidence, ()) for i, (name, confidence) in enumerate(said.items())]
    words = {"misleading_faults": faults, "contact_is_early": False}
    result = SimpleNamespace(findings=findings, ambiguous=[("creep", "softening")], **words)
    _doubt_without_rivals(result)
    assert {one.name: one.confidence for one in result.findings} == {**said, "wear": wear}
