# SPDX-License-Identifier: GPL-3.0-or-later
"""A study of presses that take milliseconds, and what two equal studies share."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from study_scenes import tiny_scene

from palpate.core.io.scenario_npz import save_scenario
from palpate.core.model.scenario import Scenario
from palpate.sweep.parts import Parts
from palpate.sweep.scripts import ALLOW
from palpate.sweep.study_folder import OpenStudy, open_study

STUDY = """format = "palpate-sweep/1"
name = "small presses"
scene = "pad.npz"
design = "random"
samples = {runs}
seed = {seed}
fps = 100
[vary]
"Pad.mus" = {{ uniform = [0.3, 1.0] }}
{more}
[press]
depth = {{ uniform = [0.2e-3, 2e-3] }}
speed = 0.1
hold = {hold}
"""
FAILING = '"Pad.mud" = { choice = [0.2, 0.25, 2.0] }'
"""Every third value of the friction is above that at rest, which no sensor has: the run fails."""


def scenario() -> Scenario:
    """The scene of the studies that are varied, under the name of its file."""
    return replace(tiny_scene(), name="pad")


def write_study(folder: Path, runs: int, seed: int = 1, fails: bool = False, more: str = "", hold: float = 0.0) -> Path:
    """Write scene and study into a folder that is made, and return the study's file; presses are held for `hold` seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    save_scenario(folder / "pad.npz", scenario())
    file = folder / "study.toml"
    file.write_text(STUDY.format(runs=runs, seed=seed, more=FAILING if fails else more, hold=hold), encoding="utf-8")
    return file


def begun(file: Path) -> OpenStudy:
    """Open a study in the folder ``out`` beside its file."""
    return open_study(file, file.parent / "out", ALLOW)


def rows_of(folder: Path) -> list[dict[str, Any]]:
    """Return the runs that the parts of a study have, with all their numbers, in the order of the design, but for times."""
    rows = [row for piece in Parts(folder).pieces() for row in piece.to_pylist()]
    return [{name: value for name, value in row.items() if name != "seconds" and value not in (None, [])} for row in rows]


def tree(folder: Path) -> dict[str, str]:
    """Return a hash of each file below a folder, and the word "folder" of each folder, by relative path."""
    return {
        path.relative_to(folder).as_posix(): "folder" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
    }
