# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run of the hidden-effects benchmark (:mod:`.gap`) and the table of any method's answers (:mod:`._entry`) share.

Which cases there are, what is right of each, and where results are kept.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from palpate.core.gap.selection.rule_numbers import SURE

HOUSE = Path(__file__).resolve().parent.parent
MIX = {"own": 60, "other": 60, "none": 30, "two": 40, "outside": 30, "poor": 20, "third": 100, "three": 50}
"""Cases of each kind in a whole run."""
ROWS = {
    "own": ("one effect, the library's own form", "95 %"),
    "other": ("one effect, another formula", "85 %, ≤ 5 % wrong"),
    "third": ("one effect, a formula on which no rule was set", "92 %, ≤ 2 % wrong"),
    "none": ("nothing, wrong base and coloured noise", "≤ 2 % false alarms"),
    "two": ("two effects", "75 % both, 90 % one and none wrong"),
    "three": ("three effects", "60 % two or three and none wrong"),
    "outside": ("outside the library", "90 % `unexplained`"),
    "poor": ("too poor to tell", "none wrong"),
}
"""What is hidden in each kind of cases, in words, and the aim."""
RIGHT = {"none": "no gap", "outside": "unexplained"}
"""The outcome that is right where it is not that all is named."""


def plan_of(total: int, first: int) -> list[tuple[str, int]]:
    """Return kinds and numbers of that many cases; every kind has at least one."""
    whole = sum(MIX.values())
    counts = {kind: max(1, round(total * share / whole)) for kind, share in MIX.items()}
    return [(kind, first + i) for i in range(max(counts.values())) for kind in MIX if i < counts[kind]]


def fingerprint() -> str:
    """Return a hash of all that a result depends on; how it is shown is not of it."""
    seen = hashlib.sha256()
    for part in ("core/gap", "core/effects", "benchmarks/_hidden"):
        for path in sorted((HOUSE / part).rglob("*.py")):
            if path.parent.name not in ("report", "calibration"):
                seen.update(path.read_bytes())
    return seen.hexdigest()[:12]


def results_in(path: Path) -> list[dict]:
    """Return the results in a file, the last of each case."""
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return list({(r["kind"], r["number"]): r for r in lines}.values())


def sure_names(result: Any) -> set[str]:
    """Return the effects that a diagnosis names for sure."""
    return {one.name for one in result.findings if one.confidence >= SURE}


def outcome(answer: list[str], sure: list[str], verdict: str, ambiguous: bool) -> str:
    """Return one word for what was said: right, part, wrong, ambiguous, unexplained or no gap.

    Of one or two effects all are `right`, of three at least two. `part` is fewer, and nothing wrong beside it.
    """
    if any(name not in answer for name in sure):
        return "wrong"
    if sure:
        return "right" if len(set(sure)) >= min(len(answer), 2) else "part"
    if verdict == "explained" and ambiguous:
        return "ambiguous"
    return "unexplained" if verdict == "explained" else verdict
