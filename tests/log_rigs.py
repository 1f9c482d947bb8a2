# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs as CSV files, their answers as a user completes them, and the rig that follows."""

import re

from palpate.core.gap.logs.answers import read_answers
from palpate.core.gap.logs.log_file import read_log
from palpate.core.gap.logs.new_rig import write_rig
from palpate.core.gap.logs.proposal import propose
from palpate.core.jobs import run_job


def write_csv(path, columns):
    rows = zip(*columns.values(), strict=True)
    path.write_text(",".join(columns) + "\n" + "\n".join(",".join(f"{value:.12g}" for value in row) for row in rows) + "\n")
    return path


def template(folder, logs, **replacements):
    """Answers as a user completes them: the proposal with its questions filled in."""
    text = propose([read_log(path) for path in logs]).text
    for count in re.findall(r"# (\d+) texels; their rows and columns", text):
        rows = 2 if int(count) % 2 == 0 else 1
        text = text.replace('rows = "?", columns = "?"', f"rows = {rows}, columns = {int(count) // rows}")
    text = text.replace('pitch = ["?", "?"]', "pitch = [0.005, 0.005]")
    for old, new in replacements.items():
        assert old.replace("_", " ") in text or old in text, text
        text = text.replace(old, new)
    path = folder / "answers.toml"
    path.write_text(text)
    return path


def new_rig(folder, logs, answers):
    return run_job(write_rig([read_log(path) for path in logs], read_answers(answers), folder))
