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
    from ..core.gap.logs.answers import ANSWERS_NAME, PLOT_NAME, answers_or_template, read_answers
    from ..core.gap.logs.log_file import read_log
    from ..core.gap.logs.log_table import with_distinct_names
    from ..core.gap.logs.preview import preview_rows
    from ..core.gap.logs.proposal import propose
    from ..core.gap.logs.questions import asked

    with console.Interrupt.raised_at_once():
        logs = [read_log(path) for path in arguments.logs]
        shown = with_distinct_names(logs)
        print(console.text_table(preview_rows(shown), "<<<>>>"))
        if arguments.preview:
            for note in dict.fromkeys(note for log in shown for note in log.notes):
                print(f"note: {note}")
            return 0
        if not arguments.out:
            raise FileError("A rig needs a folder: give one with --out, or --preview to see what is in the logs.")
        outputs = [Path(arguments.out) / name for name in (ANSWERS_NAME, PLOT_NAME)]
        checks.outputs_are_no_inputs(outputs, arguments.logs)
        if arguments.answers:
            answers = read_answers(arguments.answers)
        else:
            proposal = propose(logs, Path(arguments.out).resolve().name or "rig")
            proposal = proposal.confirmed() if arguments.yes else proposal
            if sys.stdin is not None and sys.stdin.isatty() and sys.stdout.isatty():
                proposal = asked(proposal)
            for question in proposal.questions:
                print(f"question: {question}")
            answers = answers_or_template(proposal, arguments.out, f"and repeat the command with --answers '{outputs[0]}'")
        _write(logs, answers, arguments.out)
    return 0


def _write(logs: list[LogFile], answers: Answers, out: str) -> None:
    from ..core.gap.logs.answers import PLOT_NAME
    from ..core.gap.logs.new_rig import write_rig
    from ..core.gap.logs.preview import plot_rig

    written = console.run_with_progress_bar("rig new", write_rig(logs, answers, out), unit="recording")
    rig = written.rig
    plot_rig(rig, written.path.parent / PLOT_NAME)
    for note in dict.fromkeys([*(note for log in logs for note in log.notes), *written.notes, *rig.warnings]):
        print(f"note: {note}")
    uses = [trial.use for trial in rig.trials]
    shares = f"{uses.count('fit')} to fit and {uses.count('check')} to check"
    print(f"{counted(len(uses), 'recording')}, {shares}; {counted(len(rig.texels), 'texel')}")
    print(f"rig:  {written.path}")
    print(f"plot: {written.path.parent / PLOT_NAME}")
