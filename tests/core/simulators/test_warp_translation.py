# SPDX-License-Identifier: GPL-3.0-or-later
"""Laws of effects as functions of Warp, and what cannot be translated; test_warp_sensors.py compares those of contact."""

from __future__ import annotations

import math

import numpy as np
import pytest

from palpate.core.effects.engine.registry import complete_values, effect, form_of, library
from palpate.core.effects.engine.specification import TexelInput
from palpate.core.simulators.warp.translation import Translation, TranslationError

warp = pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")


def stand_in(texel: TexelInput, constants: np.ndarray, state: np.ndarray, commit: bool) -> tuple[float, float]:
    """Stand for a law."""
    return texel.force, texel.slope


def over_time(i: int, x: np.ndarray, constants: np.ndarray, state: np.ndarray, out: np.ndarray) -> None:
    """Bring one texel through all steps of a signal (t, 4), and evaluate each step before it is taken."""
    for step in range(x.shape[0]):
        texel = TexelInput(x[step, 0], x[step, 1], x[step, 2], x[step, 3])
        out[step, 0], out[step, 1] = stand_in(texel, constants, state, False)
        out[step, 2], out[step, 3] = stand_in(texel, constants, state, True)


LAWS = [(kind.name, form.name) for kind in library().values() for form in kind.forms if form.law is not None]


@pytest.mark.long("Warp compiles every law of the library, one module each")
@pytest.mark.parametrize(("name", "form"), LAWS)
def test_laws_of_effects_have_the_numbers_of_their_source(name, form):
    """To 1e-14 of the largest: a compiler may call another exp or pow than Python."""
    chosen = form_of(name, form)
    draw, steps = np.random.default_rng(2), 60
    x = draw.random((steps, 4)) * np.array([0.3, 200.0, 1e-3, 1e-4])
    x[::7, :] = 0.0  # let go
    constants = chosen.constants(complete_values(effect(name, form)), np.array([0.01]))[0]
    expected, state = np.zeros((steps, 4)), np.zeros(max(chosen.state_size, 1))
    for step in range(steps):
        texel = TexelInput(*x[step])
        expected[step, :2] = chosen.law(texel, constants, state, False)
        expected[step, 2:] = chosen.law(texel, constants, state, True)
    label = f"test_{name}_{form}".replace("-", "_")
    translation = Translation(warp, warp.float64, label, {"stand_in": chosen.law})
    arrays = [translation.array(v, "cpu") for v in (x, constants, np.zeros_like(state), np.zeros((steps, 4)))]
    warp.launch(translation.kernel(over_time, 1), dim=1, inputs=arrays, device="cpu")
    assert arrays[3].numpy() == pytest.approx(expected, abs=1e-14 * np.abs(expected).max(), rel=1e-13)
    assert arrays[2].numpy() == pytest.approx(state, abs=1e-14 * np.abs(state).max(), rel=1e-13)


def test_what_has_no_translation_is_named():
    def sorts(x: np.ndarray) -> float:
        with math:
            return 0.0

    def counts(x: object) -> float:
        return 0.0

    def gammas(x: float) -> float:
        return math.gamma(x)

    translation = Translation(warp, warp.float64, "test_refused")
    for function, words in ((sorts, "'with math"), (counts, "annotated 'object'"), (gammas, "no function 'gamma'")):
        with pytest.raises(TranslationError, match=words):
            translation.function(function)
