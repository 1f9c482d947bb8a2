# SPDX-License-Identifier: GPL-3.0-or-later
"""The hidden-effect benchmark of ``palpate gap`` as the job of a study: a case for each run, on as many machines as there are.

A run draws a case, has it diagnosed from its files, and holds what is said against what was hidden. It needs a checkout, whose
benchmarks it calls. `first` is the number of the first case of each kind::

    python docs/sample-study/hidden_effects.py [CASES FIRST] > docs/sample-study/hidden-effects.toml
    palpate sweep docs/sample-study/hidden-effects.toml --out hidden --allow-scripts
    PALPATE_GAP_RESULTS=hidden python -m benchmarks gap
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from palpate.benchmarks import _rows, gap

CASES, FIRST = 78, 5000
"""Those of the benchmark where nobody says more."""
OUTCOMES = ("right", "part", "wrong", "ambiguous", "unexplained", "no gap", "failed")
STUDY = """# What palpate gap names of effects that are hidden, as a study; hidden_effects.py has written this file and runs it:
#     palpate sweep docs/sample-study/hidden-effects.toml --out hidden --allow-scripts
#     PALPATE_GAP_RESULTS=hidden python -m benchmarks gap
format = "palpate-sweep/1"
name = "hidden effects"
job = "hidden_effects.py"
design = "grid"
run_limit = 1800

[vary]
case = {{ choice = [
{cases}
] }}
"""


def fingerprint() -> str:
    """Return what changes with the workflow and the generator of cases."""
    return _rows.fingerprint()


def run(values: dict[str, Any], folder: Path) -> dict[str, float | None]:
    """Diagnose a case, write all that is said into `case.json`, and return how right it is."""
    kind, number = values["case"].split()
    found = gap.examine(kind, int(number))
    (folder / _rows.CASE_NAME).write_text(json.dumps(found) + "\n", encoding="utf-8")
    outcomes = {word: float(found["outcome"] == word) for word in ("right", "part", "wrong", "ambiguous", "unexplained")}
    return {
        **outcomes,
        "no_gap": float(found["outcome"] == "no gap"),
        "named": float(len(found["sure"])),
        "closed": found["closed"],
        f"right.{kind}": float(found["outcome"] == _rows.RIGHT.get(kind, "right")),  # the mean of each row in the report
        f"wrong.{kind}": outcomes["wrong"],
    }


def study(cases: int = CASES, first: int = FIRST) -> str:
    """Return the file of the study of some cases."""
    names = [f'    "{kind} {number}",' for kind, number in _rows.plan_of(cases, first)]
    return STUDY.format(cases="\n".join(names))


if __name__ == "__main__":
    print(study(*map(int, sys.argv[1:])), end="")
