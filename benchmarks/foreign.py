# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on openly licensed recordings of other people's sensors, beside a model by hand: one table.

The recordings are looked for in the folder ``PALPATE_REAL_DATA`` (../shared/data beside the checkout);
``PALPATE_FOREIGN_SETS`` names some of them. ``PALPATE_FOREIGN_BY_HAND=1`` fits the models by hand alone, which takes seconds.
docs/skins.md has the table.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from ._foreign import FOREIGN, ForeignSet
from ._further.handmade import predict_by_hand
from .further import GOAL, _check_error, _predicted
from .real import _diagnosed

HOUSE = Path(__file__).resolve().parent.parent


def run() -> Iterator[dict]:
    """Yield, for each set, the error on check recordings by the amended model over that by the model made by hand."""
    data = Path(os.environ.get("PALPATE_REAL_DATA", HOUSE.parent / "shared" / "data"))
    if not data.is_dir():
        print(f"No recordings in {data}: name their folder in PALPATE_REAL_DATA.", file=sys.stderr)
        return
    for name in os.environ.get("PALPATE_FOREIGN_SETS", ",".join(FOREIGN)).split(","):
        yield from _figures_of(name, FOREIGN[name], data)


def _figures_of(name: str, one: ForeignSet, data: Path) -> Iterator[dict]:
    recording = one.read(data)
    by_hand = _check_error(recording, predict_by_hand(one.by_hand, recording))
    yield {"name": f"foreign.{name}.by_hand", "value": by_hand, "unit": "of the range"}
    if os.environ.get("PALPATE_FOREIGN_BY_HAND"):
        return
    result = _diagnosed(recording, HOUSE / "build" / "foreign" / name)
    base, amended = (
        _check_error(recording, [_predicted(p, own.model, recording) for p in result.predictors])
        for own in (result.base, result.best)
    )
    said = ", ".join(f"{found.name} {found.confidence:.2f}" for found in result.findings) or result.verdict
    print(f"| {name} | {one.kind} | {base:.2%} | {amended:.2%} | {by_hand:.2%} | {said} |", file=sys.stderr, flush=True)
    yield {"name": f"foreign.{name}.amended_over_by_hand", "value": amended / by_hand, "unit": "error / error", "goal": GOAL}
