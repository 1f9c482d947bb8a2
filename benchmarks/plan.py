# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment, carried through: recordings that leave open what is hidden, a planned recording more, and the outcome.

Cases are those of ``_hidden`` whose recordings are not informative. Where ``palpate gap`` names nothing and calls kinds
ambiguous, the trajectory that it plans is simulated on the same sensor, with noise, and is added to the recordings to fit.
Beside it stand trajectories of random programmes, as long and within the same limits.

A line a case is kept in build/plan/, and a run goes on where the last one stopped. Environment:

``PALPATE_PLAN_CASES``    how many cases are drawn (10)
``PALPATE_PLAN_FIRST``    number of the first; below 1000 are those to develop on (5000)
``PALPATE_PLAN_RANDOM``   random trajectories a case (1)
``PALPATE_PLAN_RESULTS``  a file of results: nothing is run, its figures are printed
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ._hidden import cases
from ._hidden.world import converted, net_force, respond, touch
from .gap import outcome

HOUSE = Path(__file__).resolve().parent.parent
FORCE_NOISE = 0.003
"""Noise of the net force, as a share of its largest component, as in the recordings of a case."""


def run() -> Iterator[dict]:
    """Yield one figure for each outcome; the table goes to stderr and to build/plan/table.md."""
    kept = os.environ.get("PALPATE_PLAN_RESULTS")
    results = _read(Path(kept)) if kept else _results()
    rows = table(results)
    print(rows, file=sys.stderr)
    (_folder() / "table.md").write_text(rows + "\n", encoding="utf-8")
    yield from figures(results)


def _folder() -> Path:
    folder = HOUSE / "build" / "plan"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _read(path: Path) -> list[dict]:
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return list({one["number"]: one for one in map(json.loads, lines)}.values())


def _results() -> list[dict]:
    count, first = int(os.environ.get("PALPATE_PLAN_CASES", "10")), int(os.environ.get("PALPATE_PLAN_FIRST", "5000"))
    path = _folder() / f"results-{first}.jsonl"
    done = {one["number"]: one for one in _read(path)}
    for number in range(first, first + count):
        if number not in done:
            done[number] = examine(number, int(os.environ.get("PALPATE_PLAN_RANDOM", "1")))
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(done[number]) + "\n")
            one = done[number]
            print(f"{number} {one['answer']}: {one['before']} → {one['planned']}", file=sys.stderr, flush=True)
    return [done[number] for number in range(first, first + count)]


def examine(number: int, random: int) -> dict[str, Any]:
    """Draw a case and carry the planned experiment through, where its recordings leave a pair open."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.planning.experiment_plan import plan_after
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    case = cases.draw("poor", number)
    with tempfile.TemporaryDirectory() as folder:
        rig = read_rig(cases.write(case, Path(folder)))
    before = run_job(diagnose(rig))
    entry = {"number": number, "answer": case.answer, "forms": [hidden.form for hidden in case.hidden]}
    entry |= {"before": _said(case, before)[0], "ambiguous": [list(group) for group in before.ambiguous], "planned": None}
    used = time.process_time()
    experiment = run_job(plan_after(before)) if entry["before"] == "ambiguous" else None
    entry["plan_seconds"] = round(time.process_time() - used, 2)
    if experiment is None:
        return entry
    design = experiment.design
    entry |= {"kinds": experiment.kinds, "sure": [experiment.sure_before, experiment.sure_after]}
    entry["questions"] = [
        [a.distinction.signal, a.other, round(a.sureness, 4), round(b.sureness, 4)]
        for a, b in zip(design.before, design.after, strict=True)
    ]
    entry["planned"], entry["said"] = _after(case, rig, design.trajectory, 0)
    found = [_after(case, rig, _random_trajectory(experiment, before, seed), seed) for seed in range(1, random + 1)]
    entry["random"] = [one for one, _ in found]
    entry["random_said"] = [said for _, said in found]
    return entry


def _random_trajectory(experiment: Any, before: Any, seed: int) -> Any:
    """The trajectory of a random programme within the limits of the planned experiment."""
    from palpate.core.gap.planning.paths import Ground
    from palpate.core.gap.planning.programmes import random_programme

    ground = Ground(before.predictors, experiment.limits)
    return ground.trajectory(random_programme(ground.span, np.random.default_rng(seed)))


def _after(case: cases.Case, rig: Any, trajectory: Any, seed: int) -> tuple[str, list]:
    """What is said of the recordings with one more along a trajectory."""
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    rng = np.random.default_rng([case.number, seed])
    trial = trajectory.as_trial(rig.trials[0])
    signals = respond(touch(case.probe, case.pad, trial.time, trial.position, case.hidden), case.pad, case.hidden)
    reading = converted(signals.reading + case.noise * rng.normal(size=signals.reading.shape), case.pad, case.hidden)
    largest = max(float(np.abs(force).max()) for _, force in case.clean)
    force = net_force(signals) + FORCE_NOISE * largest * rng.normal(size=(len(trial.time), 3))
    further = replace(trial, reading=reading, force=force)
    return _said(case, run_job(diagnose(replace(rig, trials=(*rig.trials, further)))))


def _said(case: cases.Case, result: Any) -> tuple[str, list]:
    """The outcome in a word; the names with their confidences, and the groups that are ambiguous."""
    from palpate.core.gap.selection.confidence import SURE

    sure = [named.name for named in result.findings if named.confidence >= SURE]
    said = [[one.name, one.confidence] for one in result.findings]
    return outcome(case.answer, sure, result.verdict, bool(result.ambiguous)), [*said, *map(list, result.ambiguous)]


def table(results: list[dict]) -> str:
    """Return the outcomes beside each other, in Markdown."""
    carried = [one for one in results if one["planned"] is not None]
    text = ["| recording more | cases | outcome |", "| --- | ---: | --- |"]
    for name, outcomes in (
        ("planned", [one["planned"] for one in carried]),
        ("random", [said for one in carried for said in one["random"]]),
    ):
        counts = ", ".join(f"{count} {word}" for word, count in Counter(outcomes).most_common())
        text.append(f"| {name} | {len(outcomes)} | {counts} |")
    return "\n".join(text)


def figures(results: list[dict]) -> Iterator[dict]:
    """Yield the shares of open cases that a planned and a random recording resolve, and settle wrongly."""
    carried = [one for one in results if one["planned"] is not None]
    yield {"name": "plan.open_cases", "value": len(carried), "unit": "cases"}
    if not carried:
        return
    for word, goal in (("right", 0.8), ("wrong", 0.0)):
        own = float(np.mean([one["planned"] == word for one in carried]))
        peer = float(np.mean([said == word for one in carried for said in one["random"]] or [0.0]))
        yield {"name": f"plan.{word}", "value": own, "unit": "share", "peer": "random", "peer_value": peer, "goal": goal}
    yield {"name": "plan.seconds", "value": float(np.median([one["plan_seconds"] for one in carried])), "unit": "s"}
