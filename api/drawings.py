# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for notebooks: where texels are, and figures that a notebook shows by themselves."""

from __future__ import annotations

import base64
import io
from typing import TYPE_CHECKING

from ..core.geometry.texels import Texels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PIXELS, RIM = 220, 8
"""Longer side of a drawing of texels, and the space around them."""
DPI = 110
"""Of figures in a notebook."""


def layout_svg(texels: Texels) -> str:
    """Return where texels lie, as a tactile image shows them, as SVG."""
    from ..core.figures.tactile_image import SensorView

    view = SensorView.of(texels)
    scale = (PIXELS - 2 * RIM) / max(view.width, view.height)
    x, y = (view.points - [view.window[0], view.window[2]]).T * scale
    width, height = view.width * scale + 2 * RIM, view.height * scale + 2 * RIM
    radius = max(0.8, min(4.0, 0.3 * scale * (view.width * view.height / len(texels)) ** 0.5))
    dots = "".join(
        f'<circle cx="{RIM + a:.1f}" cy="{height - RIM - b:.1f}" r="{radius:.1f}"/>' for a, b in zip(x, y, strict=True)
    )
    rim = '<rect width="100%" height="100%" fill="#f4f6f8" rx="4"/>'
    size = f'width="{width:.0f}" height="{height:.0f}" xmlns="http://www.w3.org/2000/svg"'
    return f'<svg {size}>{rim}<g fill="#1f5fa8">{dots}</g></svg>'


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=DPI)
    return content.getvalue()


def png_tag(figure: Figure) -> str:
    """Return a figure as an element of HTML."""
    return f'<img alt="tactile image" src="data:image/png;base64,{base64.b64encode(png(figure)).decode()}"/>'


def shown_in_notebooks(figure: Figure) -> Figure:
    """Let a notebook show a figure that is the value of a cell, also where pyplot, which does that, was not imported."""
    figure.__dict__["_repr_png_"] = lambda: png(figure)
    return figure
