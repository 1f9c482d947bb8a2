# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/effects.md says what the library is."""

import effects_page
import pytest

from palpate.core.effects.engine.registry import library
from palpate.core.effects.engine.specification import DRAWINGS


def test_the_page_is_that_of_this_library():
    """Run tools/effects_page.py after a change in core/effects."""
    assert effects_page.PAGE.read_text(encoding="utf-8") == effects_page.page()


@pytest.mark.parametrize("kind", library().values(), ids=lambda kind: kind.name)
def test_an_effect_fits_on_a_screen_and_has_all_that_a_file_needs(kind):
    """A screen is about 40 lines of text at 100 characters; the longest section, hysteresis, has 21 lines."""
    section = effects_page.section(kind)
    assert sum(1 + len(line) // 100 for line in section.splitlines()) <= 40
    assert kind.experiment in section and all(f"**{form.name}**" in section for form in kind.forms)
    assert all(f"`{p.name}={p.default:g}`" in section and p.text in section for form in kind.forms for p in form.parameters)
    assert all(form.reference.split(",")[0].split(" (")[0] in section for form in kind.forms)


def test_every_experiment_can_be_drawn():
    assert set(effects_page.DRAWINGS) == set(DRAWINGS)


def test_the_picture_can_be_drawn(tmp_path):
    effects_page.picture(tmp_path / "effects.png")
    assert (tmp_path / "effects.png").stat().st_size > 100_000
