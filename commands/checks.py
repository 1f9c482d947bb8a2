# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks before work begins, so that a command fails at once and not after hours."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from ..core.errors import FileError
from ..core.io.bake_reader import Bake
from ..core.io.file_writing import require_name


def outputs_are_no_inputs(outputs: Iterable[str | os.PathLike], inputs: Iterable[str | os.PathLike]) -> None:
    """Raise FileError if a file that will be written is one that is read, also through a link."""
    inputs = list(inputs)
    for output in outputs:
        require_name(output)
        for source in inputs:
            with suppress(OSError):  # one of them does not exist
                if os.path.samefile(output, source):
                    raise FileError(f"'{source}' is read and would be overwritten: write to another place.")


def folder_is_no_bake(folder: str | os.PathLike, bake: Bake) -> None:
    """Raise FileError if a folder to export to is the bake folder, or a sensor's folder in it."""
    require_name(folder)
    target = Path(os.path.realpath(folder))
    for sensor_folder in bake.folders.values():
        own = Path(os.path.realpath(sensor_folder))
        if target in (own.parent, own) or own in target.parents:
            raise FileError(f"'{folder}' holds the bake itself: give another folder with --out.")
