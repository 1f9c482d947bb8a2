# SPDX-License-Identifier: GPL-3.0-or-later
"""Roads through the extension in a real Blender window; each is a file in roads/."""

from __future__ import annotations

import pytest


def test_window(play_road):
    result = play_road("window")
    assert result["values"]["location"][0] == pytest.approx(2.5)
    assert len(result["screenshots"]) == 4


def test_sensor(play_road):
    result = play_road("sensor")
    assert result["values"]["k"] == pytest.approx(1234.5)
    assert result["values"]["k after undo"] != pytest.approx(1234.5)
