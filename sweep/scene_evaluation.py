# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a scene again with other values of its properties, in a Blender of its own that ends with it.

A process that computes runs never loads Blender: what a scene leaves in its memory, or what ends it, concerns one run.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.errors import SceneError
from ..core.io.hidden_folder import temporary_folder
from ..core.io.scenario_npz import load_scenario
from ..core.model.scenario import Scenario
from ..core.study.scene_property import write_overrides
from ..core.study.study_file import SCENES, at_rate

SCRIPTS = REFUSE, IGNORE, ALLOW = ("refuse", "ignore", "allow")
"""Treatment of the Python in a .blend; the command line's --ignore-scripts and --allow-scripts."""
MOST_KEPT = 4
"""Scenarios that are kept: the runs of a grid, whose last number changes fastest, share them."""
_COMMANDS = f"{__package__.rpartition('.')[0]}.commands"


def read_blend(blend: Path, target: Path, scripts: str, *more: str, limit: float | None = None) -> None:
    """Let a Blender write the scenario of a .blend.

    Parameters
    ----------
    blend, target : Path
        The target ends with ``.npz``.
    scripts : str
        One of :data:`SCRIPTS`.
    *more : str
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


class SceneReader:
    """Reads the scenes of a study with the values of runs.

    Parameters
    ----------
    folder : Path
        Of the study.
    scripts : str
        One of :data:`SCRIPTS`.
    """

    def __init__(self, folder: Path, scripts: str = REFUSE):
        self._folder, self._scripts = folder, scripts
        self._kept: OrderedDict[str, Scenario] = OrderedDict()

    def read(self, scene: str, values: Mapping[str, Any], fps: float | None = None, limit: float | None = None) -> Scenario:
        """Return the scenario of a scene with other values of its properties, at another frame rate if one is given.

        Raises
        ------
        SceneError
            See :func:`read_blend`.
        FileError
            A file cannot be written or read.
        """
        key = json.dumps([scene, sorted(values.items())])
        if key not in self._kept:
            scenes = self._folder / SCENES
            with temporary_folder(scenes, "scene") as place:
                overrides, target = place / "overrides.toml", place / "scene.npz"
                write_overrides(overrides, values)
                read_blend(scenes / f"{scene}.blend", target, self._scripts, "--overrides", str(overrides), limit=limit)
                self._kept[key] = at_rate(load_scenario(target), fps)
        self._kept.move_to_end(key)
        while len(self._kept) > MOST_KEPT:
            self._kept.popitem(last=False)
        return self._kept[key]
