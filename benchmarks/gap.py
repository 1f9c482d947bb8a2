# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on recordings with something hidden in them (``_hidden``): what it says, held against the sealed answers.

The confusion matrix goes to build/gap/confusion.txt, the table of docs/gap-results.md to build/gap/table.md.

The whole matrix is 390 cases, an hour and a half of one core; a fifth of it is run by default. Results are kept in build/gap/,
one line a case, and a run goes on where the last one stopped, as long as neither the workflow nor the generator has changed.
With options (``python -m benchmarks gap --help``) it writes the cases as rigs for other methods and scores their answers:
docs/gap-results.md.

Environment:

``PALPATE_GAP_CASES``      how many cases (78), shared out over the kinds as in :data:`MIX`
``PALPATE_GAP_PROCESSES``  how many at a time (2)
``PALPATE_GAP_FIRST``      number of the first case of each kind; below 1000 are those to develop on, from 5000 on those that
                           nobody looks at before the figures are drawn (5000)
``PALPATE_GAP_RESULTS``    a file of results: nothing is run, its figures are printed
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.effects.engine.registry import names_found_by
from palpate.core.effects.engine.specification import SCATTER
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.report.amended_sensor import with_mean_gain_moved
from palpate.core.gap.report.sentences import next_experiment
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

from . import _entry
from ._hidden import cases
from ._hidden.own import true_value
from ._rows import HOUSE, RIGHT, ROWS, fingerprint, outcome, plan_of, results_in, sure_names

command = _entry.command
"""Writes cases as rigs, has any method answer them, and scores answers: docs/gap-results.md."""
FORMULAS = ("own", "other", "third")
"""Kinds of cases with one effect, by whose formula it has."""
BARS: dict[str, tuple[float | None, float | None]] = {
    "own": (0.95, None), "other": (0.85, 0.05), "third": (0.92, 0.02), "none": (0.98, None), "two": (0.75, None),
    "three": (0.60, None), "outside": (0.90, None), "poor": (None, 0.0),
}  # fmt: skip
"""Least share that is right and largest that is wrong, of each kind."""
FAILED: dict[str, Any] = {"outcome": "failed", "sure": [], "said": [], "verdict": "failed", "ambiguous": [], "experiment": ""}
FAILED |= {"closed": None, "inside": []}
"""The score of a case that raised."""


def run() -> Iterator[dict]:
    """Yield one figure for every bar; the confusion matrix goes to stderr and to build/gap/confusion.txt."""
    total = int(os.environ.get("PALPATE_GAP_CASES", "78"))
    first = int(os.environ.get("PALPATE_GAP_FIRST", "5000"))
    plan = plan_of(total, first)
    kept = os.environ.get("PALPATE_GAP_RESULTS")
    results = results_in(Path(kept)) if kept else _results(plan)
    matrix, rows = confusion(results), table(results)
    print(matrix, rows, sep="\n\n", file=sys.stderr)
    (results_folder() / "confusion.txt").write_text(matrix + "\n", encoding="utf-8")
    (results_folder() / "table.md").write_text(rows + "\n", encoding="utf-8")
    yield from figures(results)


# --- cases, one after the other


def results_folder() -> Path:
    """Return the folder of results, which is made if it lacks."""
    folder = HOUSE / "build" / "gap"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _results(plan: list[tuple[str, int]]) -> list[dict]:
    path = results_folder() / f"results-{fingerprint()}.jsonl"
    done = {(r["kind"], r["number"]): r for r in results_in(path)} if path.is_file() else {}
    done |= carried_out(examine, [entry for entry in plan if entry not in done], path)
    return [done[entry] for entry in plan]


