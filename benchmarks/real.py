# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on published recordings of real sensors: the family it names, and by how much the gap shrinks.

The recordings are looked for in the folder ``PALPATE_REAL_DATA`` (../shared/data beside the checkout); ``PALPATE_REAL_SETS``
names some of them, and ``PALPATE_REAL_SIZES`` the sizes of what is put on top of them. Rigs, reports and pictures go to
build/real/. benchmarks/RESULTS.md says what each set is known to contain.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ._injected import CHANGES, SIZES, thinned_texels, with_effect, without_found_effects
from ._recordings import LAST, SETS, Recording
from ._tellable import tellable

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


INJECTED: dict[str, Callable[[Path], Recording]] = {
    "adhesive": SETS["adhesive"],
    "tube-by-place": SETS["tube-by-place"],
    "insole": lambda data: thinned_texels(SETS["insole"](data), 12),
}
"""Recordings on top of which known effects are put."""


def run() -> Iterator[dict]:
    """Yield, for each set, the error on held-out recordings with what was found, as a share of that of the refitted base; then
    how many of the effects that were put on top of real recordings are named.
    """
    data = Path(os.environ.get("PALPATE_REAL_DATA", HOUSE.parent / "shared" / "data"))
    if not data.is_dir():
        print(f"No recordings in {data}: name their folder in PALPATE_REAL_DATA.", file=sys.stderr)
        return
    chosen = os.environ.get("PALPATE_REAL_SETS", ",".join([*SETS, "injected"])).split(",")
    for name in chosen:
        if name != "injected":
            yield from _figures_of(name, SETS[name](data))
    if "injected" in chosen:
        yield from _recall_figures(data)


def _figures_of(name: str, recording: Recording) -> Iterator[dict]:
    from palpate.core.gap.report import sentences, summary
    from palpate.core.gap.report.comparison import gap_errors, nrmse

    folder = HOUSE / "build" / "real" / name
    result = _diagnosed(recording, folder)
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


def _recall_figures(data: Path) -> Iterator[dict]:
    """How many of the injected effects are found for sure, and how many others are.

    Once of all of them, once of those whose signature the recordings show, and once of those that can be told (see
    :mod:`._tellable`), which does not depend on what was found.
    """
    groups = ("all", "shown", "told")
    sizes = [float(size) for size in os.environ.get("PALPATE_REAL_SIZES", ",".join(map(str, SIZES))).split(",")]
    outcomes: dict[tuple[float, str], Counter[str]] = {(size, of): Counter() for size in sizes for of in groups}
    alarms = 0
    for name, read in INJECTED.items():
        plain = read(data)
        cleaned = without_found_effects(plain, _diagnosed(plain, HOUSE / "build" / "real" / f"{name}-plain"))
        freed = _diagnosed(cleaned.recording, HOUSE / "build" / "real" / f"{name}-freed")
        alarms += bool(_sure_names(freed))
        print(f"{name}: what was left unexplained is {cleaned.residual_share:.2%} of the range", file=sys.stderr, flush=True)
        for effect in CHANGES:
            for size in sizes:
                changed = with_effect(cleaned, effect, size)
                if changed is None:
                    continue
                result = _diagnosed(changed, HOUSE / "build" / "real" / f"{name}-{effect}")
                outcome, can = _outcome(effect, result), tellable(effect, cleaned, freed, changed)
                for of in groups[: 1 + can.is_shown + (not can.fails)]:
                    outcomes[size, of][outcome] += 1
                said = ", ".join(f"{one.name} {one.confidence}" for one in result.findings) or result.verdict
                note = f" (cannot be told: {can.fails})" if can.fails else ""
                print(f"{name} with {size:g} x {effect}: {outcome}: {said}{note}", file=sys.stderr, flush=True)
    for (size, of), count in outcomes.items():
        for what, key, goal in (("recall", "right", 0.85), ("wrong", "wrong", 0.0)):
            value = count[key] / max(count.total(), 1)
            figure = {"name": f"real.injected.{what}.{of}.{size:g}x", "value": value, "unit": f"share of {count.total()}"}
            yield figure | {"goal": goal}
    yield {"name": "real.injected.false_alarms", "value": alarms, "unit": f"of {len(INJECTED)}", "goal": 0}


def _sure_names(result: Any) -> list[str]:
    from palpate.core.gap.selection.confidence import SURE

    return [one.name for one in result.findings if one.confidence >= SURE]


def _outcome(effect: str, result: Any) -> str:
    """One word: right, wrong (another name for sure), ambiguous or missed."""
    sure = _sure_names(result)
    if sure:
        return "right" if effect in sure and len(sure) == 1 else "wrong"
    return "ambiguous" if any(effect in (one.name, *one.rivals) for one in result.findings) else "missed"


def _diagnosed(recording: Recording, folder: Path) -> Any:
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.gap.selection.findings import Diagnosis
    from palpate.core.jobs.job_runner import run_job

    result = run_job(diagnose(read_rig(recording.write(folder / "rig"))))
    assert isinstance(result, Diagnosis)
    return result
