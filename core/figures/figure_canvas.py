# SPDX-License-Identifier: GPL-3.0-or-later
"""The canvas of every figure: a new figure, the style of its axes, and writing it to a file atomically.

matplotlib is imported on use, and only its Agg canvas, so that nothing here needs a window or changes another figure.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ParameterError
from ..io.file_writing import atomic_write
from .figure_style import FONT, INK, RULE, SMALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FONTS = ("Arial", "Helvetica", "Liberation Sans", "Nimbus Sans", "DejaVu Sans")
"""The first of these that the system has: the letters that journals ask for, or those that come with matplotlib."""
FILE_TYPES = ("png", "pdf", "svg")
"""Endings of the files that a figure can become."""


def new_figure(width: float, height: float) -> Figure:
    """Return a figure of its own, in inches, that no window and no other figure knows of."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def axes_in_inches(figure: Figure, x: float, y: float, across: float, up: float) -> Axes:
    """Add axes to a figure: their lower left corner, from that of the figure, and their size."""
    width, height = figure.get_size_inches().tolist()
    return figure.add_axes((x / width, y / height, across / width, up / height))


def tidy_axes(axes: Axes) -> None:
    """Leave of an axes what helps reading: two spines, a faint grid, small ticks."""
    axes.grid(True, color=RULE, lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=SMALL, colors=INK, length=2.5, width=0.6)
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set(fontsize=FONT, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color=INK, linewidth=0.6)


def file_type(path: str | Path) -> str:
    """Return the type of a figure's file, one of :data:`FILE_TYPES`, by its ending.

    Raises
    ------
    ParameterError
        The ending is of another kind.
    """
    path = Path(path)
    kind = path.suffix.lstrip(".").lower()
    if kind not in FILE_TYPES:
        raise ParameterError(f"'{path.name}' is not a figure that can be written: end its name with .png, .pdf or .svg.")
    return kind


def save_figure(figure: Figure, path: str | Path, dpi: float) -> None:
    """Write the figure, whole or not at all, as PNG, PDF or SVG by its ending.

    The same figure gives the same bytes: PDF without a date. Fonts go into it as such, so that a journal can edit the text.

    Raises
    ------
    ParameterError
        The ending is of another kind.
    FileError
        It cannot be written.
    """
    path = Path(path)
    kind = file_type(path)
    metadata = {"CreationDate": None} if kind == "pdf" else {"Date": None} if kind == "svg" else {"Software": "Palpate"}
    for axes in figure.axes:
        for label in (axes.xaxis.label, axes.yaxis.label, *axes.get_xticklabels(), *axes.get_yticklabels()):
            if float(label.get_fontsize()) > FONT:
                label.set_fontsize(FONT)
        legend = axes.get_legend()
        for text in legend.get_texts() if legend else ():
            text.set_fontsize(8)
    _write(figure, path, dpi, kind, metadata)


def save_pixels(pixels: np.ndarray, path: str | Path) -> None:
    """Write an image as a PNG, pixel by pixel, whole or not at all. Equal pixels give equal bytes.

    Parameters
    ----------
    pixels : (height, width, 3 or 4) uint8
        sRGB, the upper row first; the fourth channel is the opacity.

    Raises
    ------
    FileError
        It cannot be written.
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    about, encoded = PngInfo(), io.BytesIO()  # a full disk breaks the encoder, so it writes into memory
    about.add_text("Software", "Palpate")
    Image.fromarray(pixels).save(encoded, format="png", pnginfo=about)
    with atomic_write(path) as temporary:
        temporary.write_bytes(encoded.getvalue())


def _write(figure: Figure, path: Path, dpi: float, kind: str, metadata: dict[str, Any]) -> None:
    import matplotlib

    plain = {
        "font.family": "sans-serif",
        "font.sans-serif": FONTS,
        "pdf.fonttype": 42,
        "svg.fonttype": "none",
        "svg.hashsalt": "palpate",
    }
    encoded = io.BytesIO()  # a full disk breaks the encoders, so they write into memory
    with matplotlib.rc_context(plain):
        figure.savefig(encoded, dpi=dpi, format=kind, metadata=metadata)
    with atomic_write(path) as temporary:
        temporary.write_bytes(encoded.getvalue())