def carried_out(work: Callable[..., dict], todo: list[tuple], path: Path) -> dict[tuple[str, int], dict]:
    """Call `work` with each entry of `todo` in processes, and append each result to a file as it comes.

    Returns
    -------
    dict
        Results by kind and number.
    """
    processes, found = int(os.environ.get("PALPATE_GAP_PROCESSES", "2")), {}
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool, path.open("a", encoding="utf-8") as file:
        waiting = [pool.submit(work, *entry) for entry in todo]
        for count, future in enumerate(as_completed(waiting), start=1):
            result = future.result()
            found[result["kind"], result["number"]] = result
            file.write(json.dumps(result) + "\n")
            file.flush()
            said = f"{result['kind']} {result['number']}: {result['outcome']}"
            print(f"{count}/{len(todo)} {said} ({result['seconds']:.0f} s)", file=sys.stderr, flush=True)
    return found


def examine(kind: str, number: int) -> dict[str, Any]:
    """Draw a case, have it diagnosed from its files, and hold the outcome against the answer."""
    case = cases.draw(kind, number)
    with tempfile.TemporaryDirectory() as folder:
        rig_path = cases.write(case, Path(folder))
        began, used = time.perf_counter(), time.process_time()
        result, failed = None, ""
        try:
            result = run_job(diagnose(read_rig(rig_path)))
        except Exception as error:  # counts as anything but right; the other cases go on
            failed = repr(error)
        seconds, cpu = time.perf_counter() - began, time.process_time() - used
    entry = {"kind": case.kind, "number": case.number, "answer": case.answer, "forms": [h.form for h in case.hidden]}
    scored = score(case, result) if result is not None else {**FAILED, "failed": failed}
    entry |= {"shape": "ball" if case.probe.radius else "flat", "share": list(case.share), **scored}
    return entry | {"seconds": round(seconds, 2), "cpu_seconds": round(cpu, 2)}


# --- scoring


def score(case: cases.Case, result: Any) -> dict[str, Any]:
    """Return what was said of a case and how right it is."""
    model = with_mean_gain_moved(result)
    sure = sorted(sure_names(result))
    said = [[n.name, n.form, n.confidence] for n in result.findings]
    inside = []
    for one in result.intervals:
        true = _truth(case, one, model)
        if true is not None:
            inside.append([one.name, bool(min(one.low, one.high) <= true <= max(one.low, one.high))])
    return {
        "outcome": outcome(case.answer, sure, result.verdict, bool(result.ambiguous)),
        "sure": sure,
        "said": said,
        "verdict": result.verdict,
        "ambiguous": [list(pair) for pair in result.ambiguous],
        "experiment": next_experiment(result),
        "closed": closed(case, result, model),
        "inside": inside,
    }


def _truth(case: cases.Case, one: Any, model: Any) -> float | None:
    """The true value of a fitted number, where the model has the formula that is hidden and the number is comparable."""
    if case.kind != "own" or [(e.name, e.form) for e in model.effects] != [(h.name, h.form) for h in case.hidden]:
        return None
    if any(isinstance(value, tuple) for value in model.effects[0].values.values()):
        return None  # a number per texel takes part of the common ones
    if one.effect >= 0:
        return true_value(case.hidden[one.effect], one.name, case.pad)
    return float(getattr(case.pad, one.name)) if hasattr(case.pad, one.name) else None


def closed(case: cases.Case, result: Any, model: Any) -> float | None:
    """Share of the gap on the check trials that a model closes, against the truth without noise; None without a gap.

    The gap is the root mean square of truth minus prediction, readings and forces each in units of their range.
    """
    if case.kind not in (*FORMULAS, *cases.SEVERAL) or set(case.answer) & set(names_found_by(SCATTER)):
        return None  # of noise no model could close a gap
    before, after = (_miss(case, result, one) for one in (result.base.model, model))
    return 1.0 - after / before


def _miss(case: cases.Case, result: Any, model: Any) -> float:
    square = count = 0.0
    for predictor in result.of("check"):
        clean = case.clean[int(predictor.trial.name.removeprefix("trial_"))]
        predicted = predictor.predict(model)
        for true, guess, size in zip(clean, (predicted.reading, predicted.force), result.full, strict=True):
            miss = (true - guess) / size
            square, count = square + float(np.vdot(miss, miss)), count + miss.size
    return float(np.sqrt(square / count))


# --- figures


