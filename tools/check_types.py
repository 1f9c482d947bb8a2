# SPDX-License-Identifier: GPL-3.0-or-later
"""Check the types of the packages that need no Blender: ``python tools/check_types.py``.

Their modules import each other relatively, so mypy has to see the repository as the package ``palpate``, whatever the name of
the folder that it was cloned into: through a link of that name.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("palpate.core", "palpate.api", "palpate.sweep", "palpate.commands")
"""What is checked; what these import of the other packages is read for its types alone."""


def main() -> int:
    """Run mypy and return its exit status."""
    place = ROOT / ".mypy_cache" / "root"
    place.mkdir(parents=True, exist_ok=True)
    link = place / "palpate"
    if not link.is_symlink():
        link.symlink_to(Path("..", ".."), target_is_directory=True)
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(place.parent)]
    command += [word for package in PACKAGES for word in ("-p", package)]
    return subprocess.run(command, cwd=place, env={**os.environ, "MYPYPATH": str(place)}, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
