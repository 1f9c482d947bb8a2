# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on sensors that are not where their rig says, alone and beside one other effect (``_hidden.mounting``).

Environment:

``PALPATE_MOUNTING_CASES``  how many cases of each kind (7)
``PALPATE_MOUNTING_FIRST``  number of the first; below 1000 are those to develop on (5000)
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ._hidden import mounting
from .gap import outcome


def run() -> Iterator[dict]:
    """Yield for each kind the share of cases that are named rightly, of those named wrongly, and of check errors that rise."""
    count, first = (int(os.environ.get(f"PALPATE_MOUNTING_{key}", value)) for key, value in (("CASES", "7"), ("FIRST", "5000")))
    for kind in mounting.KINDS:
        found = [_examined(kind, number) for number in range(first, first + count)]
        for what, goal in (("right", 0.9), ("wrong", 0.0)):
            share = float(np.mean([said == what for said, _ in found]))
            yield {"name": f"mounting.{kind}.{what}", "value": share, "unit": f"share of {count}", "goal": goal}
        rises = float(np.mean([rose for _, rose in found]))
        yield {"name": f"mounting.{kind}.named_with_a_check_error_that_rose", "value": rises, "unit": "share", "goal": 0.0}


def _examined(kind: str, number: int) -> tuple[str, bool]:
    """One word for what was said of a case, and whether something was named although the check error rose."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.report.comparison import gap_errors
    from palpate.core.gap.selection.confidence import SURE
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    case = mounting.draw(kind, number)
    with tempfile.TemporaryDirectory() as folder:
        result = run_job(diagnose(read_rig(mounting.write(case, Path(folder)))))
    errors = gap_errors(result)
    sure = [one.name for one in result.findings if one.confidence >= SURE]
    said = outcome(case.answer, sure, result.verdict, bool(result.ambiguous))
    before, after = errors.base["check"] or 0.0, errors.amended["check"] or 0.0
    print(
        f"{kind} {number}: {' + '.join(case.answer)}: {said}: {' + '.join(sure) or result.verdict}", file=sys.stderr, flush=True
    )
    return said, bool(sure or result.verdict == "explained") and after > before
