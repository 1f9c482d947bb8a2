# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged files of every format, through every reader: one sentence, or a whole result; never a traceback, never nonsense.

Bakes are also damaged in the ways of :mod:`.damaged_bakes` and read, exported in each format and drawn.
"""

from __future__ import annotations

import base64
import importlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .area import CLEAR, HUNG, TRACEBACK, Area, Case, Outcome
from .worker import Crashed, Failed, Hung, Worker

LONGEST = 60.0
"""Seconds for one input: the largest of them is a few kilobytes."""
BLOCK = 50
"""Inputs that the worker reads in one call, which is quicker than one by one."""
BAKES_SHARE = 0.25
"""Part of all inputs that are damaged bakes."""


class Readers(Area):
    """Damaged files."""

    short, long = 1200, 6000
    source = "damaged_files"
    """Module with the readers."""
    with_bakes = True
    """Whether bakes are damaged, too."""

    def __init__(self, seed: int, tries: int, folder: Path):
        super().__init__(seed, tries, folder)
        self._worker = Worker(folder)
        self._answers: dict[str, Outcome] = {}

    def close(self) -> None:
        self._worker.close()

    def cases(self) -> Iterator[Case]:
        names = self._worker.call("readers:names", source=self.source)
        number = round(self.tries * (1 - BAKES_SHARE * self.with_bakes) / len(names))
        for name in names:
            yield from self._in_blocks("readers:read", f"{self.source}:{name}", number)
        if not self.with_bakes:
            return
        kinds = self._worker.call("readers:kinds")
        ways = self._worker.call("readers:number_of_ways")
        per_kind = min(ways, round(self.tries * BAKES_SHARE / len(kinds)))
        for kind in kinds:
            yield from self._in_blocks("readers:read_bake", kind, per_kind)

    def attempt(self, case: Case) -> Outcome:
        return self._answers.pop(case.name)

    def _in_blocks(self, function: str, what: str, number: int) -> Iterator[Case]:
        """Let the worker read inputs, some in one call, and one by one where it does not come back."""
        for first in range(0, number, BLOCK):
            last = min(first + BLOCK, number)
            found = self._call(function, what, number, first, last)
            if found is None:
                found = []
                for i in range(first, last):
                    found += self._call(function, what, number, i, i + 1) or [self._gone]
            for i, (kind, words, files) in enumerate(found, start=first):
                case = Case(f"{what.removeprefix(f'{self.source}:')}: {i}", {"files": files})
                self._answers[case.name] = Outcome(kind, words)
                yield case

    def _call(self, function: str, what: str, number: int, first: int, last: int) -> list[Any] | None:
        try:
            return self._worker.call(
                function, LONGEST + 2.0 * (last - first), name=what, number=number, seed=self.seed, first=first, last=last
            )
        except Hung as error:
            self._gone = [HUNG, str(error), {}]
        except (Crashed, Failed) as error:
            self._gone = [TRACEBACK, str(error), {}]
        return None


# --- in the worker


def names(source: str) -> list[str]:
    """Return the names of all readers of a module."""
    return list(_readers(source))


def _readers(source: str) -> dict[str, Any]:
    return importlib.import_module(f"{__package__}.{source}").readers()


def read(name: str, number: int, seed: int, first: int, last: int) -> list[list[Any]]:
    """Let a reader, ``module:name``, read some of its inputs; return outcome, words and, for a finding, the files."""
    from .damaged_files import inputs_of, judge

    source, _, short = name.partition(":")
    reader = _readers(source)[short]
    key = (name, number, seed)
    if key not in _drawn:
        _drawn.clear()
        _drawn[key] = inputs_of(reader, number, seed)
    found = []
    for files in _drawn[key][first:last]:
        kind, words = judge(reader, files)
        kept = {path: base64.b64encode(content).decode() for path, content in files.items()} if kind != CLEAR else {}
        found.append([kind, words, kept])
    return found


_drawn: dict[tuple[str, int, int], list[dict[str, bytes]]] = {}


def kinds() -> list[str]:
    """Return what is done with damaged bakes."""
    from palpate.core.export.registry import exporters

    return ["older bake", "bake", *(f"export {name}" for name in exporters())]


def number_of_ways() -> int:
    """Return how many ways of damaging a bake there are."""
    from .damaged_bakes import ways

    return len(ways())


def read_bake(name: str, number: int, seed: int, first: int, last: int) -> list[list[Any]]:
    """Damage bakes in some ways, and read or export them."""
    import random
    import tempfile

    from palpate.core.export.registry import export
    from palpate.core.io import bake_reader
    from palpate.core.jobs.job_runner import run_job

    from .damaged_bakes import HARMLESS, judge, ways
    from .sample_bake import write_bake

    found = []
    older = name == "older bake"
    possible = [way for way in ways() if not (older and way.needs)]  # older bakes lack the file
    for way in random.Random(seed).sample(possible, min(number, len(possible)))[first:last]:
        with tempfile.TemporaryDirectory(prefix="palpate-attack-") as folder:
            bake, out = Path(folder) / "bake", Path(folder) / "out"
            write_bake(bake, checksums=not older)
            way.damage(bake)

            def use(bake: Path = bake, out: Path = out) -> None:
                whole = bake_reader.read_bake(bake)
                if name.startswith("export"):
                    run_job(export(whole, name.removeprefix("export "), out))

            kind, words = judge(way, use)
            shutil.rmtree(out, ignore_errors=True)
        found.append([CLEAR if kind == HARMLESS else kind, f"{way.name}: {words}", {}])
    return found


AREA = Readers
