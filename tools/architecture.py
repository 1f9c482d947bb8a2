# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the rooms of the extension from its imports, or count what makes the source easy or hard to read.

``python tools/architecture.py`` writes docs/images/architecture.svg; ``--png FILE`` writes another picture of the same.
``--counts [FOLDER]`` prints counts of this or another checkout, and with ``--list`` every place that was counted.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from architecture_counts import count, print_counts
from architecture_picture import PICTURE, draw, rooms_and_imports
from import_graph import ROOT, Graph


def main(argv: list[str] | None = None) -> int:
    """Draw or count."""
    parser = argparse.ArgumentParser(prog="python tools/architecture.py", description=__doc__)
    parser.add_argument("--counts", nargs="?", const=ROOT, type=Path, metavar="FOLDER", help="count instead of drawing")
    parser.add_argument("--list", action="store_true", help="with --counts: name every place")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw into this file instead")
    arguments = parser.parse_args(argv)
    if arguments.counts is not None:
        print_counts(count(arguments.counts.resolve()), arguments.list)
    else:
        draw(rooms_and_imports(Graph.read()), arguments.png or PICTURE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
