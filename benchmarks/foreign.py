# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on what is not ours: recordings of other people's sensors, and rigs of other people's generators.

    python -m benchmarks foreign
    python -m benchmarks foreign --write DIR
    python -m benchmarks foreign --rigs DIR

The first makes the table of docs/real-data.md: recordings under an open licence beside a model by hand. They are looked for in
the folder ``PALPATE_REAL_DATA`` (../shared/data beside the checkout); ``PALPATE_FOREIGN_SETS`` names some sets.
``PALPATE_FOREIGN_BY_HAND=1`` fits the models by hand alone, which takes seconds. ``--write`` writes the rigs and the errors of
the models by hand, from which ``palpate gap-table`` makes the same table.

``--rigs`` diagnoses each ``CASE/rig.toml`` of a folder that a generator of somebody else has written, and holds the answers
against its ``answers.json``: ``{CASE: {"effects": [names], "accept": [[names], …]}}``. No names are right where nothing is
hidden, and so is any set of ``accept``. Effects that the library does not have are right as `unexplained`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from palpate.core.effects.engine.registry import library
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.report import gap_table
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

from ._foreign import FOREIGN
from ._handmade import predict_by_hand, responses
from ._recordings import Recording
from ._rows import HOUSE, outcome, sure_names
from .gap import carried_out

GOAL, MEDIAN_GOAL = 1.3, 1.1
"""Largest error on the check recordings of a set, and the median of all, in units of that of the model by hand."""
SYNONYMS = {"warmup": "warm-up", "softening": "wear"}
"""Words of generators for effects of the library; softening and wear count as one there, as both lower a gain with use."""


def run() -> Iterator[dict]:
    """Yield, for each set, the error on check recordings by the amended model over that by the model made by hand."""
    rows = []
    for name, recording, by_hand in _sets():
        yield {"name": f"foreign.{name}.by_hand", "value": by_hand, "unit": "of the range"}
        if os.environ.get("PALPATE_FOREIGN_BY_HAND"):
            continue
        result = run_job(diagnose(read_rig(recording.write(HOUSE / "build" / "foreign" / name / "rig"))))
        row = gap_table.row_of(result, gap_errors(result), by_hand)
        rows.append(row)
        yield {"name": f"foreign.{name}.amended_over_by_hand", "value": row.ratio, "unit": "error / error", "goal": GOAL}
    if rows:
        print(gap_table.markdown(rows), file=sys.stderr, flush=True)
        median = gap_table.median_ratio(rows)
        yield {"name": "foreign.median", "value": median, "unit": "error / error", "goal": MEDIAN_GOAL}