def confusion(results: list[dict]) -> str:
    """Return a table: what was hidden, and how often what was said."""
    several = cases.SEVERAL
    rows = sorted({(r["kind"], r["kind"] if r["kind"] in several else " + ".join(r["answer"])) for r in results})
    text = [f"{'kind':8} {'hidden':18} {'cases':>5}  said"]
    for kind, hidden in rows:
        here = [r for r in results if r["kind"] == kind and (kind in several or " + ".join(r["answer"]) == hidden)]
        said = Counter(" + ".join(r["sure"]) if r["sure"] and kind not in several else r["outcome"] for r in here)
        words = ", ".join(f"{name} {count}" for name, count in said.most_common())
        text.append(f"{kind:8} {hidden or 'nothing':18} {len(here):5d}  {words}")
    return "\n".join(text)


def table(results: list[dict]) -> str:
    """Return what docs/gap-results.md says of a whole run, in Markdown."""
    words = {"right": "right", "part": "one of them", "wrong": "wrong", "ambiguous": "`ambiguous`"}
    text = ["| hidden | cases | outcome | aim |", "| --- | ---: | --- | --- |"]
    for kind, (what, aim) in ROWS.items():
        here = [r for r in results if r["kind"] == kind]
        counts = Counter(r["outcome"] for r in here)
        said = ", ".join(f"{count} {words.get(name, f'`{name}`')}" for name, count in counts.most_common())
        if kind == "three":
            said += f"; all three {sum(set(r['sure']) == set(r['answer']) for r in here)}"
        elif kind in (*FORMULAS, "two"):
            missed = Counter(" + ".join(r["answer"]) for r in here if r["outcome"] != "right")
            if kind != "two" and missed:
                said += "; missed: " + ", ".join(
                    f"{name} {count}" if count > 1 else name for name, count in missed.most_common()
                )
        text.append(f"| {what} | {len(here)} | {said} | {aim} |")
    kinds = (*FORMULAS, *cases.SEVERAL)
    closed = {k: [r["closed"] for r in results if r["kind"] == k and r["closed"] is not None] for k in kinds}
    inside = [hit for r in results if r["kind"] == "own" for _, hit in r["inside"]]
    medians = ", ".join(f"{k} {np.median(v):.1%}" for k, v in closed.items() if v)
    cpu = [r["cpu_seconds"] for r in results]
    text += [
        "",
        f"Gap closed on `check` trials, medians: {medians}. 95 % intervals held {sum(inside)} of {len(inside)} numbers.",
    ]
    text += [f"CPU seconds a case: median {np.median(cpu):.0f}, nine of ten below {np.quantile(cpu, 0.9):.0f}."]
    return "\n".join(text)


def figures(results: list[dict]) -> Iterator[dict]:
    """Yield the shares of each kind of cases that are right and wrong, and how well gaps are closed; the table has the rest."""
    for kind, (right, most) in BARS.items():
        here = [r for r in results if r["kind"] == kind]
        for what, goal in ((RIGHT.get(kind, "right"), right), ("wrong", most)):
            if here:
                share = float(np.mean([r["outcome"] == what for r in here]))
                figure = {"name": f"gap.{kind}.{what.replace(' ', '_')}", "value": share, "unit": f"share of {len(here)}"}
                yield figure | ({"goal": goal} if goal is not None else {})
    for kind, goal in (("own", 0.80), ("other", 0.65)):
        yield from _middle(f"{kind}.closed_on_check", [r["closed"] for r in results if r["kind"] == kind], "share", goal)
    inside = [hit for r in results if r["kind"] == "own" for _, hit in r["inside"]]
    if inside:
        yield {"name": "gap.own.interval_coverage", "value": float(np.mean(inside)), "unit": "share", "goal": 0.95}
    yield from _middle("seconds", [r["cpu_seconds"] for r in results], "s", 30.0)


def _middle(name: str, values: list[float | None], unit: str, goal: float | None) -> Iterator[dict]:
    known = [value for value in values if value is not None]
    if known:
        yield {"name": f"gap.{name}", "value": float(np.median(known)), "unit": unit} | ({"goal": goal} if goal else {})
