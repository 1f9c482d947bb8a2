# SPDX-License-Identifier: GPL-3.0-or-later
"""Run benchmark groups and print one JSON line per figure.

A group is a module in this folder with `run()`, a generator of dictionaries:
`name`, `value` and `unit`, and, where a peer was measured in turn with it, `peer`, `peer_value`, `ratio` and
`goal`. Nothing is asserted here; a figure is a median and a reader judges it. Options behind the name of one group go to its
`command(arguments)`, if it has one.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import pkgutil
import sys
from collections.abc import Iterator

REQUIRED = {"name", "value", "unit"}
OPTIONAL = {"peer", "peer_value", "ratio", "goal"}


def groups() -> list[str]:
    """Names of the groups there are, in alphabetical order."""
    package = importlib.import_module(__package__)
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))


def figures(group: str) -> Iterator[dict]:
    """Run one group; check each figure's shape before it is passed on."""
    for figure in importlib.import_module(f"{__package__}.{group}").run():
        keys = set(figure)
        if not keys >= REQUIRED or keys - REQUIRED - OPTIONAL:
            raise ValueError(f"benchmark group {group!r} yielded {sorted(keys)}; see benchmarks/__main__.py")
        if not math.isfinite(figure["value"]):
            raise ValueError(f"benchmark {figure['name']!r} is {figure['value']}, not a number")
        yield figure


def main(argv: list[str] | None = None) -> int:
    """Run the groups named on the command line, or all of them."""
    known = groups()
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="One JSON line per figure.")
    listed = ", ".join(known) or "none yet"
    parser.add_argument("group", nargs="*", help=f"what to measure (default: all): {listed}")
    if argv is None:
        argv = sys.argv[1:]
    if argv and argv[0] in known and any(word.startswith("-") for word in argv[1:]):
        command = getattr(importlib.import_module(f"{__package__}.{argv[0]}"), "command", None)
        if command is not None:
            return int(command(argv[1:]))
    chosen = parser.parse_args(argv).group or known
    for group in chosen:
        if group not in known:
            parser.error(f"no benchmark group {group!r}; there are: {listed}")
    if not chosen:
        print("There are no benchmark groups yet.", file=sys.stderr)
    for group in chosen:
        for figure in figures(group):
            print(json.dumps(figure), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
