# SPDX-License-Identifier: GPL-3.0-or-later
"""The registry: it finds the modules of the library, and refuses what is not valid with a sentence."""

import dataclasses
import sys
from contextlib import nullcontext

import numpy as np
import pytest

from palpate.core.effects import library as library_package
from palpate.core.effects.engine.registry import effect, from_dict, kind_of, library, names_where, only_name_where
from palpate.core.effects.engine.specification import SCATTER, TransducerArray
from palpate.core.errors import EffectError

MODULE = """
from palpate.core.effects.engine.specification import Form, Kind, constants_from
from palpate.core.model.parameter import Parameter

def halved(signal, time, values, transducers, seed):
    return 0.5 * signal

KIND = Kind("halving", "Halving", "Halves the reading.", "readout", 1.0, (
    Form("half", "r = f / 2", "No one (2026)", (), memoryless=halved),
), experiment="press")
"""


def test_a_module_of_the_library_is_an_effect(tmp_path, monkeypatch):
    """One file with a KIND is all that a new effect needs."""
    (tmp_path / "halving.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.setattr(library_package, "__path__", [*library_package.__path__, str(tmp_path)])
    library.cache_clear()
    try:
        assert library()["halving"].title == "Halving"
        assert effect("halving").form == "half"
    finally:
        monkeypatch.undo()
        library.cache_clear()
        sys.modules.pop(f"{library_package.__name__}.halving", None)
    assert "halving" not in library()


def test_wrong_words_get_a_hint():
    with pytest.raises(EffectError, match="did you mean 'creep'"):
        effect("crep")
    with pytest.raises(EffectError, match="did you mean 'exponential'"):
        effect("creep", "exponental")
    with pytest.raises(EffectError, match="did you mean 'amount'"):
        effect("creep", amout=0.1)
    with pytest.raises(EffectError, match="one number"):
        effect("creep", amount=[0.1, 0.2])
    with pytest.raises(EffectError, match="needs name"):
        from_dict({"form": "exponential"})
    with pytest.raises(EffectError, match="whole number"):
        from_dict({"name": "creep", "seed": -1})
    with pytest.raises(EffectError, match="give it a number"):
        from_dict({"name": "creep", "amount": "much"})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"known_from": ("unload",)}, "known_from of effect 'halving' is 'unload': choose from unloading"),
        ({"families": ("big",)}, "families of effect 'halving'"),
        ({"found_by": "guess"}, "choose from fit, silent texels"),
        ({"needs": "a clock"}, "needs of effect 'halving'"),
    ],
)
def test_a_kind_states_what_others_know(words, said):
    """A misspelt word would otherwise leave an effect out of a table without a sound."""
    with pytest.raises(EffectError, match=said):
        dataclasses.replace(kind_of("offset"), name="halving", **words)


def test_what_one_effect_alone_states_is_asked_for_by_it():
    assert only_name_where(lambda kind: kind.found_by == SCATTER) == "noise"
    assert names_where(lambda kind: kind.site == "nowhere") == ()
    with pytest.raises(EffectError, match="no effect states"):
        only_name_where(lambda kind: kind.site == "nowhere")
    with pytest.raises(EffectError, match="hysteresis and wear"):
        only_name_where(lambda kind: kind.name in ("wear", "hysteresis"))


def test_effects_at_one_site_have_different_places_in_the_order():
    """With equal numbers the order of two effects would follow the user's stack, so each new kind takes a free number."""
    places = [(kind.site, kind.order) for kind in library().values()]
    assert len(places) == len(set(places))


def test_forms_say_whether_they_couple_texels_and_need_rows():
    """A load on one texel of three reaches another, or none; a form that needs rows refuses texels without them."""
    position = np.array([[0.0, 0.0, 0.0], [3e-3, 0.0, 0.0], [6e-3, 0.0, 0.0]])
    in_rows = TransducerArray(position, np.full(3, 9e-6), np.zeros(3, int), np.arange(3))
    loose = TransducerArray(position, np.full(3, 9e-6))
    for kind in library().values():
        for form in kind.forms:
            if form.memoryless is None or form.random:
                continue
            per_texel = {p.name: tuple([p.default] * 3) for p in form.parameters if p.per_texel}
            values = {**form.neutral, **form.defaults(), **per_texel}
            alone, loaded = (
                form.memoryless(np.array([[0.0, x, 0.0]] * 2), np.zeros(2), values, in_rows, 0) for x in (0.0, 0.05)
            )
            is_coupled = np.abs(loaded - alone)[:, [0, 2]].max() > 1e-9
            assert form.couples == is_coupled or form.needs == "axes", (kind.name, form.name)
            with pytest.raises(EffectError, match="rows") if form.needs == "rows" else nullcontext():
                form.memoryless(np.zeros((2, 3)), np.zeros(2), values, loose, 0)
