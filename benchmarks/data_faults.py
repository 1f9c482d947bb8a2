# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults that loggers and their users put into recordings (``_faulty``): how many are found, how many healthy rigs are accused.

PALPATE_FAULT_CASES cases of each fault in each family are drawn (default 3), and as many healthy ones as there are faulty ones.
The rules of `core/gap/data_faults` were set on the family "gel", numbers below 1000; the other families are judged.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ._faulty.faults import FaultyCase, draw, kinds_for
from ._faulty.sensors import FAMILIES

SETTING = "gel"
FIRST = 1000
"""Number of the first case that is judged."""


def run() -> Iterator[dict]:
    """Yield shares of faults found and of healthy rigs accused, by family, with each wrong case on stderr."""
    count = int(os.environ.get("PALPATE_FAULT_CASES", "3"))
    first = int(os.environ.get("PALPATE_FAULT_FIRST", str(FIRST)))
    for family in FAMILIES:
        right = total = 0
        for kind in kinds_for(family):
            hits = sum(_judged(family, kind, first + number) for number in range(count))
            right, total = right + hits, total + count
            yield {"name": f"data faults, {family}: {kind} found", "value": hits / count, "unit": "share"}
        yield {"name": f"data faults, {family}: all found", "value": right / total, "unit": "share", "goal": 0.85}
        accused = sum(not _judged(family, "", first + number) for number in range(total))
        yield {"name": f"data faults, {family}: healthy rigs accused of {total}", "value": accused, "unit": "rigs", "goal": 0}


def _judged(family: str, kind: str, number: int) -> bool:
    """Whether what is said of a case is right: its kind and its recordings, or nothing."""
    from palpate.core.gap.data_faults.search import find_faults
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.forward.stimulus import stimulus_of

    with tempfile.TemporaryDirectory() as folder:
        case = draw(family, kind, number, Path(folder))
        rig = read_rig(case.path)
        faults = find_faults(rig, [stimulus_of(trial, rig) for trial in rig.trials])
    right = is_right(case, [(fault.kind, fault.trials) for fault in faults])
    if not right:
        print(family, kind or "healthy", number, case.effect, case.where, [fault.sentence for fault in faults], file=sys.stderr)
    return right


def is_right(case: FaultyCase, said: list[tuple[str, tuple[str, ...]]]) -> bool:
    """Return whether exactly the fault of a case is said (kind, recordings), or nothing of a healthy one."""
    if not case.kind:
        return not said
    recordings = {name for kind, names in said for name in names if kind == case.kind}
    return {kind for kind, _ in said} == {case.kind} and recordings == set(case.where)
