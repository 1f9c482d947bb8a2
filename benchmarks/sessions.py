# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on sensors that wear, drift, soften or warm up from recording to recording (``_hidden.sessions``).

Each of them, and healthy ones, as a session of the rig, as files that each begin at zero, and as files of one clock. Without a
session only "between recordings" can be said.

Environment:

``PALPATE_SESSIONS_CASES``  how many cases of each kind and clock (2)
``PALPATE_SESSIONS_FIRST``  number of the first; below 1000 are those to develop on (5000)
``PALPATE_SESSIONS_ONLY``   words, of which a case's kind or clock must be one, such as "wear own"
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ._hidden import sessions
from ._rows import sure_names


def run() -> Iterator[dict]:
    """Yield for each kind the share of cases that are named rightly, of those named wrongly, and of check errors that rise."""
    count, first = (int(os.environ.get(f"PALPATE_SESSIONS_{key}", value)) for key, value in (("CASES", "2"), ("FIRST", "5000")))
    only = os.environ.get("PALPATE_SESSIONS_ONLY", "").split()
    plan = [(kind, clock) for kind in sessions.KINDS for clock in sessions.CLOCKS]
    plan = [pair for pair in plan if all(word in pair for word in only)]
    found = {pair: [_examined(*pair, number) for number in range(first, first + count)] for pair in plan}
    everything = [one for several in found.values() for one in several]
    for pair, several in [*found.items(), (("all",), everything)]:
        for what, goal in (("right", 0.8), ("wrong", 0.0)):
            share = float(np.mean([said == what for said, _ in several]))
            yield {
                "name": f"sessions.{'.'.join(pair)}.{what}",
                "value": share,
                "unit": f"share of {len(several)}",
                "goal": goal,
            }
    rises = float(np.mean([rose for _, rose in everything]))
    yield {"name": "sessions.all.named_with_a_check_error_that_rose", "value": rises, "unit": "share", "goal": 0.0}


def outcome(answer: tuple[str, ...], named: set[str], verdict: str, ambiguous: bool) -> str:
    """Return one word for what was said: right, wrong, ambiguous, or the verdict. Any of the answer's names is right."""
    if named - set(answer):
        return "wrong"
    if named or (not answer and verdict == "no gap"):
        return "right"
    return "ambiguous" if ambiguous else "unnamed" if verdict == "explained" else verdict


def _examined(kind: str, clock: str, number: int) -> tuple[str, bool]:
    """One word for what was said of a case, and whether something was named although the check error rose."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.report.comparison import gap_errors
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs import run_job

    case, began = sessions.draw(kind, clock, number), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        result = run_job(diagnose(read_rig(sessions.write(case, Path(folder)))))
    errors = gap_errors(result)
    named = sure_names(result)
    said = outcome(case.answer, named, result.verdict, bool(result.ambiguous))
    before, after = errors.base["check"] or 0.0, errors.amended["check"] or 0.0
    words = [f"{one.name}/{one.form} {one.confidence}" for one in result.findings]
    words += [f"recordings differ {result.between.confidence}"] if result.between is not None else []
    line = (
        f"{kind} {clock} {number}: {said}: {', '.join(words) or 'nothing'}; {result.verdict}; check {before:.4f} to {after:.4f}"
    )
    print(f"{line} ({time.process_time() - began:.0f} s)", file=sys.stderr, flush=True)
    return said, bool(named or result.verdict == "explained") and after > before
