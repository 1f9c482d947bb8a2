# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on hidden effects under coloured noise, with cells missing, on a mesh, of friction, in pairs (``_hidden``).

Each case is a case of the group ``gap`` under one more condition. Results are kept in build/gap/, one line a case, and a run
goes on where the last one stopped, as long as neither the workflow nor the generator has changed. The table goes to
build/gap/conditions.md.

Environment:

``PALPATE_CONDITIONS_CASES``  how many cases of each condition (8)
``PALPATE_CONDITIONS_FIRST``  number of the first; below 1000 are those to develop on, from 5000 on those that nobody looks at
                              before the figures are drawn (5000)
``PALPATE_CONDITIONS_ONLY``   words: the conditions to run, such as "coloured mesh" (all)
``PALPATE_GAP_PROCESSES``     how many cases at a time (2)
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from . import gap
from ._hidden import conditions
from ._rows import RIGHT, fingerprint

WORDS = {"coloured": "coloured noise", "missing": "cells missing", "mesh": "on a mesh", "friction": "friction, or nothing"}
WORDS |= {"pairs": "two effects, third family"}
"""What a row is called in the table."""


def run() -> Iterator[dict]:
    """Yield for each condition the shares of cases that are named rightly and wrongly; the table goes to stderr and a file."""
    count, first = (
        int(os.environ.get(f"PALPATE_CONDITIONS_{key}", value)) for key, value in (("CASES", "8"), ("FIRST", "5000"))
    )
    chosen = os.environ.get("PALPATE_CONDITIONS_ONLY", "").split() or conditions.CONDITIONS
    if unknown := set(chosen) - set(conditions.CONDITIONS):
        raise ValueError(f"PALPATE_CONDITIONS_ONLY has {', '.join(sorted(unknown))}: write {' '.join(conditions.CONDITIONS)}")
    plan = [(condition, number) for number in range(first, first + count) for condition in chosen]
    path = gap.results_folder() / f"conditions-{fingerprint()}.jsonl"
    done = gap.done_in(path)
    done |= gap.carried_out(examine, [entry for entry in plan if entry not in done], path)
    results = [done[entry] for entry in plan]
    rows = table(results)
    print(rows, file=sys.stderr)
    (gap.results_folder() / "conditions.md").write_text(rows + "\n", encoding="utf-8")
    yield from figures(results)


def examine(condition: str, number: int) -> dict[str, Any]:
    """Draw a case of a condition, have it diagnosed from its files, and hold the outcome against the answer.

    Returns
    -------
    dict
        As of :func:`gap.examine`, whose kind becomes the `formula`; `kind` is the condition.
    """
    entry = gap.examined(conditions.draw(condition, number), partial(conditions.write, condition))
    return entry | {"kind": condition, "formula": entry["kind"], "way": conditions.way_of(condition, number)}


def is_right(result: dict) -> bool:
    """Return whether all that is hidden was named, or "no gap" said where nothing is."""
    return bool(result["outcome"] == RIGHT.get(result["formula"], "right"))


def figures(results: list[dict]) -> Iterator[dict]:
    """Yield the shares of right and wrong cases of each condition."""
    for condition, here in _by_condition(results):
        for what, share in (("right", np.mean([is_right(r) for r in here])), ("wrong", _share_wrong(here))):
            yield {"name": f"conditions.{condition}.{what}", "value": float(share), "unit": f"share of {len(here)}"}


def _share_wrong(results: list[dict]) -> float:
    return float(np.mean([r["outcome"] == "wrong" for r in results]))


def _by_condition(results: list[dict]) -> Iterator[tuple[str, list[dict]]]:
    for condition in conditions.CONDITIONS:
        here = [r for r in results if r["kind"] == condition]
        if here:
            yield condition, here


def table(results: list[dict]) -> str:
    """Return outcomes, those that are not right with what was hidden and what else was said, in Markdown."""
    text = ["| condition | cases | right | wrong | not right |", "| --- | ---: | ---: | ---: | --- |"]
    for condition, here in _by_condition(results):
        right, wrong = sum(map(is_right, here)), sum(r["outcome"] == "wrong" for r in here)
        missed = Counter(_said(r) for r in here if not is_right(r))
        words = ", ".join(f"{said} {count}" if count > 1 else said for said, count in missed.most_common())
        text.append(f"| {WORDS[condition]} | {len(here)} | {right} | {wrong} | {words} |")
    return "\n".join(text)


def _said(result: dict) -> str:
    hidden = " + ".join(result["answer"]) or "nothing"
    way = f" ({result['way']})" if result["way"] else ""
    return f"{hidden}{way}: {' + '.join(result['sure']) or result['outcome']}"
