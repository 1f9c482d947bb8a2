# SPDX-License-Identifier: GPL-3.0-or-later
"""The memory of a window in which one works: two minutes here, an hour with ``--long``."""

from __future__ import annotations

import statistics

GROWTH = 60.0
"""MB per hour that are taken for none. Measured in an hour of Blender 4.3 and given in docs/speed.md."""


def test_long_use(play_road, real_blender, request):
    is_long = request.config.getoption("--long")
    minutes = 60.0 if is_long else 2.0
    (real_blender.work / "minutes.txt").write_text(str(minutes))
    rounds = play_road("long_use", timeout=120.0 * minutes + 900.0)["values"]["rounds"]
    third = len(rounds) // 3
    if not is_long:
        assert rounds[-1]["MB"] < rounds[0]["MB"] + 500.0
        return
    early, late = (statistics.fmean(row["MB"] for row in part) for part in (rounds[third : 2 * third], rounds[2 * third :]))
    assert late - early < GROWTH / 3, f"{early:.0f} MB in the second third, {late:.0f} MB in the last"
