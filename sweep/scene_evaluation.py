# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a scene again with other values of its properties, in a Blender of its own that ends with it.

A process that computes runs never loads Blender: what a scene leaves in its memory, or what ends it, concerns one run.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.errors import SceneError

SCRIPTS = REFUSE, IGNORE, ALLOW = ("refuse", "ignore", "allow")
"""Treatment of the Python in a .blend; the command line's --ignore-scripts and --allow-scripts."""
_COMMANDS = f"{__package__.rpartition('.')[0]}.commands"


def read_blend(blend: Path, target: Path, scripts: str, more: Sequence[str] = (), limit: float | None = None) -> None:
    """Let a Blender write the scenario of a .blend.

    Parameters
    ----------
    blend, target : Path
        The target ends with ``.npz``.
    scripts : str
        One of :data:`SCRIPTS`.
    more : sequence of str
        Further words for ``palpate bake``.
    limit : float, optional
        Seconds that this may take.

    Raises
    ------
    SceneError
        The scene makes no run, the limit is reached, or this Python has no Blender.
    """
    command = [sys.executable, "-P", "-m", _COMMANDS, "bake", str(blend), "--scenario", str(target), *more]
    command += [f"--{scripts}-scripts"] if scripts != REFUSE else []
    words: dict[str, Any] = {"stdin": subprocess.DEVNULL, "capture_output": True, "text": True, "errors": "replace"}
    try:
        finished = subprocess.run(command, **words, check=False, timeout=limit)
    except subprocess.TimeoutExpired as error:
        raise SceneError(f"Blender read '{blend.name}' for longer than the limit of {limit:g} s: raise run_limit.") from error
    if finished.returncode:
        said = [line for line in finished.stderr.strip().splitlines() if line.strip()]
        if finished.returncode < 0 or not said:
            said = [f"Blender ended with status {finished.returncode} while it read '{blend.name}': open the file in Blender."]
        raise SceneError(said[-1].removeprefix("palpate bake: "))
