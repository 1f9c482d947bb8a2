# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands of Palpate in processes of their own."""

from __future__ import annotations

import subprocess
import sys

LONGEST = 300.0
"""Seconds until a command counts as hanging; a busy machine may have to compile the solver first."""


def command(*words: object) -> list[str]:
    """Return what runs ``palpate`` with these words."""
    return [sys.executable, "-m", "palpate.commands", *map(str, words)]


def run_command(*words: object) -> subprocess.CompletedProcess[str]:
    """Run ``palpate`` with these words."""
    return subprocess.run(command(*words), capture_output=True, text=True, timeout=LONGEST, check=False)


def assert_succeeds(*words: object) -> str:
    """Run ``palpate`` with these words; return what it says, of which nothing is an error."""
    finished = run_command(*words)
    assert (finished.returncode, finished.stderr) == (0, "")
    return finished.stdout
