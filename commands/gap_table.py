# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap-table``: what ``palpate gap`` finds in many rigs, in one table beside models made by hand."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

from ..core.errors import FileError
from ..core.io.file_writing import writable_file, write_text
from . import checks, console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rigs", metavar="RIG.toml", nargs="+", help="rigs with recordings whose use is check")
    parser.add_argument(
        "--by-hand",
        metavar="FILE.csv",
        help="errors of models made by hand, with the columns rig (its name) and error (a share of the readings' range)",
    )
    parser.add_argument("--out", metavar="TABLE.md", help="also write the table to this file")


def run(arguments: argparse.Namespace) -> int:
    from ..addon.session import dependencies

    dependencies.choose_numba_cache()
    from ..api.gap import find_gap, read_rig
    from ..core.gap.report import gap_table

    with console.Interrupt.raised_at_once():
        if arguments.out:
            writable_file(arguments.out)
            checks.outputs_are_no_inputs(
                (arguments.out,), [*arguments.rigs, *([arguments.by_hand] if arguments.by_hand else [])]
            )
        rigs = [read_rig(path) for path in arguments.rigs]
        for rig in rigs:
            gap_table.require_check(rig)
        twice = [name for name, count in Counter(rig.name for rig in rigs).items() if count > 1]
        if twice:
            raise FileError(f"Two rigs are called '{twice[0]}': give each a name of its own in its rig.toml.")
        by_hand = gap_table.read_by_hand(Path(arguments.by_hand), (rig.name for rig in rigs)) if arguments.by_hand else {}
    rows = []
    for rig in rigs:
        with console.Interrupt.raised_at_once(), console.shown_progress(rig.name) as show:
            gap = find_gap(rig, show)
            rows.append(gap_table.row_of(gap.diagnosis, gap.errors, by_hand.get(rig.name)))
    print(console.text_table(gap_table.cells(rows), "<>>>><"))
    if arguments.out:
        write_text(arguments.out, gap_table.markdown(rows))
        print(f"wrote: {arguments.out}")
    return 0
