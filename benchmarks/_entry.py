# SPDX-License-Identifier: GPL-3.0-or-later
"""The hidden-effects benchmark for any method: cases as rigs, answers as CSV, and one table (docs/gap-results.md).

    python -m benchmarks gap --write DIR [--cases N] [--first N]
    python -m benchmarks gap --answer FILE.py:FUNCTION --of DIR --out ANSWERS.csv
    python -m benchmarks gap --score ANSWERS.csv... --of DIR

A method is a function of the path of a rig. It returns names of effects and a probability or None: no names where it says that
nothing is hidden, ``("unknown",)`` where something is that it cannot name.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _rows
from ._hidden import cases

Method = Callable[[Path], tuple[Iterable[str], float | None]]
NOTHING, AND = "nothing", " + "
VERDICTS = {NOTHING: "no gap", "unknown": "unexplained"}
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
    """Return the answers of a CSV file with the columns case, said and probability."""
    if not path.is_file():
        raise SystemExit(f"{path} is not there; it should hold the answers of a method.")
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    found: dict[str, Answer] = {}
    cases_there = set(known)
    for line, row in enumerate(rows, start=2):
        where = f"{path}, line {line}"
        if row.get("case") not in cases_there:
            raise SystemExit(f"{where}: there is no case {row.get('case')!r}; cases are named as their folders in rigs/.")
        if row["case"] in found:
            raise SystemExit(f"{where}: case {row['case']} is answered twice.")
        found[row["case"]] = _answer(row.get("said") or NOTHING, row.get("probability"), where)
    return found


def _answer(said: str, probability: Any, where: str) -> Answer:
    names = [one.strip() for one in said.split(AND.strip())]
    wrong = [name for name in names if name not in cases.ORDER and (name not in VERDICTS or len(names) > 1)]
    if wrong:
        effects = ", ".join(cases.ORDER)
        raise SystemExit(f"{where}: {wrong[0]!r} is no effect; say nothing, unknown, or names joined by +, of: {effects}.")
    try:
        number = None if probability in (None, "") else float(probability)
    except (TypeError, ValueError):
        number = np.nan
    if number is not None and not 0.0 <= number <= 1.0:
        raise SystemExit(f"{where}: the probability is {probability!r} and should be a number from 0 to 1, or empty.")
    return Answer(tuple(names), number)


def method_named(word: str) -> Method:
    """Return the function NAME of FILE.py for ``FILE.py:NAME``."""
    file, _, name = word.rpartition(":")
    spec = importlib.util.spec_from_file_location(f"entered_{Path(file).stem}", file) if Path(file).is_file() else None
    if spec is None or spec.loader is None:
        raise SystemExit(f"There is no method {word!r}; name FILE.py:FUNCTION.")
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)  # data classes look their module up
    sys.path.insert(0, str(Path(file).resolve().parent))  # as if it were run, so that it can import what stands beside it
    spec.loader.exec_module(module)
    if not hasattr(module, name):
        raise SystemExit(f"{file} has no function {name!r}.")
    method: Method = getattr(module, name)
    return method


def answer_cases(method: Method, folder: Path, path: Path) -> None:
    """Have a method answer all cases of a folder into a CSV file; what is answered there already is left alone."""
    rigs = sorted((folder / "rigs").glob("*/rig.toml"))
    if not rigs:
        raise SystemExit(f"{folder} has no rigs/*/rig.toml: it is no folder that --write has written.")
    done = read_answers(path, [rig.parent.name for rig in rigs]) if path.is_file() else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    for count, rig in enumerate(rigs, start=1):
        case = rig.parent.name
        if case in done:
            continue
        names, probability = method(rig)
        said = AND.join(names) or NOTHING
        _answer(said, probability, f"case {case}")
        is_fresh = not path.is_file()
        with path.open("a", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([["case", "said", "probability"]] if is_fresh else [])
            writer.writerow([case, said, "" if probability is None else f"{probability:.4f}"])
        print(f"{count}/{len(rigs)} answered", file=sys.stderr, flush=True)


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
    text.append("| *Brier score of names* | | " + " | ".join(_brier(hidden, of) for of in answers.values()) + " |")
    missing = [f"{name} has not answered {n} of them" for name, of in answers.items() if (n := len(set(hidden) - set(of)))]
    note = f"Right / wrong of {len(hidden)} cases; the others were left open or named in part."
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
    parser = argparse.ArgumentParser(prog="python -m benchmarks gap", description="Hidden effects, for any method.")
    doing = parser.add_mutually_exclusive_group(required=True)
    doing.add_argument("--write", type=Path, metavar="DIR", help="write cases as rigs, and what is hidden in a file apart")
    doing.add_argument("--answer", metavar="FILE.py:FUNCTION", help="have a function answer the cases")
    doing.add_argument("--score", type=Path, nargs="+", metavar="ANSWERS", help="print the table of files of answers")
    parser.add_argument("--of", type=Path, metavar="DIR", help="the folder of the cases that --write has written")
    parser.add_argument("--out", type=Path, metavar="ANSWERS.csv", help="where --answer writes; it goes on where it stopped")
    parser.add_argument("--cases", type=int, default=78, help="how many cases --write draws (78); the whole is 390")
    parser.add_argument("--first", type=int, default=0, help="number of the first case of each row (0); below 1000 are public")
    args = parser.parse_args(arguments)
    if args.cases < 1 or args.first < 0:
        parser.error("--cases must be at least 1, and --first at least 0")
    if args.write is not None:
        print(f"{write_cases(args.write, args.cases, args.first)}  {HIDDEN}")
    elif args.of is None:
        parser.error("--of DIR is missing: the folder that --write has written")
    elif args.answer is not None:
        if args.out is None:
            parser.error("--out ANSWERS.csv is missing")
        answer_cases(method_named(args.answer), args.of, args.out)
    else:
        hidden = read_hidden(args.of)
        print(table(hidden, {path.stem: read_answers(path, hidden) for path in args.score}))
    return 0
