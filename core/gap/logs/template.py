# SPDX-License-Identifier: GPL-3.0-or-later
"""The template of the answers that a user completes, in the folder of the rig."""

from __future__ import annotations

import os
from pathlib import Path

from ...io.file_writing import atomic_write, writable_folder
from .answers import Answers, answers_text

ANSWERS_NAME, PLOT_NAME = "answers.toml", "recordings.png"
"""Files beside the rig: the answers, and a picture of what was read."""


def write_template(answers: Answers, folder: str | os.PathLike) -> Path:
    """Write what is proposed and what is asked, and return the path of the file.

    Raises
    ------
    FileError
        It cannot be written.
    """
    path = writable_folder(folder, create=True) / ANSWERS_NAME
    with atomic_write(path) as temporary:
        temporary.write_text(answers_text(answers), encoding="utf-8", newline="\n")
    return path
