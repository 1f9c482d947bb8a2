# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways of deciding which effects are named, on the same few cases, whose numbers stand here since before any of them was run.

Cases are those of ``_hidden``: effects in formulas that share no code with the library. Every outcome goes to
build/one_method/WAY.jsonl, one line a case, and a run goes on where the last one stopped.

Environment:

``PALPATE_ONE_METHOD``       name of the way, which is the name of its file ("now")
``PALPATE_ONE_METHOD_ROWS``  rows to run, as "one two" (all)
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from . import gap
from ._hidden import cases, sessions
from ._rows import HOUSE

FROZEN: dict[str, tuple[tuple[str, int], ...]] = {
    "one": tuple((kind, 52000 + 5 * i) for i in range(4) for kind in ("other", "third")),
    "two": tuple(("two", 52000 + i) for i in range(8)),
    "sessions": (
        ("wear session", 52000),
        ("wear own", 52001),
        ("drift session", 52000),
        ("drift one", 52001),
        ("softening session", 52000),
        ("softening own", 52001),
        ("warm-up session", 52000),
        ("healthy own", 52001),
    ),
    "nothing": tuple(("none", 52000 + i) for i in range(8)),
    "outside": tuple(("outside", 52000 + 3 * i) for i in range(8)),
}
"""Kinds and numbers of the cases of each row."""


def run() -> Iterator[dict]:
    """Yield for each row the shares that are right and wrong, and the CPU seconds of a case."""
    way = os.environ.get("PALPATE_ONE_METHOD", "now")
    rows = os.environ.get("PALPATE_ONE_METHOD_ROWS", " ".join(FROZEN)).split()
    folder = HOUSE / "build" / "one_method"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{way}.jsonl"
    done = (
        {(r["kind"], r["number"]): r for r in map(json.loads, path.read_text("utf-8").splitlines())} if path.is_file() else {}
    )
    for row in rows:
        found = []
        for kind, number in FROZEN[row]:
            if (kind, number) not in done:
                done[kind, number] = examined(kind, number)
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(done[kind, number]) + "\n")
                print(row, json.dumps(done[kind, number]), file=sys.stderr, flush=True)
            found.append(done[kind, number])
        counts = Counter(r["outcome"] for r in found)
        print(f"{way}: {row}: {dict(counts)}", file=sys.stderr, flush=True)
        right = {"nothing": "no gap", "outside": "unexplained"}.get(row, "right")
        for what, word in (("right", right), ("wrong", "wrong")):
            yield {
                "name": f"one_method.{way}.{row}.{what}",
                "value": counts[word] / len(found),
                "unit": f"share of {len(found)}",
            }
        seconds = sum(r["cpu_seconds"] for r in found) / len(found)
        yield {"name": f"one_method.{way}.{row}.cpu", "value": seconds, "unit": "s a case"}


def examined(kind: str, number: int) -> dict[str, Any]:
    """What is said of a case, and how right it is."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    with tempfile.TemporaryDirectory() as folder:
        case: Any
        if " " in kind:
            case = sessions.draw(*kind.split(), number)
            path = sessions.write(case, Path(folder))
        else:
            case = cases.draw(kind, number)
            path = cases.write(case, Path(folder))
        rig, began = read_rig(path), time.process_time()
        result = run_job(diagnose(rig, by_kinds="kinds" in os.environ.get("PALPATE_ONE_METHOD", "now")))
        seconds = time.process_time() - began
    said = [[one.name, one.form, one.confidence] for one in result.findings]
    if " " not in kind:
        scored = gap.score(case, result)
        judged = {"outcome": scored["outcome"], "closed": scored["closed"]}
    else:
        said += [[result.between.name, "between", result.between.confidence]] if result.between is not None else []
        named = {name for name, _, confidence in said if confidence >= 0.5}
        judged = {"outcome": sessions.outcome(case.answer, named, result.verdict, bool(result.ambiguous))}
    entry = {"kind": kind, "number": number, "answer": list(case.answer), **judged, "said": said, "verdict": result.verdict}
    return entry | {"ambiguous": [list(group) for group in result.ambiguous], "cpu_seconds": round(seconds, 1)}
