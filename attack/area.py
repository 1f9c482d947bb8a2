# SPDX-License-Identifier: GPL-3.0-or-later
"""What an area of the attack is: cases that can be told apart by a name, and what became of each."""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

CLEAR, TRACEBACK, WRONG, LOST, HUNG = OUTCOMES = ("clear", "traceback", "wrong", "lost", "hung")
"""What becomes of a case: as promised; an internal error or a crash; a wrong result without a word; something of the user's is
gone; no end in time."""


@dataclass(frozen=True)
class Case:
    """One try.

    Attributes
    ----------
    name : str
        Unique in its area; with the seed it says all that is needed to repeat the try.
    data : dict
        JSON values for the area, and for whoever reads a finding.
    """

    name: str
    data: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """What became of a case: one of :data:`OUTCOMES`, what was seen, and files that show it."""

    kind: str
    seen: str = ""
    evidence: tuple[Path, ...] = ()


class Area:
    """A group of cases.

    Parameters
    ----------
    seed : int
    tries : int
        About how many cases are wanted.
    folder : Path
        An empty folder for whatever the cases need.
    """

    short, long = 100, 1000
    """Tries of a short run and of a whole one."""

    def __init__(self, seed: int, tries: int, folder: Path):
        self.seed, self.tries, self.folder = seed, tries, folder

    def cases(self) -> Iterator[Case]:
        """Yield the cases; the same seed and number of tries give the same ones."""
        raise NotImplementedError

    def attempt(self, case: Case) -> Outcome:
        """Try one case."""
        raise NotImplementedError

    def close(self) -> None:
        """End processes and unmount what was mounted."""


class Tally:
    """Counts outcomes and writes down findings.

    Parameters
    ----------
    area : str
    seed, tries : int
        As of the area, to repeat a case.
    folder : Path
        Each finding gets a folder in it, with ``finding.json`` and the evidence.
    """

    def __init__(self, area: str, seed: int, tries: int, folder: Path):
        self._area, self._seed, self._tries, self._folder = area, seed, tries, folder
        self.counts = dict.fromkeys(OUTCOMES, 0)

    def add(self, case: Case, outcome: Outcome) -> None:
        """Count what became of a case."""
        self.counts[outcome.kind] += 1
        if outcome.kind == CLEAR:
            return
        place = self._folder / self._area / f"{sum(self.counts.values()) - 1:05d}-{outcome.kind}"
        place.mkdir(parents=True, exist_ok=True)
        numbers = f"--seed {self._seed} --tries {self._tries}"
        finding = {
            "area": self._area,
            "case": case.name,
            "outcome": outcome.kind,
            "seen": outcome.seen,
            "repeat": f"python -m attack {self._area} {numbers} --case {shlex.quote(case.name)}",
            "data": case.data,
        }
        (place / "finding.json").write_text(json.dumps(finding, indent=2) + "\n", encoding="utf-8", errors="backslashreplace")
        for path in outcome.evidence:
            if path.is_dir():
                shutil.copytree(path, place / path.name, symlinks=True, dirs_exist_ok=True)
            elif path.is_file():
                shutil.copy2(path, place / path.name)

    def line(self) -> dict[str, Any]:
        """Return the figures of the area."""
        return {"area": self._area, "tried": sum(self.counts.values()), **self.counts}

    def has_findings(self) -> bool:
        """Return True if anything else than :data:`CLEAR` was counted."""
        return any(self.counts[kind] for kind in OUTCOMES if kind != CLEAR)
