# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate rig new``: a rig for ``palpate gap`` from logs of a real sensor."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import FileError, counted
from . import checks, console

if TYPE_CHECKING:
    from ..core.gap.logs.answers import Answers
    from ..core.gap.logs.log_table import LogFile


def add_arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_subparsers(dest="what", metavar="new", required=True)
    new = what.add_parser(
        "new", help="make a rig from logs", description="Make a rig from logs of a real sensor (docs/logs.md)."
    )
    new.add_argument(
        "logs",
        metavar="LOG",
        nargs="+",
        help="CSV and other tables of text, MCAP, a bag of ROS 1 or ROS 2, HDF5, NPZ or MAT; several files become trials",
    )
    new.add_argument("--out", metavar="DIR", help="folder for rig.toml and its CSV files; needed without --preview")
    new.add_argument(
        "--answers", metavar="FILE", help="meaning of the columns and missing information; without it a template is written"
    )
    new.add_argument("--yes", action="store_true", help="accept the entries that are marked CHECK in the template")
    new.add_argument("--preview", action="store_true", help="list the columns of the logs and write nothing")


def run(arguments: argparse.Namespace) -> int:
    from ..core.gap.logs import answers as log_answers
    from ..core.gap.logs.log_file import read_log
    from ..core.gap.logs.log_table import with_distinct_names
    from ..core.gap.logs.preview import preview_rows
    from ..core.gap.logs.proposal import propose
    from ..core.gap.logs.questions import asked
    from ..core.gap.logs.template import ANSWERS_NAME, PLOT_NAME, write_template

    with console.Interrupt.raised_at_once():
        logs = with_distinct_names([read_log(path) for path in arguments.logs])
        print(console.text_table(preview_rows(logs), "<<<>>>"))
        if arguments.preview:
            for note in dict.fromkeys(note for log in logs for note in log.notes):
                print(f"note: {note}")
            return 0
        if not arguments.out:
            raise FileError("A rig needs a folder: give one with --out, or --preview to see what is in the logs.")
        if arguments.answers:
            found = log_answers.read_answers(arguments.answers)
        else:
            found = propose(logs, Path(arguments.out).resolve().name or "rig")
            found = log_answers.confirmed(found) if arguments.yes else found
            if sys.stdin is not None and sys.stdin.isatty() and sys.stdout.isatty():
                found = asked(found)
            _require_complete(found, arguments.out)
            if not (Path(arguments.out) / ANSWERS_NAME).exists():  # whatever is refused later can be corrected there
                write_template(found, arguments.out)
        checks.outputs_are_no_inputs((Path(arguments.out) / name for name in (ANSWERS_NAME, PLOT_NAME)), arguments.logs)
        _write(logs, found, arguments.out)
    return 0


def _require_complete(found: Answers, out: str) -> None:
    """Write a template of the answers and raise FileError where questions are open."""
    from ..core.gap.logs.template import ANSWERS_NAME, write_template

    questions = list(found.open_questions())
    if not questions:
        return
    path = Path(out) / ANSWERS_NAME
    if path.exists():
        raise FileError(f"'{path}' has answers already: give it with --answers, or remove it for a new template.")
    write_template(found, out)
    for question in questions:
        print(f"question: {question}")
    raise FileError(
        f"The logs leave {counted(len(questions), 'question')} open: answer them in '{path}', and give the command again with "
        f"--answers '{path}'."
    )


def _write(logs: list[LogFile], found: Answers, out: str) -> None:
    from ..core.gap.dataset.rig import read_rig
    from ..core.gap.logs.new_rig import write_rig
    from ..core.gap.logs.preview import plot_rig
    from ..core.gap.logs.template import PLOT_NAME

    written = console.run_with_progress_bar("rig new", write_rig(logs, found, out), unit="recording")
    rig = read_rig(written.path)
    plot_rig(rig, written.path.parent / PLOT_NAME)
    for note in dict.fromkeys([*(note for log in logs for note in log.notes), *written.notes, *rig.warnings]):
        print(f"note: {note}")
    uses = [trial.use for trial in rig.trials]
    shares = f"{uses.count('fit')} to fit and {uses.count('check')} to check"
    print(f"{counted(len(uses), 'recording')}, {shares}; {counted(len(rig.texels), 'texel')}")
    print(f"rig:  {written.path}")
    print(f"plot: {written.path.parent / PLOT_NAME}")
