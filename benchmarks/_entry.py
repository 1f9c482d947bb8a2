# SPDX-License-Identifier: GPL-3.0-or-later
"""The hidden-effects benchmark for any method: cases as rigs, answers as CSV or JSON, and one table (docs/gap-results.md).

    python -m benchmarks gap --write DIR [--cases N] [--first N]
    python -m benchmarks gap --answer METHOD --of DIR --out ANSWERS.csv
    python -m benchmarks gap --score ANSWERS... --of DIR
    python -m benchmarks gap --compare [METHOD...] [--cases N] [--first N]

A method is a function of the path of a rig. It returns names of effects and a probability or None: no names where it says that
nothing is hidden, ``("unknown",)`` where something is that it cannot name.
"""

from __future__ import annotations

import argparse
import csv
import functools
import hashlib
import importlib.util
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _gap_baselines, _learned, _rows
from ._hidden import cases

Method = Callable[[Path], tuple[Iterable[str], float | None]]
NOTHING, FAILED, AND = "nothing", "failed", " + "
VERDICTS = {NOTHING: "no gap", "unknown": "unexplained", FAILED: FAILED}
"""What an answer without names counts as."""
HIDDEN, CHECKSUM = "hidden.csv", "hidden.sha256"
"""Files of what is hidden and of their checksum, beside the folder ``rigs``."""
SURE = 0.9
"""Answers of at least this probability are judged by themselves."""


@dataclass(frozen=True)
class Hidden:
    """What is hidden in a case: the row of the table it belongs to, the case's number there, and the names of its effects."""

    kind: str
    number: int
    names: list[str]


@dataclass(frozen=True)
class Answer:
    """What a method says of a case: names of effects or one of :data:`VERDICTS`, and how probable that is."""

    said: tuple[str, ...]
    probability: float | None = None

    @property
    def names(self) -> list[str]:
        """The effects that it names."""
        return [] if self.said[0] in VERDICTS else list(self.said)

    def outcome(self, hidden: Hidden) -> str:
        """Return one word, as :func:`._rows.outcome` does."""
        return _rows.outcome(hidden.names, self.names, VERDICTS.get(self.said[0], "explained"), False)


# --- the cases


def write_cases(folder: Path, count: int, first: int) -> str:
    """Write cases as ``rigs/NNN/rig.toml``, in an order that does not tell their kinds, and what is hidden beside them.

    Returns the checksum of the file of what is hidden.
    """
    if folder.exists() and any(folder.iterdir()):
        raise SystemExit(f"{folder} is not empty; name a new folder.")
    folder.mkdir(parents=True, exist_ok=True)
    plan = _plan(count, first)
    for index, (kind, number) in enumerate(plan):
        cases.write(cases.draw(kind, number), folder / "rigs" / f"{index:03d}", name=f"{index:03d}")
        print(f"{index + 1}/{len(plan)} written", file=sys.stderr, flush=True)
    text = hidden_text(count, first)
    (folder / HIDDEN).write_text(text, encoding="utf-8", newline="\n")
    (folder / CHECKSUM).write_text(f"{checksum_of(text)}  {HIDDEN}\n", encoding="utf-8")
    return checksum_of(text)


def _plan(count: int, first: int) -> list[tuple[str, int]]:
    plan = _rows.plan_of(count, first)
    return [plan[i] for i in np.random.default_rng(first).permutation(len(plan))]


def hidden_text(count: int, first: int) -> str:
    """Return the file of what is hidden in some cases, without drawing them."""
    rows = [
        f"{index:03d},{kind},{number},{AND.join(cases.answer_of(kind, number))}"
        for index, (kind, number) in enumerate(_plan(count, first))
    ]
    return "\n".join(["case,kind,number,hidden", *rows]) + "\n"


