# SPDX-License-Identifier: GPL-3.0-or-later
"""The template of the answers that a user completes, in the folder of the rig."""

from __future__ import annotations

import os
from pathlib import Path

from ...errors import FileError, counted
from ...io.file_writing import atomic_write, writable_folder
from .answers import Answers, answers_of
from .guess import Proposal

ANSWERS_NAME, PLOT_NAME = "answers.toml", "recordings.png"
"""Files beside the rig: the answers, and a picture of what was read."""


def answers_or_template(proposal: Proposal, folder: str | os.PathLike, advice: str) -> Answers:
    """Write what is proposed and what is asked, so that whatever is refused can be corrected there, and return the answers.

    Parameters
    ----------
    proposal : Proposal
    folder : path
    advice : str
        What to do with the file where questions are open.

    Raises
    ------
    FileError
        A question is open, or the file is there already and would be lost, or it cannot be written.
    """
    path = Path(folder) / ANSWERS_NAME
    questions = proposal.questions
    if path.exists() and questions:
        raise FileError(f"'{path}' has answers already: give it with --answers, or remove it for a new template.")
    if not path.exists():
        with atomic_write(writable_folder(folder, create=True) / ANSWERS_NAME) as temporary:
            temporary.write_text(proposal.text, encoding="utf-8", newline="\n")
    if questions:
        how_many = counted(len(questions), "question")
        raise FileError(f"The logs leave {how_many} open, the first: {questions[0][:-1]}; answer in '{path}', {advice}.")
    return answers_of(proposal)
