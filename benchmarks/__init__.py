# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmarks: each module with a `run()` is a group; see `python -m benchmarks --help`."""

import sys
from pathlib import Path

# The scenes and the exact solutions of the tests are measured here too.
_TESTS = str(Path(__file__).resolve().parents[1] / "tests")
if _TESTS not in sys.path:
    sys.path.append(_TESTS)


def beside(name: str, value: float, unit: str, peer: str, peer_value: float, goal: float | None = None) -> dict:
    """Return the figure of what was measured in turn with a peer; the goal is one of their ratio."""
    figure = {"name": name, "value": value, "unit": unit, "peer": peer, "peer_value": peer_value, "ratio": value / peer_value}
    return figure | ({} if goal is None else {"goal": goal})
