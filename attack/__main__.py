# SPDX-License-Identifier: GPL-3.0-or-later
"""Attack Palpate and print one JSON line per area: ``python -m attack [AREA…] [--seed N] [--tries N] [--out DIR]``.

Exit status 1 if anything was found. Each finding lies in the output folder with the command that repeats it. With ``SHORT=1``
in the environment all areas together take less than ten minutes.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

from .area import Area, Tally

AREAS = ("faults", "power_cut", "kills", "readers", "logs", "imports", "commands", "numbers", "sweep")
DEFAULT_SEED = 20261122


def main(argv: list[str] | None = None) -> int:
    """Run the areas named on the command line, or all of them."""
    parser = argparse.ArgumentParser(prog="python -m attack", description="One JSON line per area.")
    parser.add_argument("area", nargs="*", help=f"what to attack (default: all): {', '.join(AREAS)}")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED, help="default: %(default)s")
    parser.add_argument("--tries", type=int, help="about how many cases per area (default: as the area needs)")
    parser.add_argument("--case", action="append", help="only this case of the one area; may be given again")
    parser.add_argument("--out", default="build/attack", help="folder for findings (default: %(default)s)")
    parser.add_argument("--scratch", help="folder for what the cases write (default: a temporary one)")
    arguments = parser.parse_args(argv)
    for name in arguments.area:
        if name not in AREAS:
            parser.error(f"no area {name!r}; there are: {', '.join(AREAS)}")
    found = False
    for name in arguments.area or AREAS:
        with tempfile.TemporaryDirectory(prefix="palpate-attack-", dir=arguments.scratch, ignore_cleanup_errors=True) as folder:
            tally = _run(name, arguments, Path(folder))
        print(json.dumps(tally.line()), flush=True)
        found = found or tally.has_findings()
    return int(found)


def _run(name: str, arguments: argparse.Namespace, folder: Path) -> Tally:
    """Try the cases of one area."""
    chosen: type[Area] = importlib.import_module(f"{__package__}.{name}").AREA
    short = os.environ.get("SHORT", "") not in ("", "0")
    area = chosen(arguments.seed, arguments.tries or (chosen.short if short else chosen.long), folder)
    return attack(area, Tally(name, area.seed, area.tries, Path(arguments.out).absolute()), arguments.case)


def attack(area: Area, tally: Tally, only: list[str] | None = None) -> Tally:
    """Try the cases of an area, or only those of some names, and count what became of them."""
    began = time.monotonic()
    try:
        for case in area.cases():
            if only and case.name not in only:
                continue
            tally.add(case, area.attempt(case))
            if sum(tally.counts.values()) % 50 == 0:
                print(f"{tally.line()} {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
    finally:
        area.close()
    return tally


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # processes are ended and disks unmounted then, too
    sys.exit(main())
