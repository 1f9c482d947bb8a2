# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmarks: each module with a `run()` is a group; see `python -m benchmarks --help`."""

import sys
from pathlib import Path

# The scenes and the exact solutions of the tests are measured here too.
_TESTS = str(Path(__file__).resolve().parents[1] / "tests")
if _TESTS not in sys.path:
    sys.path.append(_TESTS)
