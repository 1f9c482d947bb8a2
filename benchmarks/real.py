# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on published recordings of real sensors: the family it names, and by how much the gap shrinks.

The recordings are looked for in the folder ``PALPATE_REAL_DATA`` (../shared/data beside the checkout); ``PALPATE_REAL_SETS``
names some of them. Rigs, reports and pictures go to build/real/. docs/gap-real.md says what each set is known to contain.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ._injected import CHANGES, with_effect
from ._recordings import SETS, Recording

HOUSE = Path(__file__).resolve().parent.parent
GOALS = {
    "insole-counts": 0.55,
    "insole": 0.55,
    "tube": 0.35,
    "tube-by-place": 0.35,
    "adhesive": 0.5,
    "foam": None,
    "brake": 0.4,
}
"""Gap on the held-out recordings after, as a share of that before."""


INJECTED = ("insole", "tube", "adhesive")
"""Sets on top of which known effects are put."""


def run() -> Iterator[dict]:
    """Yield, for each set, the error on held-out recordings with what was found, as a share of that of the refitted base; then
    how many of the effects that were put on top of real recordings are named.
    """
    data = Path(os.environ.get("PALPATE_REAL_DATA", HOUSE.parent / "shared" / "data"))
    if not data.is_dir():
        print(f"No recordings in {data}: name their folder in PALPATE_REAL_DATA.", file=sys.stderr)
        return
    chosen = os.environ.get("PALPATE_REAL_SETS", ",".join([*SETS, "injected"])).split(",")
    for name in chosen:
        if name != "injected":
            yield from _found_in(name, SETS[name](data))
    if "injected" in chosen:
        yield from _recall(data)


def _found_in(name: str, recording: Recording) -> Iterator[dict]:
    from palpate.core.gap import report

    folder = HOUSE / "build" / "real" / name
    result = _diagnosed(recording, folder)
    for _ in report.write(result, folder):
        pass
    gap = report.summary(result)["gap"]
    print(f"{name}: {report.headline(result)}", file=sys.stderr, flush=True)
    found = "+".join(one.name for one in result.named) or result.verdict.replace(" ", "_")
    for use in ("fit", "check"):
        share = gap["after"][use] / gap["before"][use]
        figure = {"name": f"real.{name}.{found}.{use}", "value": share, "unit": "gap after / before"}
        yield figure | ({"goal": GOALS[name]} if use == "check" and GOALS[name] else {})
    yield from _friction(name, result)


def _friction(name: str, result: Any) -> Iterator[dict]:
    """What the base model's own friction closes, of the error of a sensor without any: it is in every base, and no effect."""
    from palpate.core.gap.compare import nrmse, without_friction

    for use, without in (without_friction(result) or {}).items():
        own = nrmse(result.of(use), result.base.model, result.full)
        figure = {"name": f"real.{name}.friction_of_the_base.{use}", "value": own / without, "unit": "gap with / without"}
        yield figure | ({"goal": GOALS[name]} if use == "check" else {})


def _recall(data: Path) -> Iterator[dict]:
    """Only effects that were not named before are put in, and each counts as found when it then is, and for sure."""
    from palpate.core.gap import report

    found = []
    for name in INJECTED:
        plain = SETS[name](data)
        before = {one.name for one in _diagnosed(plain, HOUSE / "build" / "real" / name).named}
        for effect in sorted(set(CHANGES) - before):
            folder = HOUSE / "build" / "real" / f"{name}-{effect}"
            result = _diagnosed(with_effect(plain, effect), folder)
            found.append(any(one.name == effect and one.confidence >= report.SURE for one in result.named))
            said = ", ".join(f"{one.name} {one.confidence}" for one in result.named) or result.verdict
            print(f"{name} with {effect}: {said}", file=sys.stderr, flush=True)
    yield {"name": "real.injected.recall", "value": sum(found) / len(found), "unit": "share", "goal": 0.85}


def _diagnosed(recording: Recording, folder: Path) -> Any:
    from palpate.core.gap.diagnose import Diagnosis, diagnose
    from palpate.core.gap.rig import read_rig

    *_, result = diagnose(read_rig(recording.write(folder / "rig")))
    assert isinstance(result, Diagnosis)
    return result
