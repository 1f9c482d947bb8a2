# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on openly licensed recordings of other people's sensors, beside a model by hand: one table.

    python -m benchmarks foreign --write DIR

writes the rigs and the errors of the models by hand, from which ``palpate gap-table`` makes the same table. The recordings are
looked for in the folder ``PALPATE_REAL_DATA`` (../shared/data beside the checkout); ``PALPATE_FOREIGN_SETS`` names some sets.
``PALPATE_FOREIGN_BY_HAND=1`` fits the models by hand alone, which takes seconds. docs/real-data.md has the table.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from ._foreign import FOREIGN
from ._further.handmade import predict_by_hand
from ._recordings import Recording
from .further import GOAL, _check_error
from .real import _diagnosed

HOUSE = Path(__file__).resolve().parent.parent
MEDIAN_GOAL = 1.1


def run() -> Iterator[dict]:
    """Yield, for each set, the error on check recordings by the amended model over that by the model made by hand."""
    from palpate.core.gap.report import gap_table

    rows = []
    for name, recording, by_hand in _sets():
        yield {"name": f"foreign.{name}.by_hand", "value": by_hand, "unit": "of the range"}
        if os.environ.get("PALPATE_FOREIGN_BY_HAND"):
            continue
        row = gap_table.row_of(_diagnosed(recording, HOUSE / "build" / "foreign" / name), by_hand)
        rows.append(row)
        yield {"name": f"foreign.{name}.amended_over_by_hand", "value": row.ratio, "unit": "error / error", "goal": GOAL}
    if rows:
        print(gap_table.markdown(rows), file=sys.stderr, flush=True)
        median = gap_table.median_ratio(rows)
        yield {"name": "foreign.median", "value": median, "unit": "error / error", "goal": MEDIAN_GOAL}


def command(arguments: list[str]) -> int:
    """Do what the options behind ``python -m benchmarks foreign`` say."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks foreign", description="Foreign data, one table.")
    parser.add_argument("--write", type=Path, metavar="DIR", required=True, help="write the rigs and the errors by hand")
    folder = parser.parse_args(arguments).write
    lines = ["rig,error"]
    for name, recording, by_hand in _sets():
        path = recording.write(folder / name)
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(r'^name = ".*"$', f'name = "{name}"', text, count=1, flags=re.MULTILINE), encoding="utf-8")
        lines.append(f"{name},{by_hand:.6g}")
    (folder / "by-hand.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"palpate gap-table {folder}/*/rig.toml --by-hand {folder}/by-hand.csv")
    return 0


def _sets() -> Iterator[tuple[str, Recording, float]]:
    """Yield name, recordings and error by hand of each set whose recordings are there."""
    data = Path(os.environ.get("PALPATE_REAL_DATA", HOUSE.parent / "shared" / "data"))
    if not data.is_dir():
        print(f"No recordings in {data}: name their folder in PALPATE_REAL_DATA.", file=sys.stderr)
        return
    for name in os.environ.get("PALPATE_FOREIGN_SETS", ",".join(FOREIGN)).split(","):
        try:
            recording = FOREIGN[name].read(data)
        except FileNotFoundError as error:
            print(f"'{name}' is left out: {error.filename} is missing.", file=sys.stderr)
            continue
        yield name, recording, _check_error(recording, predict_by_hand(FOREIGN[name].by_hand, recording))
