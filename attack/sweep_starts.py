# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts how often each run of a study is begun, from outside: Python reads a file of ours at its start.

Only the processes that compute runs are concerned. Each appends a line to a file when a run begins.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from pathlib import Path

VARIABLE = "PALPATE_ATTACK_STARTS"
HOOK = """
import os, sys
if "palpate.sweep.child" in sys.orig_argv and os.environ.get("{variable}"):
    import json
    from palpate.core.study import variation
    original = variation.varied_scenario
    def noted(scenario, values, *rest):
        line = json.dumps(values, sort_keys=True) + "\\n"
        handle = os.open(os.environ["{variable}"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        os.write(handle, line.encode())
        os.close(handle)
        return original(scenario, values, *rest)
    variation.varied_scenario = noted
"""


def environment(folder: Path) -> dict[str, str]:
    """Return the environment for commands whose runs are counted into a file of `folder`."""
    hook = folder / "hook"
    hook.mkdir(parents=True, exist_ok=True)
    (hook / "sitecustomize.py").write_text(HOOK.format(variable=VARIABLE), encoding="utf-8")
    paths = [str(hook), *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), VARIABLE: str(folder / "starts")}


def count_starts(folder: Path) -> Counter[str]:
    """Return how often each run was begun, by its values."""
    file = folder / "starts"
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return Counter(json.dumps(json.loads(line), sort_keys=True) for line in lines)
