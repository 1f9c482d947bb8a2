# SPDX-License-Identifier: GPL-3.0-or-later
"""The memory of a window in which one works: five rounds by default, an hour with ``--minutes 60``."""

from __future__ import annotations

MOST_GROWTH = 100.0
"""MB that Blender may hold more after a round than after the first like it. In an hour of Blender 4.3 it was 32 in Solid
view and 43 in Material Preview (docs/speed.md)."""


def test_long_use(play_road, real_blender, request):
    minutes = request.config.getoption("--minutes")
    (real_blender.work / "minutes.txt").write_text(str(minutes))
    rounds = play_road("long_use", timeout=120.0 * minutes + 1800.0)["values"]["rounds"]
    for shading, first in (("MATERIAL", 1), ("SOLID", 2)):  # Material Preview takes over 1 GB when it is first shown
        held = [row["MB"] for row in rounds[first:] if row["shading"] == shading]
        assert len(held) > 1
        assert max(held) - held[0] < MOST_GROWTH, f"{shading}: {held}"
