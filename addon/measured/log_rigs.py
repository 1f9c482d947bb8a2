# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig from logs, as the button in the panel makes it: with the answers in the rig's folder, or with a template of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...core.errors import PalpateError
from ..authoring import exchange

if TYPE_CHECKING:
    from ...core.gap.logs.guess import Proposal


def make(context, obj, paths, folder: Path, accept: bool, replies: Sequence[str] | None = None):
    """Write a rig and a picture of its recordings; return the rig that was written and the path of the picture.

    The grid of texels is that of the sensor `obj`, where it has as many texels as the logs. `replies` are those to the open
    questions, in turn; None where nobody can be asked.

    Raises
    ------
    OpenQuestion
        There is no reply to this question yet.
    FileError
        A log cannot be used, or questions are open: then `answers.toml` in the folder asks them.
    """
    from ...core.gap.logs.answers import ANSWERS_NAME, PLOT_NAME, answers_or_template, read_answers
    from ...core.gap.logs.log_file import read_log
    from ...core.gap.logs.new_rig import write_rig
    from ...core.gap.logs.preview import plot_rig
    from ...core.gap.logs.proposal import propose
    from ...core.gap.logs.questions import answered
    from ...core.jobs import run_job

    logs = [read_log(path) for path in paths]
    if (folder / ANSWERS_NAME).exists():
        answers = read_answers(folder / ANSWERS_NAME)
    else:
        proposal = _with_grid_of(context, obj, propose(logs, folder.parent.name or "rig"))
        proposal = proposal.confirmed() if accept else proposal
        proposal = proposal if replies is None else answered(proposal, replies)
        answers = answers_or_template(proposal, folder, "with a text editor, and choose the logs again")
    written = run_job(write_rig(logs, answers, folder))
    plot = folder / PLOT_NAME
    plot_rig(written.rig, plot)
    return written, plot


def _with_grid_of(context, obj, proposal: Proposal) -> Proposal:
    """Return a proposal with rows, columns and pitch of a sensor, if it has as many texels and no array says others."""
    try:
        known = exchange.grid_table(context, obj).get("grid")
    except PalpateError:
        return proposal  # it has no texels
    grid = proposal.of("sensor", "grid")
    counts = [len(one.columns) for one in proposal.guesses if one.word == "texel"]
    if known is None or not counts or known["rows"] * known["columns"] != counts[0]:
        return proposal
    if any(grid.value[word] not in ("?", known[word]) for word in ("rows", "columns")):
        return proposal
    return proposal.with_guess(replace(grid, value=known, reason=f"that of '{obj.name}' in the scene", is_thin=False))
