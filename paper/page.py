# SPDX-License-Identifier: GPL-3.0-or-later
"""The HTML page of all experiments: our numbers beside the paper's, and the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..core.figures.html_templates import render_html
from ..core.io.file_writing import write_text
from .chapter import Chapter

TEMPLATE = Path(__file__).parent / "templates" / "paper.html"


def write_page(path: Path, chapters: Sequence[Chapter], seconds: float) -> None:
    """Write the page. It links the pictures by paths relative to its folder."""
    folder = path.parent
    rows = [row for chapter in chapters for row in chapter.rows]
    pictures = [picture.path for chapter in chapters for picture in chapter.pictures]
    vectors = {picture: picture.with_suffix(".pdf") for picture in pictures}
    text = render_html(
        TEMPLATE,
        chapters=chapters,
        seconds=seconds,
        kept=sum(row.kept is True for row in rows),
        judged=sum(row.kept is not None for row in rows),
        links={picture: picture.relative_to(folder).as_posix() for picture in pictures},
        vectors={picture: file.relative_to(folder).as_posix() for picture, file in vectors.items() if file.exists()},
    )
    write_text(path, text)
