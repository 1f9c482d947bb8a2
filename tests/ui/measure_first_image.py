# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how long a fresh profile takes from enabling the extension to the first tactile image in the window.

    python tests/ui/measure_first_image.py ZIP [--blender 5.2] [--runs 3]

The zip must be for the Python of that Blender. Each run prints a JSON line with seconds by the clock and of processor time.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "tools")]

import conftest  # noqa: E402
import provision_blender  # noqa: E402


def main() -> None:
    """Play roads/first_image.py, each time with a new user folder."""
    parser = argparse.ArgumentParser(description="Measure the first tactile image in a fresh profile.")
    parser.add_argument("zip", type=Path, help="the extension, as tools/build_zip.py makes it")
    parser.add_argument("--blender", choices=list(provision_blender.DEBIAN), default=provision_blender.DEFAULT)
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()
    root = provision_blender.provision(args.blender)
    for _ in range(args.runs):
        with tempfile.TemporaryDirectory() as folder:
            blender = conftest.RealBlender(root, Path(folder), HERE)
            blender.install(args.zip, enable=False)
            result = blender.play(HERE / "roads" / "first_image.py", Path(folder) / "first_image", timeout=900.0)
            rounded = {name: [round(value, 1) for value in pair] for name, pair in result["values"].items()}
            print(json.dumps({"blender": result["blender"], "zip": args.zip.name, **rounded}), flush=True)


if __name__ == "__main__":
    main()
