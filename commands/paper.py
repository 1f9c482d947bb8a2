# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate paper``: every table and figure of the paper's experiments on one page, our numbers beside the printed ones."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import Any

from ..core.errors import ParameterError
from ..core.io.file_writing import writable_folder
from . import blender, console

MARKS = {True: "ok", False: "OFF", None: ""}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out", metavar="DIR", default="palpate-paper", help="folder for the page and its figures (default: %(default)s)"
    )
    parser.add_argument("--only", metavar="NAME", action="append", help="only this experiment; may be given again")


def run(arguments: argparse.Namespace) -> int:
    began = time.monotonic()
    folder = writable_folder(arguments.out, create=True)
    with console.blender_output_hidden():
        blender.start_blender()
        from ..paper import experiments, page

        wanted = arguments.only or list(experiments.EXPERIMENTS)
        for name in wanted:
            if name not in experiments.EXPERIMENTS:
                raise ParameterError(f"There is no experiment '{name}': choose from {', '.join(experiments.EXPERIMENTS)}.")
        chapters = []
        with console.progress_bar("paper", sum(experiments.EXPERIMENTS[name].steps for name in wanted), unit="step") as bar:

            def progress(*_: object) -> None:
                console.Interrupt.check()
                bar.update()

            for name in wanted:
                bar.set_description(name)
                chapters.append(experiments.EXPERIMENTS[name].run(folder, progress))
        path = folder / "index.html"
        page.write_page(path, chapters, time.monotonic() - began)
    print(report(chapters))
    print(f"\npage: {path}\ntook: {time.monotonic() - began:.0f} s")
    return 0


def report(chapters: Sequence[Any]) -> str:
    """Return all rows as text for the terminal."""
    lines = []
    for chapter in chapters:
        rows = [(row.what, row.printed, row.expected, row.measured, MARKS[row.kept]) for row in chapter.rows]
        lines += [
            f"{chapter.title} ({chapter.where})",
            console.text_table([("", "paper", "expected", "here", ""), *rows], "<<<<<"),
            "",
        ]
    judged = [row.kept for chapter in chapters for row in chapter.rows if row.kept is not None]
    lines.append(f"{sum(judged)} of {len(judged)} rows within their tolerance")
    return "\n".join(lines)
