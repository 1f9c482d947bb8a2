# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/effects.md says what the library is."""

import effects_page

from palpate.core.effects.engine.declarations import DRAWINGS


def test_the_page_is_that_of_this_library():
    """Run tools/effects_page.py after a change in core/effects."""
    assert effects_page.PAGE.read_text(encoding="utf-8") == effects_page.page()


def test_every_experiment_can_be_drawn():
    assert set(effects_page.DRAWINGS) == set(DRAWINGS)


def test_the_picture_can_be_drawn(tmp_path):
    effects_page.picture(tmp_path / "effects.png")
    assert (tmp_path / "effects.png").stat().st_size > 100_000
