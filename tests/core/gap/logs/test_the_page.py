# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/logs.md shows what the command writes, and names the units and limits that it has."""

from __future__ import annotations

import re

import numpy as np
import pytest

from palpate.core.gap.dataset import column_names
from palpate.core.gap.logs import clock_alignment, column_behaviour, column_meaning, log_file, new_rig
from palpate.core.gap.logs.proposal import propose


@pytest.fixture(scope="module")
def page(repository):
    return (repository / "docs" / "logs.md").read_text(encoding="utf-8")


def test_the_template_of_the_page_is_the_one_that_is_written(page, tmp_path):
    time = np.arange(0, 600) * 10.0
    rows = [f"{t},{1.0 - np.cos(t / 400):.4f},{i},{i},{i},{i}" for i, t in enumerate(time)]
    for i in range(3):
        (tmp_path / f"press_{i}.csv").write_text("t_ms,depth (mm),R1,R2,R3,R4\n" + "\n".join(rows))
    text = propose([log_file.read_log(tmp_path / f"press_{i}.csv") for i in range(3)]).text
    (shown,) = re.findall(r'```toml\n(format = "palpate-log-answers.*?)# …\n```', page, re.DOTALL)
    written = [line for line in text.splitlines() if line and not line.startswith("#")]
    lines = [line for line in shown.splitlines() if line]
    assert lines == written[: len(lines)] and len(lines) > 10


def test_units_endings_and_limits_are_those_of_the_source(page):
    for ending in log_file.READERS:
        assert ending in page
    for unit in ("s", "m", "N"):
        for name in set(column_names.LOG_UNITS[unit]) - {"µs", "µm", "inch", "gf", "kgf"}:
            assert re.search(rf"[` ]{name}[` ;]", page), name
    assert f"below {clock_alignment.LEAST_CORRELATION}" in page and f"({clock_alignment.MOST_RIVAL} of" in page
    assert f"more than {new_rig.LARGEST_MOTION} m" in page and f"more than {column_meaning.BY_SIZE['m'][0][0]} is" in page
    assert "six times" in page and column_behaviour.LEAST_CONTACT == 6.0
