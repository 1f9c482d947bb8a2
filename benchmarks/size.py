# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on the same sensors with 120,000 and with 12,000 fitted values: is it as sure, and how long does it take?

Environment:

``PALPATE_SIZE_FIRST``  number of the cases, one of each effect; below 1000 are those to develop on (5000)
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ._hidden import mounting

RATE, THINNED = 40.0, 10
"""Samples per second, and every how many of them the small recordings have."""
MOST_SECONDS = 60.0


def run() -> Iterator[dict]:
    """Yield right names and mean confidence of both sizes, and the longest CPU time of the larger one."""
    first = int(os.environ.get("PALPATE_SIZE_FIRST", "5000"))
    found: dict[str, list[tuple[bool, float, float]]] = {"large": [], "small": []}
    for name in mounting.BESIDE:
        case = mounting.draw_in_place(name, first, RATE)
        for size, one in (("large", case), ("small", mounting.thinned(case, THINNED))):
            found[size].append(_examined(size, one))
    small = float(np.mean([right for right, _, _ in found["small"]]))
    for size, entries in found.items():
        right, sure = (float(np.mean([entry[i] for entry in entries])) for i in (0, 1))
        goal = {"goal": small} if size == "large" else {}
        yield {"name": f"size.{size}.right", "value": right, "unit": f"share of {len(entries)}", **goal}
        yield {"name": f"size.{size}.confidence", "value": sure, "unit": "mean"}
    longest = max(seconds for _, _, seconds in found["large"])
    yield {"name": "size.large.longest", "value": longest, "unit": "CPU s", "goal": MOST_SECONDS}


def _examined(size: str, case: mounting.Mounting) -> tuple[bool, float, float]:
    """Whether the one effect alone is named, with which confidence, and in how many CPU seconds."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.confidence import SURE
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    with tempfile.TemporaryDirectory() as folder:
        rig = read_rig(mounting.write(case, Path(folder)))
        began = time.process_time()
        result = run_job(diagnose(rig))
        seconds = time.process_time() - began
    said = {one.name: one.confidence for one in result.findings}
    right = [name for name, confidence in said.items() if confidence >= SURE] == case.answer
    confidence = said.get(case.answer[0], 0.0)
    values = sum(trial.reading.size for trial in rig.of("fit"))
    print(f"{size} {values} values: {case.answer[0]}: {said} {result.verdict} {seconds:.0f} s", file=sys.stderr, flush=True)
    return right, confidence, seconds
