# SPDX-License-Identifier: GPL-3.0-or-later
"""The output folder of a study, and how many runs it has by the names of its parts, which any Python can read.

::

    study.toml                    the study, with the version and the digests of its scenes
    scenes/                       scenes as the solver sees them, copies of .blend and mesh files
    parts/<first run>-<content>-<done>-<failed>.parquet
                                  a batch of runs: values, metrics and frames of those that are done, why others failed
    layouts/<digest>/             what the frames of many runs have in common: features and texels
    runs/<digest>/                files of a run, where the study asks for recordings or images, or has a job
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

STUDY_NAME = "study.toml"
SCENES, PARTS, LAYOUTS, RUNS = "scenes", "parts", "layouts", "runs"
_NAME = re.compile(r"\d+-[0-9a-f]{16}-(\d+)-(\d+)\.parquet")


def part_name(first: int, content: str, done: int, failed: int) -> str:
    """Return the name of a part: the index of its first run, 16 hexadecimal digits of what it has, and its counts."""
    return f"{first:07d}-{content}-{done}-{failed}.parquet"


def part_files(folder: Path) -> list[Path]:
    """Return the parts of a study in the order of their first runs; files that are being written are none."""
    return [folder / PARTS / name for name, _ in sorted(_found(folder))]


def counted_runs(folder: Path) -> tuple[int, int]:
    """Return how many runs are done and failed; one that was computed twice counts twice."""
    counts = [(int(match[1]), int(match[2])) for _, match in _found(folder)]
    return sum(done for done, _ in counts), sum(failed for _, failed in counts)


def _found(folder: Path) -> Iterator[tuple[str, re.Match[str]]]:
    with suppress(FileNotFoundError):
        for name in os.listdir(folder / PARTS):
            match = _NAME.fullmatch(name)
            if match:
                yield name, match