def command(arguments: list[str]) -> int:
    """Do what the options behind ``python -m benchmarks foreign`` say."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks foreign", description="Foreign recordings, foreign generators.")
    doing = parser.add_mutually_exclusive_group(required=True)
    doing.add_argument("--write", type=Path, metavar="DIR", help="write the rigs and the errors by hand")
    doing.add_argument("--rigs", type=Path, metavar="DIR", help="diagnose the rigs of a generator and score the answers")
    given = parser.parse_args(arguments)
    if given.rigs is not None:
        print(scored_rigs(given.rigs))
        return 0
    lines = ["rig,error"]
    for name, recording, by_hand in _sets():
        path = recording.write(given.write / name)
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(r'^name = ".*"$', f'name = "{name}"', text, count=1, flags=re.MULTILINE), encoding="utf-8")
        lines.append(f"{name},{by_hand:.6g}")
    (given.write / "by-hand.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"palpate gap-table {given.write}/*/rig.toml --by-hand {given.write}/by-hand.csv")
    return 0


# --- recordings


def _sets() -> Iterator[tuple[str, Recording, float]]:
    """Yield name, recordings and error by hand of each set whose recordings are there."""
    data = Path(os.environ.get("PALPATE_REAL_DATA", HOUSE.parent / "shared" / "data"))
    if not data.is_dir():
        print(f"No recordings in {data}: name their folder in PALPATE_REAL_DATA.", file=sys.stderr)
        return
    for name in os.environ.get("PALPATE_FOREIGN_SETS", ",".join(FOREIGN)).split(","):
        read, model = FOREIGN[name]
        try:
            recording = read(data)
        except FileNotFoundError as error:
            print(f"'{name}' is left out: {error.filename} is missing.", file=sys.stderr)
            continue
        yield name, recording, check_error(recording, predict_by_hand(model, recording))


def check_error(recording: Recording, predicted: Sequence[np.ndarray]) -> float:
    """Root mean square of measured minus predicted in the check recordings, as a share of the range of all."""
    measured = [responses(columns) for _, _, columns in recording.trials]
    low, high = min(float(np.nanmin(m)) for m in measured), max(float(np.nanmax(m)) for m in measured)
    squares = [
        ((m - p) ** 2).ravel()
        for (_, use, _), m, p in zip(recording.trials, measured, predicted, strict=True)
        if use == "check"
    ]
    return float(np.sqrt(np.nanmean(np.concatenate(squares)))) / (high - low)


# --- rigs of a generator


def scored_rigs(folder: Path) -> str:
    """Diagnose all rigs of a folder and return the outcomes by the number of hidden effects, in Markdown.

    Results are kept in FOLDER/results.jsonl, and a run goes on where the last one stopped.
    """
    answers = json.loads((folder / "answers.json").read_text(encoding="utf-8"))
    kept = folder / "results.jsonl"
    done = {one["number"]: one for one in map(json.loads, kept.read_text().splitlines())} if kept.is_file() else {}
    found = carried_out(examine_rig, [(str(folder), case, answers[case]) for case in answers if case not in done], kept)
    results = [*done.values(), *found.values()]
    rows = ["| hidden effects | rigs | outcomes |", "| --- | ---: | --- |"]
    for kind in sorted({one["kind"] for one in results}):
        counts = Counter(one["outcome"] for one in results if one["kind"] == kind)
        rows.append(f"| {kind} | {counts.total()} | {', '.join(f'{n} {word}' for word, n in counts.most_common())} |")
    for one in results:
        if one["outcome"] != "right":
            said = ", ".join(f"{name} {confidence:.2f}" for name, _, confidence in one["said"]) or one["verdict"]
            rows.append(f"\n{one['number']}: {' + '.join(one['answer']) or 'nothing'}: {said}")
    cpu = [one["seconds"] for one in results]
    return "\n".join([*rows, f"CPU seconds: median {np.median(cpu):.0f}, nine of ten below {np.quantile(cpu, 0.9):.0f}."])


def examine_rig(folder: str, case: str, answer: dict) -> dict:
    """Diagnose a rig and hold what is said against what was hidden."""
    began = time.process_time()
    result = run_job(diagnose(read_rig(Path(folder) / case / "rig.toml")))
    sure = {SYNONYMS.get(name, name) for name in sure_names(result)}
    hidden = [SYNONYMS.get(name, name) for name in answer["effects"]]
    is_outside = any(name not in library() for name in hidden)
    accepted = [sorted(names) for names in answer.get("accept") or ()]
    said = outcome([] if is_outside else hidden, sorted(sure), result.verdict, bool(result.ambiguous))
    is_right = (
        sorted(sure) in accepted
        or (is_outside and said == "unexplained")
        or (not hidden and not sure)
        or (bool(hidden) and sure == set(hidden))
    )
    return {
        "kind": "outside the library" if is_outside else str(len(hidden)),
        "number": case,
        "answer": hidden or sorted({name for names in accepted for name in names}),
        "said": [(SYNONYMS.get(one.name, one.name), one.form, one.confidence) for one in result.findings],
        "ambiguous": result.ambiguous,
        "verdict": result.verdict,
        "outcome": "right" if is_right else "part" if said == "right" else said,
        "seconds": round(time.process_time() - began, 1),
    }
