# SPDX-License-Identifier: GPL-3.0-or-later
"""The memory of a window in which one works: two minutes by default, an hour with ``--minutes 60``."""

from __future__ import annotations

import statistics

GROWTH = 60.0
"""MB per hour that are taken for none; what was measured is in docs/speed.md."""
ENOUGH = 30.0
"""Minutes from which growth is judged: Blender keeps 32 steps for undo, which fill up at first."""


def test_long_use(play_road, real_blender, request):
    minutes = request.config.getoption("--minutes")
    (real_blender.work / "minutes.txt").write_text(str(minutes))
    rounds = play_road("long_use", timeout=120.0 * minutes + 900.0)["values"]["rounds"]
    filled = max(row["MB"] for row in rounds[:2])  # the second round is the first in Material Preview, which takes over 1 GB
    assert max(row["MB"] for row in rounds) < filled + 300.0
    if minutes >= ENOUGH:
        third = len(rounds) // 3
        early, late = (statistics.fmean(row["MB"] for row in part) for part in (rounds[third : 2 * third], rounds[2 * third :]))
        assert late - early < GROWTH * minutes / 60.0 / 3.0, f"{early:.0f} MB in the second third, {late:.0f} MB in the last"
