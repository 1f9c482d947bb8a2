# SPDX-License-Identifier: GPL-3.0-or-later
"""What every figure is drawn on: its colours, text of 8 pt and more at the written size, files that are whole or not there.

matplotlib is imported on use, and only its Agg canvas, so that nothing here needs a window or touches another figure.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from .formats.files import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FONT = 8.5
"""Base size of the text, points."""

INK, GREY = "#1c2430", "#68727f"
NORMAL_COLOUR, SHEAR_COLOUR = "#1f5fa8", "#c8501e"


def new_figure(width: float, height: float) -> Figure:
    """Return a figure of its own, in inches, that no window and no other figure knows of."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: str | Path, dpi: int) -> None:
    """Write the figure, whole or not at all; PDF without a date, so that the same recording gives the same file."""
    path = Path(path)
    kind = path.suffix.lstrip(".").lower() or "png"
    metadata = {"CreationDate": None} if kind == "pdf" else {"Date": None} if kind == "svg" else {"Software": "Palpate"}
    for axes in figure.axes:
        for label in (axes.xaxis.label, axes.yaxis.label, *axes.get_xticklabels(), *axes.get_yticklabels()):
            if float(label.get_fontsize()) > FONT:
                label.set_fontsize(FONT)
    for axes in figure.axes:
        legend = axes.get_legend()
        for text in legend.get_texts() if legend else ():
            text.set_fontsize(8)
    _write(figure, path, dpi, kind, metadata)


def _write(figure: Figure, path: Path, dpi: int, kind: str, metadata: dict[str, Any]) -> None:
    with atomic_write(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format=kind, metadata=metadata)