def checksum_of(text: str) -> str:
    """Return the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def read_hidden(folder: Path) -> dict[str, Hidden]:
    """Return what is hidden in the cases of a folder; the file must be the one that was written."""
    for name in (HIDDEN, CHECKSUM):
        if not (folder / name).is_file():
            raise SystemExit(f"{folder} has no {name}: it is no folder that --write has written.")
    text = (folder / HIDDEN).read_bytes().decode()
    if checksum_of(text) != (folder / CHECKSUM).read_text(encoding="utf-8").split()[0]:
        raise SystemExit(f"{folder / HIDDEN} has changed since it was written: its checksum is not that of {CHECKSUM}.")
    rows = csv.DictReader(text.splitlines())
    return {r["case"]: Hidden(r["kind"], int(r["number"]), r["hidden"].split(AND) if r["hidden"] else []) for r in rows}


# --- answers


def read_answers(path: Path, known: Iterable[str]) -> dict[str, Answer]:
    """Return the answers of a CSV file (case, said, probability) or of a JSON file ({case: {"said": …, "probability": …}})."""
    if not path.is_file():
        raise SystemExit(f"{path} is not there; it should hold the answers of a method.")
    if path.suffix == ".json":
        table = json.loads(path.read_text(encoding="utf-8"))
        rows = [{"case": case, **(one if isinstance(one, dict) else {"said": one})} for case, one in table.items()]
    else:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    found: dict[str, Answer] = {}
    cases_there = set(known)
    for line, row in enumerate(rows, start=2):
        where = f"{path}, {'entry' if path.suffix == '.json' else 'line'} {line - (path.suffix == '.json')}"
        if row.get("case") not in cases_there:
            raise SystemExit(f"{where}: there is no case {row.get('case')!r}; cases are named as their folders in rigs/.")
        if row["case"] in found:
            raise SystemExit(f"{where}: case {row['case']} is answered twice.")
        found[row["case"]] = _answer(row, where)
    return found


def answers_of_study(folder: Path, hidden: dict[str, Hidden]) -> dict[str, Answer]:
    """Return what the runs of docs/sample-study/hidden-effects.toml say of these cases, as far as the study has them."""
    runs = {(one["kind"], one["number"]): one for one in _rows.results_in(folder)}
    if not runs:
        raise SystemExit(f"{folder} has no runs/*/{_rows.CASE_NAME}: it is no folder of the study of hidden effects.")
    found = {}
    for case, one in hidden.items():
        run = runs.get((one.kind, one.number))
        if run is not None:
            sure = {name: confidence for name, _, confidence in run["said"] if name in run["sure"]}
            found[case] = answer_of(run["verdict"], sure)
    return found


def answer_of(verdict: str, sure: dict[str, float]) -> Answer:
    """Return what ``palpate gap`` says by its verdict and by the names it is sure of, with their confidences."""
    if sure:
        return Answer(tuple(sure), min(sure.values()))
    words = {meant: word for word, meant in VERDICTS.items()}
    return Answer((words.get(verdict, "unknown"),))


def _answer(row: dict[str, Any], where: str) -> Answer:
    said = row.get("said")
    listed = said if isinstance(said, list) else str("" if said is None else said).split(AND.strip())
    names = [str(one).strip() for one in listed] or [NOTHING]
    wrong = [name for name in names if name not in cases.ORDER and (name not in VERDICTS or len(names) > 1)]
    if wrong:
        effects = ", ".join(cases.ORDER)
        raise SystemExit(f"{where}: {wrong[0]!r} is no effect; say nothing, unknown, or names joined by +, of: {effects}.")
    try:
        probability = None if row.get("probability") in (None, "") else float(row["probability"])
    except (TypeError, ValueError):
        probability = np.nan
    if probability is not None and not 0.0 <= probability <= 1.0:
        raise SystemExit(f"{where}: the probability is {row['probability']!r} and should be a number from 0 to 1, or left out.")
    return Answer(tuple(names), probability)


def method_named(word: str) -> Method:
    """Return one of :data:`METHODS`, or the function NAME of FILE.py for ``FILE.py:NAME``."""
    if word in METHODS:
        return METHODS[word]
    file, _, name = word.rpartition(":")
    if not Path(file).is_file():
        listed = ", ".join(repr(known) for known in METHODS)
        raise SystemExit(f"There is no method {word!r}; name FILE.py:FUNCTION, or one of {listed}.")
    spec = importlib.util.spec_from_file_location(f"entered_{Path(file).stem}", file)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{file} is no Python file; name FILE.py:FUNCTION.")
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)  # data classes look their module up
    sys.path.insert(0, str(Path(file).resolve().parent))  # as if it were run, so that it can import what stands beside it
    spec.loader.exec_module(module)
    if not hasattr(module, name):
        raise SystemExit(f"{file} has no function {name!r}.")
    method: Method = getattr(module, name)
    return method


def answer_cases(methods: dict[str, tuple[Method, Path]], folder: Path, forgiving: bool = False) -> None:
    """Have methods answer all cases of a folder, each into its CSV file; what is answered there already is left alone.

    Parameters
    ----------
    methods : dict of str to (callable, path)
        By their names; what they are, and their file.
    folder : path
        That :func:`write_cases` has written.
    forgiving : bool
        Whether a method that raises has failed on a case, instead of stopping everything.
    """
    rigs = sorted((folder / "rigs").glob("*/rig.toml"))
    if not rigs:
        raise SystemExit(f"{folder} has no rigs/*/rig.toml: it is no folder that --write has written.")
    known = [rig.parent.name for rig in rigs]
    done = {name: set(read_answers(path, known)) if path.is_file() else set() for name, (_, path) in methods.items()}
    for count, rig in enumerate(rigs, start=1):
        for name, (method, path) in methods.items():
            if rig.parent.name in done[name]:
                continue
            try:
                names, probability = method(rig)
                said = AND.join(names) or NOTHING
            except Exception as error:
                if not forgiving:
                    raise
                said, probability = FAILED, None
                print(f"{name} on {rig.parent.name}: {error!r}", file=sys.stderr)
            line = {"case": rig.parent.name, "said": said, "probability": probability}
            _answer(line, f"{name} on case {rig.parent.name}")
            fresh = not path.is_file()
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a", encoding="utf-8", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerows([["case", "said", "probability"]] if fresh else [])
                writer.writerow([line["case"], said, "" if probability is None else f"{probability:.4f}"])
        print(f"{count}/{len(rigs)} answered", file=sys.stderr, flush=True)


# --- the methods beside each other


@functools.lru_cache(maxsize=1)
def _base(rig: Path) -> Any:
    """Return the fitted base model, with which two methods begin one after the other."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.diagnosis import fit_base
    from palpate.core.jobs.job_runner import run_job

    return run_job(fit_base(read_rig(rig)))


