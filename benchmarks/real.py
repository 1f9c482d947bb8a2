# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on published recordings of real sensors: the family it names, and by how much the gap shrinks.

The recordings are looked for in the folder ``PALPATE_REAL_DATA`` (../shared/data beside the checkout); ``PALPATE_REAL_SETS``
names some of them. Rigs, reports and pictures go to build/real/. benchmarks/RESULTS.md says what each set is known to contain.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ._recordings import LAST, SETS, Recording

HOUSE = Path(__file__).resolve().parent.parent
GOALS = {
    "insole-counts": 0.55,
    "insole": 0.55,
    "tube": 0.35,
    "tube-by-place": 0.35,
    "adhesive": 0.5,
    "foam": None,
    "brake": 0.4,
}
"""Gap on the held-out recordings after, as a share of that before."""


def run() -> Iterator[dict]:
    """Yield, for each set, the error on held-out recordings with what was found, as a share of that of the refitted base."""
    data = Path(os.environ.get("PALPATE_REAL_DATA", HOUSE.parent / "shared" / "data"))
    if not data.is_dir():
        print(f"No recordings in {data}: name their folder in PALPATE_REAL_DATA.", file=sys.stderr)
        return
    for name in os.environ.get("PALPATE_REAL_SETS", ",".join(SETS)).split(","):
        yield from _figures_of(name, SETS[name](data))


def _figures_of(name: str, recording: Recording) -> Iterator[dict]:
    from palpate.core.gap.report import sentences, summary
    from palpate.core.gap.report.comparison import gap_errors, nrmse

    folder = HOUSE / "build" / "real" / name
    result = diagnosed(recording, folder)
    errors = gap_errors(result)
    for _ in summary.write_report(result, folder, errors):
        pass
    print(f"{name}: {sentences.headline(result, errors)}", file=sys.stderr, flush=True)
    found = "+".join(one.name for one in result.findings) or result.verdict.replace(" ", "_")
    last = LAST.get(name, ())
    parts = {
        "fit": result.of("fit"),
        "check": [p for p in result.of("check") if p.trial.name not in last],
        "last": [p for p in result.of("check") if p.trial.name in last],
    }
    for use, trials in parts.items():
        if trials:
            before, after = (nrmse(trials, one.model, result.full) for one in (result.base, result.best))
            print(f"{name}, {use}: {before:.2%} -> {after:.2%} of the range", file=sys.stderr, flush=True)
            figure = {"name": f"real.{name}.{found}.{use}", "value": after / before, "unit": "gap after / before"}
            yield figure | ({"goal": GOALS[name]} if use != "fit" and GOALS[name] else {})
    yield from _friction_figures(name, result)


def _friction_figures(name: str, result: Any) -> Iterator[dict]:
    """Error with the base model's own friction, as a share of the error without: friction is in every base model."""
    from palpate.core.gap.report.comparison import frictionless_nrmse, nrmse

    for use, without in (frictionless_nrmse(result) or {}).items():
        own = nrmse(result.of(use), result.base.model, result.full)
        figure = {"name": f"real.{name}.friction_of_the_base.{use}", "value": own / without, "unit": "gap with / without"}
        yield figure | ({"goal": GOALS[name]} if use == "check" else {})


def diagnosed(recording: Recording, folder: Path) -> Any:
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.gap.selection.findings import Diagnosis
    from palpate.core.jobs import run_job

    result = run_job(diagnose(read_rig(recording.write(folder / "rig"))))
    assert isinstance(result, Diagnosis)
    return result
