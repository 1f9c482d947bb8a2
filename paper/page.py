# SPDX-License-Identifier: GPL-3.0-or-later
"""One HTML page of all experiments: our number beside the paper's, and the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from ..core.io.file_writing import atomic_write
from .chapter import Chapter, Picture, Row

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2430; margin: 0 auto; padding: 2rem 1.5rem 5rem; max-width: 66rem; }
h1 { font-size: 1.7rem; margin-bottom: 0; } h2 { font-size: 1.2rem; margin: 3rem 0 0.2rem; }
p.where { color: #68727f; margin: 0 0 0.6rem; } p { max-width: 48rem; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.9rem; width: 100%; }
th { text-align: left; font-weight: 600; border-bottom: 1.5px solid #1c2430; padding: 0.25rem 0.8rem 0.25rem 0; }
td { border-bottom: 1px solid #dfe3e8; padding: 0.3rem 0.8rem 0.3rem 0; vertical-align: top; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; } td.note { color: #68727f; font-size: 0.85rem; }
.yes { color: #1b7a3d; } .no { color: #b3261e; font-weight: 700; }
.pictures { display: flex; flex-wrap: wrap; gap: 1.2rem; } figure { margin: 0; flex: 1 1 22rem; max-width: 34rem; }
figure.wide { flex-basis: 100%; max-width: 100%; } img { width: 100%; height: auto; }
figcaption { font-size: 0.85rem; color: #68727f; } a { color: #1f5fa8; }
"""


def write_page(path: Path, chapters: Sequence[Chapter], seconds: float) -> None:
    """Write the page; pictures are linked relative to its folder."""
    rows = [row for chapter in chapters for row in chapter.rows]
    kept, judged = sum(row.kept is True for row in rows), sum(row.kept is not None for row in rows)
    body = [
        "<h1>The paper, run again</h1>",
        "<p>Every table and figure of the experiments in <i>Model of Tactile Sensors Using Soft Contacts and its Application "
        "in Robot Grasping Simulation</i>, computed by Palpate from the scenes in <code>sample_blends/</code>. "
        f"{kept} of {judged} rows are within their tolerance. Took {seconds:.0f} s.</p>",
        *(_chapter(chapter, path.parent) for chapter in chapters),
    ]
    text = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>The paper, run again</title><style>{STYLE}</style></head>\n<body>\n" + "\n".join(body) + "\n</body></html>\n"
    )
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _chapter(chapter: Chapter, folder: Path) -> str:
    lines = [
        f"<section><h2>{escape(chapter.title)}</h2>",
        f'<p class="where">{escape(chapter.where)}</p>',
        f"<p>{escape(chapter.text)}</p>",
    ]
    if chapter.rows:
        head = "".join(f"<th>{name}</th>" for name in ("", "paper", "expected", "here", "", "tolerance, remarks"))
        lines += [f"<table><tr>{head}</tr>", *(_row(row) for row in chapter.rows), "</table>"]
    if chapter.pictures:
        lines += ['<div class="pictures">', *(_picture(picture, folder) for picture in chapter.pictures), "</div>"]
    return "\n".join([*lines, "</section>"])


def _row(row: Row) -> str:
    mark = {True: '<span class="yes">✓</span>', False: '<span class="no">✗</span>', None: ""}[row.kept]
    numbers = "".join(f'<td class="number">{escape(text)}</td>' for text in (row.printed, row.expected, row.measured))
    return f'<tr><td>{escape(row.what)}</td>{numbers}<td>{mark}</td><td class="note">{escape(row.note)}</td></tr>'


def _picture(picture: Picture, folder: Path) -> str:
    source = picture.path.relative_to(folder).as_posix()
    vector = picture.path.with_suffix(".pdf")
    link = f' <a href="{escape(vector.relative_to(folder).as_posix())}">PDF</a>' if vector.exists() else ""
    wide = ' class="wide"' if picture.wide else ""
    words = escape(picture.caption)
    return f'<figure{wide}><img src="{escape(source)}" alt="{words}"><figcaption>{words}{link}</figcaption></figure>'