def palpate_gap(rig: Path) -> tuple[Iterable[str], float | None]:
    """Say what ``palpate gap`` is sure of; the probability is its smallest confidence."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.confidence import SURE as ENOUGH
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    result = run_job(diagnose(read_rig(rig)))
    sure = {finding.name: finding.confidence for finding in result.findings if finding.confidence >= ENOUGH}
    answer = answer_of(result.verdict, sure)
    return answer.said, answer.probability


def stepwise_bic(rig: Path) -> tuple[Iterable[str], float | None]:
    """Add the form of the library that lowers the BIC most, until none does."""
    return _gap_baselines.stepwise(_base(rig))[0], None


def sindy(rig: Path) -> tuple[Iterable[str], float | None]:
    """Name the strongest term of a sparse regression on the residual of the base model."""
    return _gap_baselines.sindy_terms(_base(rig))[0], None


METHODS: dict[str, Method] = {
    "palpate gap": palpate_gap,
    "stepwise BIC": stepwise_bic,
    "SINDy": sindy,
    "classifier": _learned.classifier,
    "nearest simulated": _learned.nearest_simulated,
}
"""A refitted base model alone, the other baseline of the benchmark, names nothing."""


# --- the table


def table(hidden: dict[str, Hidden], answers: dict[str, dict[str, Answer]]) -> str:
    """Return the table of some methods in Markdown: for each row of the benchmark how many are right and how many wrong."""
    text = [
        "| hidden | cases | " + " | ".join(answers) + " |",
        "| --- | ---: |" + " ---: |" * len(answers),
    ]
    none = Answer(("unknown",))
    for kind, (what, _) in _rows.ROWS.items():
        here = {case: one for case, one in hidden.items() if one.kind == kind}
        cells = []
        for of in answers.values():
            outcomes = [of.get(case, none).outcome(one) for case, one in here.items()]
            cells.append(f"{outcomes.count(_rows.RIGHT.get(kind, 'right'))} / {outcomes.count('wrong')}")
        if here:
            text.append(f"| {what} | {len(here)} | " + " | ".join(cells) + " |")
    text.append(
        f"| *named at {SURE} or more: not wrong* | | " + " | ".join(_sure(hidden, of) for of in answers.values()) + " |"
    )
    text.append("| *Brier score of what is named* | | " + " | ".join(_brier(hidden, of) for of in answers.values()) + " |")
    missing = [f"{name} has not answered {n} of them" for name, of in answers.items() if (n := len(set(hidden) - set(of)))]
    note = f"Right / wrong of {len(hidden)} cases; what is neither was left open or named in part."
    return "\n".join([*text, "", " ".join([note, *(f"{one}, which counts as unknown." for one in missing)])])


def _named(hidden: dict[str, Hidden], of: dict[str, Answer]) -> list[tuple[float, bool]]:
    """Probabilities of the answers that name something, and whether no name is wrong."""
    some = [(one.probability, one.outcome(hidden[case]) != "wrong") for case, one in of.items() if one.names]
    return [(probability, good) for probability, good in some if probability is not None]


def _sure(hidden: dict[str, Hidden], of: dict[str, Answer]) -> str:
    good = [good for probability, good in _named(hidden, of) if probability >= SURE]
    return f"{sum(good)} of {len(good)}" if good else "–"


def _brier(hidden: dict[str, Hidden], of: dict[str, Answer]) -> str:
    named = _named(hidden, of)
    return f"{np.mean([(probability - good) ** 2 for probability, good in named]):.2f}" if named else "–"


# --- the command


def command(arguments: list[str]) -> int:
    """Do what the options behind ``python -m benchmarks gap`` say."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks gap", description="The hidden-effects benchmark for any method."
    )
    doing = parser.add_mutually_exclusive_group(required=True)
    doing.add_argument("--write", type=Path, metavar="DIR", help="write cases as rigs, and what is hidden in a file apart")
    doing.add_argument("--answer", metavar="METHOD", help="have FILE.py:FUNCTION, or one of the methods here, answer the cases")
    doing.add_argument(
        "--score",
        type=Path,
        nargs="+",
        metavar="ANSWERS",
        help="print the table of files of answers, or of folders of the study docs/sample-study/hidden-effects.toml",
    )
    doing.add_argument(
        "--compare",
        nargs="*",
        metavar="METHOD",
        help="write cases, have all methods here or those named answer them, print the table",
    )
    parser.add_argument("--of", type=Path, metavar="DIR", help="the folder of the cases that --write has written")
    parser.add_argument("--out", type=Path, metavar="ANSWERS.csv", help="where --answer writes; it goes on where it stopped")
    parser.add_argument(
        "--cases", type=int, default=78, help="how many cases --write and --compare draw (78); the whole is 390"
    )
    parser.add_argument("--first", type=int, default=0, help="number of the first case of each row (0); below 1000 are public")
    args = parser.parse_args(arguments)
    if args.cases < 1 or args.first < 0:
        parser.error("--cases must be at least 1, and --first at least 0")
    if args.write is not None:
        print(f"{write_cases(args.write, args.cases, args.first)}  {HIDDEN}")
    elif args.compare is not None:
        print(compare(args.cases, args.first, args.compare or list(METHODS)))
    elif args.of is None:
        parser.error("--of DIR is missing: the folder that --write has written")
    elif args.answer is not None:
        if args.out is None:
            parser.error("--out ANSWERS.csv is missing")
        answer_cases({args.answer: (method_named(args.answer), args.out)}, args.of)
    else:
        hidden = read_hidden(args.of)
        read = {path: answers_of_study if path.is_dir() else read_answers for path in args.score}
        print(table(hidden, {path.stem: reading(path, hidden) for path, reading in read.items()}))
    return 0


def compare(count: int, first: int, names: Iterable[str]) -> str:
    """Return the table of some methods on some cases; what they answered is kept in build/gap and gone on with."""
    methods = {Path(name).name.replace(":", " "): method_named(name) for name in names}
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    folder = _rows.HOUSE / "build" / "gap" / f"compare-{first}-{count}-{_rows.fingerprint()}"
    if not (folder / CHECKSUM).is_file():
        shutil.rmtree(folder, ignore_errors=True)
        write_cases(folder, count, first)
    files = {name: folder / "answers" / f"{name}.csv" for name in methods}
    answer_cases({name: (method, files[name]) for name, method in methods.items()}, folder, forgiving=True)
    hidden = read_hidden(folder)
    return table(hidden, {name: read_answers(path, hidden) for name, path in files.items()})
