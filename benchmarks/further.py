# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on further public recordings, beside a physical model made by hand and a learned one (benchmarks/RESULTS.md).

The repositories (``_further/sources.py``) are looked for in the folder ``PALPATE_FURTHER_DATA``, each in a folder of its own
name; ``PALPATE_FURTHER_SETS`` names some of the sets. Rigs, reports and pictures go to build/further/.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._further.handmade import HANDMADE, predict_by_hand, responses
from ._further.learned import predict_learned
from ._further.recordings import FURTHER
from ._further.sources import SOURCES
from ._recordings import Recording
from .real import _diagnosed

HOUSE = Path(__file__).resolve().parent.parent
GOAL = 1.3
"""Largest error on the check recordings, in units of that of the model made by hand."""


def run() -> Iterator[dict]:
    """Yield, for each set, the error on check recordings by the amended model over that by the model made by hand."""
    data = Path(os.environ.get("PALPATE_FURTHER_DATA", HOUSE.parent / "shared" / "further"))
    if not data.is_dir():
        print(f"No recordings in {data}: name their folder in PALPATE_FURTHER_DATA.", file=sys.stderr)
        return
    for name in os.environ.get("PALPATE_FURTHER_SETS", ",".join(FURTHER)).split(","):
        folder = data / SOURCES[name].folder
        if folder.is_dir():
            yield from _figures_of(name, FURTHER[name](folder))
        else:
            print(f"{name}: clone https://github.com/{SOURCES[name].repository} into {folder}.", file=sys.stderr)


def _figures_of(name: str, recording: Recording) -> Iterator[dict]:
    from palpate.core.gap.report import sentences, summary
    from palpate.core.gap.report.comparison import gap_errors

    by_hand = _check_error(recording, predict_by_hand(HANDMADE[name], recording))
    learned = _check_error(recording, predict_learned(recording))
    print(f"{name}: by hand {by_hand:.2%}, learned {learned:.2%} of the range on check", file=sys.stderr, flush=True)
    folder = HOUSE / "build" / "further" / name
    result = _diagnosed(recording, folder)
    errors = gap_errors(result)
    for _ in summary.write_report(result, folder, errors):
        pass
    said = ", ".join(f"{one.name} {one.form} {one.confidence:.2f}" for one in result.findings) or "nothing"
    print(f"{name}: {sentences.headline(result, errors)}", file=sys.stderr, flush=True)
    print(f"{name}: {result.verdict}: {said}", file=sys.stderr, flush=True)
    base, amended = (
        _check_error(recording, [_predicted(p, one.model, recording) for p in result.predictors])
        for one in (result.base, result.best)
    )
    print(f"{name}: base {base:.2%}, amended {amended:.2%} of the range on check", file=sys.stderr, flush=True)
    yield {"name": f"further.{name}.amended_over_by_hand", "value": amended / by_hand, "unit": "error / error", "goal": GOAL}
    yield {"name": f"further.{name}.learned_over_by_hand", "value": learned / by_hand, "unit": "error / error"}


def _predicted(predictor: Any, model: Any, recording: Recording) -> np.ndarray:
    response = predictor.predict(model)
    has_readings = any(column.startswith("texel_") for column in recording.trials[0][2])
    return response.reading if has_readings else response.force[:, :1]


def _check_error(recording: Recording, predicted: Sequence[np.ndarray]) -> float:
    """Root mean square of measured minus predicted in the check recordings, as a share of the range of all."""
    measured = [responses(columns) for _, _, columns in recording.trials]
    low, high = min(float(np.nanmin(m)) for m in measured), max(float(np.nanmax(m)) for m in measured)
    squares = [
        ((m - p) ** 2).ravel()
        for (_, use, _), m, p in zip(recording.trials, measured, predicted, strict=True)
        if use == "check"
    ]
    return float(np.sqrt(np.nanmean(np.concatenate(squares)))) / (high - low)
